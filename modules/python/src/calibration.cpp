// SPDX-License-Identifier: GPL-2.0-or-later
#include <nlohmann/json.hpp>

#include "angio/calibration/camera_calibration.hpp"
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
py::dict handEye(const PoseSet& set, const py::object& settings) {
  const auto asked = withFields(HandEyeSettings{}, settings, "settings");
  const HandEyeResult found = unlocked([&] { return calibrateHandEye(set, asked); });
  const auto [x, z] = transformNames(set.setup);
  py::dict result;
  result[x.c_str()] = arrayOf(found.transforms.X);
  result[z.c_str()] = arrayOf(found.transforms.Z);
  result["covariance"] = found.covariance;
  result["outliers"] = found.outliers();
  result["warnings"] = found.warnings;
  result["record"] = pythonOf(recordAsJson(handEyeRecord(set, asked, found)));
  return result;
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
  m.def(
      "calibrate_hand_eye",
      [](const std::vector<Numbers>& T_base_hand, const std::vector<Numbers>& T_camera_object, bool eye_to_hand,
         const py::object& settings) { return handEye(poseSet(T_base_hand, T_camera_object, eye_to_hand), settings); },
      doc("calibrateHandEye"), "T_base_hand"_a, "T_camera_object"_a, py::kw_only(), "eye_to_hand"_a = false,
      "settings"_a = py::none());
  m.def(
      "calibrate_hand_eye_poses",
      [](const std::string& path, const py::object& settings) {
        return handEye(unlocked([&] { return readPoseSet(path); }), settings);
      },
      "The same of a pose set's file, as `angio-calibrate hand-eye` reads it.", "path"_a, py::kw_only(),
      "settings"_a = py::none());
}

}  // namespace angio::python
