// SPDX-License-Identifier: GPL-2.0-or-later
#include <nlohmann/json.hpp>

#include "anatomy_cases.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/carm_files.hpp"
#include "angio/calibration/hand_eye.hpp"
#include "angio/calibration/view_set.hpp"
#include "fields.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

// One view: the numbers of its points, and where they were seen.
using SeenPoints = std::pair<std::vector<int>, Numbers>;

CameraCalibration calibrated(const Numbers& points_m, const std::vector<SeenPoints>& seen, int width_px, int height_px,
                             std::optional<double> pixel_spacing_m, const py::object& settings) {
  BeadPhantom phantom;
  const Eigen::Matrix3Xd points = pointsOf<3>(points_m, "points_m");
  for (const auto& point : points.colwise()) phantom.beads.push_back({point, 0});
  std::vector<BeadView> views;
  for (const auto& [numbers, pixels] : seen) {
    const std::string name = "views[" + std::to_string(views.size()) + "]";
    const Eigen::Matrix2Xd places = pointsOf<2>(pixels, name);
    if (places.cols() != static_cast<Eigen::Index>(numbers.size())) {
      throw InputError("", name, std::to_string(numbers.size()) + " numbers", "must be as many as pixels");
    }
    BeadView view;
    view.name = name;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      view.beads.push_back({numbers[i], places.col(static_cast<Eigen::Index>(i)), 1});
    }
    views.push_back(std::move(view));
  }
  const auto asked = withFields(CameraCalibrationSettings{}, settings, "settings");
  return unlocked([&] { return calibrateCamera(phantom, {width_px, height_px, pixel_spacing_m}, views, asked); });
}

CameraCalibration calibratedFile(const std::string& path, const py::object& settings) {
  const auto asked = withFields(CameraCalibrationSettings{}, settings, "settings");
  return unlocked([&] {
    const ViewSet set = readViewSet(path);
    const BeadPhantom phantom = phantomOf(set);
    const SeenViewSet seen = seenViews(set, phantom);
    try {
      return calibrateCamera(phantom, seen.detector, seen.views, asked);
    } catch (const InputError& error) {
      throw error.within(path);
    }
  });
}

PoseSet poseSet(const std::vector<Numbers>& hands, const std::vector<Numbers>& cameras, bool eye_to_hand) {
  if (hands.size() != cameras.size()) {
    throw InputError("", "T_camera_object", std::to_string(cameras.size()) + " poses",
                     "must be as many as T_base_hand has, " + std::to_string(hands.size()));
  }
  PoseSet set;
  set.path = "poses";
  set.setup = eye_to_hand ? HandEyeSetup::kEyeToHand : HandEyeSetup::kEyeInHand;
  for (std::size_t i = 0; i < hands.size(); ++i) {
    const std::string at = "[" + std::to_string(i) + "]";
    HandEyePose pose;
    pose.name = std::to_string(i);
    pose.T_base_hand = poseOf(hands[i], "T_base_hand" + at);
    pose.T_camera_object = poseOf(cameras[i], "T_camera_object" + at);
    set.poses.push_back(pose);
  }
  checkPoseSet(set);
  return set;
}

// Transforms under their names, the record, and each pose's fit.
py::dict handEye(const PoseSet& set, const HandEyeSettings& settings, const HandEyeResult& found) {
  const auto [x, z] = transformNames(set.setup);
  py::dict result;
  result[x.c_str()] = arrayOf(found.transforms.X);
  result[z.c_str()] = arrayOf(found.transforms.Z);
  result["covariance"] = found.covariance;
  result["outliers"] = found.outliers();
  result["warnings"] = found.warnings;
  result["record"] = pythonOf(recordAsJson(handEyeRecord(set, settings, found)));
  return result;
}

py::dict handEyeOfArrays(const std::vector<Numbers>& T_base_hand, const std::vector<Numbers>& T_camera_object,
                         bool eye_to_hand, const py::object& settings) {
  const PoseSet set = poseSet(T_base_hand, T_camera_object, eye_to_hand);
  const auto asked = withFields(HandEyeSettings{}, settings, "settings");
  return handEye(set, asked, unlocked([&] { return calibrateHandEye(set, asked); }));
}

py::dict handEyeOfFile(const std::string& path, const std::optional<std::string>& carm_path,
                       const std::optional<std::string>& out, const py::object& settings) {
  const auto asked = withFields(HandEyeSettings{}, settings, "settings");
  if (!carm_path) {
    if (out) throw InputError("", "out", *out, "needs carm: a C-arm file is what T_dsa_cb is added to");
    const PoseSet set = unlocked([&] { return readPoseSet(path); });
    return handEye(set, asked, unlocked([&] { return calibrateHandEye(set, asked); }));
  }
  const CArmFile carm = readCArmFile(*carm_path);
  const PoseSet set = unlocked([&] { return readPoseSet(path, &carm.carm); });
  requirePosesOf(set, *carm_path, carm);
  const HandEyeResult found = unlocked([&] { return calibratePatient(set, asked); });
  if (out) {
    CalibrationRecord record = handEyeRecord(set, asked, found);
    record.inputs.push_back(hashedInput(*carm_path));
    writeCArmFile(*out, withPatient(carm, found.transforms.Z, record));
  }
  py::dict result = handEye(set, asked, found);
  result["T_dsa_cb"] = arrayOf(found.transforms.Z);
  return result;
}

Eigen::Vector3d spreadOf(const Eigen::Matrix3d& covariance) { return covariance.diagonal().cwiseSqrt(); }

py::dict anatomyAsDict(const apps::AnatomyAsked& asked, const apps::RegisteredAnatomy& found,
                       const AnatomyResult& result, const CalibrationRecord& record) {
  py::dict dict, runs, statuses;
  for (const RunShift& run : result.runs) {
    runs[run.run.c_str()] = py::dict("shift_m"_a = run.shift_m, "std_m"_a = spreadOf(run.covariance));
  }
  for (const CaseOutcome& outcome : found.outcomes) statuses[outcome.name.c_str()] = statusName(outcome.result.status);
  dict["T_dsa_cb"] = arrayOf(patientOf(result, asked));
  dict["covariance"] = result.covariance;
  dict["runs"] = runs;
  dict["statuses"] = statuses;
  dict["views"] = result.views;
  dict["not_registered"] = found.left_out;
  dict["chi2_per_freedom"] = result.chi2_per_freedom;
  dict["held_out_rotation_rms_rad"] = result.held_out_rotation_rms_rad;
  dict["record"] = pythonOf(recordAsJson(record));
  return dict;
}

py::dict registrationOfCases(apps::AnatomyAsked asked, const std::optional<std::string>& out, bool leave_one_out,
                             const py::object& settings, const py::object& progress) {
  asked.settings = withFields(asked.settings, settings, "settings");
  const PythonCallback report(progress);
  const apps::AnatomyCases cases = unlocked([&] { return readAnatomyCases(asked); });
  const apps::RegisteredAnatomy found =
      alone([&] { return registerViews(cases, asked, [&](int done) { report(done); }); });
  const AnatomyResult result = unlocked([&] { return anatomyOf(found.seen, cases.tree, asked); });
  py::dict dict = anatomyAsDict(asked, found, result, anatomyRecord(result, cases.angles.machine, cases.input_paths));
  if (leave_one_out) {
    dict["leave_one_out"] = unlocked([&] { return leaveOneOut(result, found.seen, cases.tree, asked); });
  }
  if (out) writeAnatomy(*out, cases, asked, result);
  return dict;
}

void bindRegistrationCalibration(py::module_& m) {
  BoundStruct<AnatomyViewFit>(m, "AnatomyViewFit")
      .shows("name", &AnatomyViewFit::name)
      .shows("rotation_rad", &AnatomyViewFit::rotation_rad)
      .shows("translation_m", &AnatomyViewFit::translation_m)
      .shows("sigmas", &AnatomyViewFit::sigmas)
      .shows("outlier", &AnatomyViewFit::outlier)
      .shows("held_out_rotation_rad", &AnatomyViewFit::held_out_rotation_rad);
  py::class_<apps::LeftOutView>(m, "LeftOutView", "A view left out, and T_dsa_cb made of the others alone.")
      .def_readonly("name", &apps::LeftOutView::name)
      .def_readonly("rotation_rad", &apps::LeftOutView::rotation_rad,
                    "The view's rotation as registered from how T_dsa_cb predicts it.")
      .def_readonly("moved_rad", &apps::LeftOutView::moved_rad, "T_dsa_cb from that of all views.");
  const apps::AnatomyAsked usual;
  m.def(
      "calibrate_registration_cases",
      [](const std::string& cases, const std::string& angles, const std::optional<std::string>& carm,
         const std::optional<std::string>& out, const std::string& run, const std::string& method,
         double search_rotation_deg, double search_translation_mm, bool refine, bool leave_one_out,
         const py::object& settings, const py::object& progress) {
        return registrationOfCases({cases, angles, carm.value_or(""), run, method, search_rotation_deg,
                                    search_translation_mm, refine, AnatomyRegistrationSettings{}},
                                   out, leave_one_out, settings, progress);
      },
      "T_dsa_cb, and a shift for each run, from a case set (cases.yaml) of registered runs: what `angio-calibrate "
      "registration` finds, as a dict. `angles` is a file, otherwise angles.yaml beside the case set or the DICOM "
      "images tell; with a C-arm file `carm`, `out` is that file with T_dsa_cb and its record, and without one "
      "T_dsa_cb "
      "with the runs' shifts, written whole or not at all; `run` takes T_dsa_cb of one run, its shift included. "
      "Settings "
      "are a dict: `angle_std_deg`, `shift_std_mm`. Throws InputError for what leaves the answer open; Ctrl-C ends the "
      "registrations with those that are finished.",
      "cases"_a, py::kw_only(), "angles"_a = "", "carm"_a = py::none(), "out"_a = py::none(), "run"_a = "",
      "method"_a = usual.method, "search_rotation_deg"_a = usual.search_rotation_deg,
      "search_translation_mm"_a = usual.search_translation_mm, "refine"_a = usual.refine, "leave_one_out"_a = false,
      "settings"_a = py::none(), "progress"_a = py::none());
}

// A geometry with the C-arm file that angio-calibrate makes of it.
struct CalibratedGeometry {
  GeometryCalibration found;
  CArmFile file;
};

CalibratedGeometry geometryOfFile(const std::string& views_path, const std::string& camera_path,
                                  const std::string& machine, const py::object& settings) {
  const auto asked = withFields(GeometryFileSettings{}, settings, "settings");
  const GeometryInput input = unlocked([&] { return readGeometryInput(views_path, camera_path, asked.detection); });
  const RecordGate gate{machine.empty() ? input.machine : machine, RecordGate().max_age_days};
  for (const std::string& warning : checkRecords(camera_path, input.records, gate)) {
    if (PyErr_WarnEx(PyExc_UserWarning, warning.c_str(), 1) != 0) throw py::error_already_set();
  }
  return unlocked([&] {
    const GeometryCalibration found = calibrateGeometry(input, asked.geometry);
    return CalibratedGeometry{found, carmFileOf(input, found, machine)};
  });
}

template <typename Value>
auto ofGeometry(Value GeometryCalibration::*member) {
  return [member](const CalibratedGeometry& g) { return g.found.*member; };
}

void bindGeometryCalibration(py::module_& m) {
  BoundStruct<GeometryViewFit>(m, "GeometryViewFit")
      .shows("name", &GeometryViewFit::name)
      .shows("joints", &GeometryViewFit::joints)
      .shows("residual", &GeometryViewFit::residual)
      .shows("miss", &GeometryViewFit::miss)
      .shows("held_out", &GeometryViewFit::held_out)
      .shows("left_out", &GeometryViewFit::left_out);
  using G = GeometryCalibration;
  const auto said = [](const char* field) { return fieldDoc(std::string("GeometryCalibration.") + field); };
  py::class_<CalibratedGeometry>(m, "GeometryCalibration", doc("GeometryCalibration"))
      .def_property_readonly("carm", ofGeometry(&G::carm), "The C-arm as it was found.")
      .def_property_readonly(
          "T_patient_phantom", [](const CalibratedGeometry& g) { return arrayOf(g.found.T_patient_phantom); },
          said("T_patient_phantom"))
      .def_property_readonly(
          "record", [](const CalibratedGeometry& g) { return pythonOf(recordAsJson(g.file.records.back())); },
          "Values, covariance and residuals, with the keys of a file's section `calibration`.")
      .def_property_readonly("views", ofGeometry(&G::views), said("views"))
      .def_property_readonly("kept", ofGeometry(&G::kept), said("kept"))
      .def_property_readonly("doubts", ofGeometry(&G::doubts), said("doubts"))
      .def_property_readonly("bead_std_px", ofGeometry(&G::bead_std_px), said("bead_std_px"))
      .def_property_readonly("pose_scatter_m", ofGeometry(&G::pose_scatter_m), said("pose_scatter_m"))
      .def_property_readonly("pose_scatter_rad", ofGeometry(&G::pose_scatter_rad), said("pose_scatter_m"))
      .def_property_readonly("rms_without_flex", ofGeometry(&G::rms_without_flex), said("rms_without_flex"))
      .def(
          "write", [](const CalibratedGeometry& g, const std::string& path) { writeCArmFile(path, g.file); },
          "Writes the C-arm file that `angio-calibrate geometry --out` writes, whole or not at all; T_dsa_cb is for "
          "calibrate_hand_eye_poses to add.",
          "path"_a);
  m.def(
      "calibrate_geometry_views", &geometryOfFile,
      "Calibrates how a C-arm's joints move its camera, from the files of `angio-calibrate geometry`: views of a bead "
      "phantom with their joints, or registered poses, and the camera. Settings are a dict or a file of that program, "
      "sections `detection` and `geometry`. Throws InputError for what leaves the answer open.",
      "views"_a, "camera"_a, py::kw_only(), "machine"_a = "", "settings"_a = py::none());
}

}  // namespace

void bindCalibration(py::module_& m) {
  py::class_<CameraCalibration>(m, "CameraCalibration", doc("CameraCalibration"))
      .def_property_readonly(
          "camera", [](const CameraCalibration& c) { return c.camera.camera; }, fieldDoc("CameraCalibration.camera"))
      .def_property_readonly(
          "record", [](const CameraCalibration& c) { return pythonOf(recordAsJson(c.record)); },
          "Values, covariance and residuals, with the keys of a file's section `calibration`.")
      .def_property_readonly(
          "T_camera_phantom",
          [](const CameraCalibration& c) {
            std::vector<Numbers> poses;
            for (const auto& view : c.views) poses.push_back(arrayOf(view.T_camera_phantom));
            return poses;
          },
          "Of each view, 4 x 4.")
      .def_readonly("noise_px", &CameraCalibration::noise_px, doc("CameraCalibration.noise_px"));
  m.def(
      "calibrate_camera", &calibrated,
      "Calibrates a camera from views of one phantom of numbered points, N x 3 [m]. Each view is a pair: the numbers "
      "of the points that were seen, and where, M x 2 [px]. Settings are the keys of `angio-calibrate camera`. Throws "
      "InputError for what leaves the answer open.",
      "points_m"_a, "views"_a, "width_px"_a, "height_px"_a, py::kw_only(), "pixel_spacing_m"_a = py::none(),
      "settings"_a = py::none());
  m.def("calibrate_camera_views", &calibratedFile,
        "The same of a view set's file, as `angio-calibrate camera` reads it.", "path"_a, py::kw_only(),
        "settings"_a = py::none());
  m.def("calibrate_hand_eye", &handEyeOfArrays, doc("calibrateHandEye"), "T_base_hand"_a, "T_camera_object"_a,
        py::kw_only(), "eye_to_hand"_a = false, "settings"_a = py::none());
  m.def("calibrate_hand_eye_poses", &handEyeOfFile,
        "The same of a pose set's file, as `angio-calibrate hand-eye` reads it. With the C-arm's file `carm` hands may "
        "be "
        "angles, and the result has `T_dsa_cb`; `out` then is that file with T_dsa_cb and its record, written whole or "
        "not at all. `settings={\"mount\": \"identity\"}` is the program's --known-mount.",
        "path"_a, py::kw_only(), "carm"_a = py::none(), "out"_a = py::none(), "settings"_a = py::none());
  bindGeometryCalibration(m);
  bindRegistrationCalibration(m);
}

}  // namespace angio::python
