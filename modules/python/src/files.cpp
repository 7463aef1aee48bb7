// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/calibration_records/centered_carm.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/xa_files.hpp"
#include "fields.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

void bindCameraAndPoseFiles(py::module_& m) {
  m.def("read_camera", &readCamera, doc("readCamera"), "path"_a);
  m.def("write_camera", &writeCamera, doc("writeCamera"), "path"_a, "camera"_a);
  m.def(
      "read_pose", [](const std::string& path) { return arrayOf(readPose(path).T_camera_model); },
      "Reads the pose of the model in the camera from a pose file, 4 x 4.", "path"_a);
  m.def(
      "read_pose_covariance", [](const std::string& path) { return readPose(path).covariance; },
      "Reads the covariance of a pose file, 6 x 6, [translation; rotation] in metres and radians; None where it has "
      "none.",
      "path"_a);
  m.def(
      "write_pose",
      [](const std::string& path, const Numbers& T_camera_model, const std::optional<Matrix6d>& covariance,
         std::int64_t model_id) {
        writePose(path, {poseOf(T_camera_model, "T_camera_model"), covariance, ModelId{model_id}});
      },
      doc("writePose"), "path"_a, "T_camera_model"_a, py::kw_only(), "covariance"_a = py::none(), "model_id"_a = 0);
}

void bindXaRun(py::module_& m) {
  BoundStruct<XaGeometry>(m, "XaGeometry")
      .shows("camera", &XaGeometry::camera)
      .shows("source_detector_distance_m", &XaGeometry::source_detector_distance_m)
      .shows("source_isocenter_distance_m", &XaGeometry::source_isocenter_distance_m)
      .shows("spacing_from", &XaGeometry::spacing_from)
      .shows("patient_angles", &XaGeometry::patient_angles)
      .shows("table_shift_m", &XaGeometry::table_shift_m)
      .shows("time_s", &XaGeometry::time_s)
      .shows("T_camera_patient", &XaGeometry::T_camera_patient)
      .shows("assumed", &XaGeometry::assumed);
  py::class_<XaRun>(m, "XaRun", doc("XaRun"))
      .def(py::init([](const std::string& path) { return unlocked([&] { return std::make_unique<XaRun>(path); }); }),
           doc("XaRun.XaRun"), "path"_a)
      .def("__len__", &XaRun::frames)
      .def("geometry", &XaRun::geometry, doc("XaRun.geometry"), "frame"_a)
      .def(
          "image", [](const XaRun& run, int frame) { return arrayOf(run.image(frame)); }, doc("XaRun.image"),
          "frame"_a);
}

void bindCArmCalibration(py::module_& m) {
  BoundStruct<CArmCalibration> calibration(m, "CArmCalibration");
  calibration.field("carm", &CArmCalibration::carm)
      .field("T_dsa_cb", &CArmCalibration::T_dsa_cb)
      .field("R_lps_model", &CArmCalibration::R_lps_model)
      .field("machine", &CArmCalibration::machine)
      .field("model_id", &CArmCalibration::model_id)
      .takesFields();
  m.def("read_carm_calibration", py::overload_cast<const std::string&>(&readCArmCalibration),
        doc("readCArmCalibration"), "path"_a);
  m.def("write_carm_calibration", &writeCArmCalibration, doc("writeCArmCalibration"), "path"_a, "calibration"_a);
  m.def(
      "centered_in_patient",
      [](const Eigen::Vector3d& centroid_model) { return arrayOf(centeredInPatient(centroid_model)); },
      doc("centeredInPatient"), "centroid_model"_a);
  m.def(
      "miscalibrated",
      [](const CArmCalibration& truth, const Eigen::Vector3d& center_model, const Eigen::Vector3d& axis_patient,
         double angle_rad, const Eigen::Vector3d& shift_patient_m) {
        return miscalibrated(truth, center_model, axis_patient, angle_rad, shift_patient_m);
      },
      doc("miscalibrated"), "truth"_a, "center_model"_a, "axis_patient"_a, "angle_rad"_a, "shift_patient_m"_a);
}

}  // namespace

void bindFiles(py::module_& m) {
  m.def(
      "read_vessel_tree",
      [](const std::string& path) {
        return unlocked([&] { return std::make_shared<VesselTree>(readVesselTree(path)); });
      },
      doc("readVesselTree"), "path"_a);
  m.def(
      "write_vessel_tree", [](const std::string& path, const VesselTree& tree) { writeVesselTree(path, tree); },
      doc("writeVesselTree"), "path"_a, "tree"_a);
  m.def("read_centerline", &readCenterline, doc("readCenterline"), "path"_a);
  m.def("write_centerline", &writeCenterline, doc("writeCenterline"), "path"_a, "centerline"_a);
  m.def(
      "read_xray_image",
      [](const std::string& path, int frame) { return arrayOf(unlocked([&] { return readXrayImage(path, frame); })); },
      "Reads one frame of a PNG, TIFF or DICOM file as an array of uint8 or uint16, as a camera at the X-ray source "
      "sees it. Throws InputError that names the file.",
      "path"_a, "frame"_a = 0);
  m.def(
      "write_image", [](const std::string& path, const py::array& image) { writeImage(path, imageOf(image, "image")); },
      "Writes a grey image as PNG, TIFF or JPEG by extension, whole or not at all.", "path"_a, "image"_a);
  bindCameraAndPoseFiles(m);
  bindXaRun(m);
  bindCArmCalibration(m);
}

}  // namespace angio::python
