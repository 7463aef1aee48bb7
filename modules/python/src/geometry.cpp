// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/geometry/carm_limits_settings.hpp"
#include "fields.hpp"
#include "settings.hpp"

namespace angio::python {
namespace {

XrayCamera cameraOf(int width_px, int height_px, double fx_px, double fy_px, double cx_px, double cy_px,
                    std::optional<double> pixel_spacing_m, std::optional<double> source_detector_distance_m) {
  return XrayCamera({width_px, height_px, fx_px, fy_px, cx_px, cy_px, pixel_spacing_m, source_detector_distance_m});
}

// One row a point. Absence is no NaN here: who has points behind the source asks with others.
Numbers projected(const XrayCamera& camera, const Numbers& points_camera) {
  const Eigen::Matrix3Xd points = pointsOf<3>(points_camera, "points");
  Eigen::Matrix2Xd pixels(2, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto pixel = camera.project(points.col(i));
    if (!pixel)
      throw InputError("", "points[" + std::to_string(i) + "].z", formatValue(points(2, i)),
                       "must be in front of the source, above 0");
    pixels.col(i) = *pixel;
  }
  return rowsOf<2, double>(pixels);
}

template <typename Value>
auto parameter(Value XrayCamera::Parameters::*member) {
  return [member](const XrayCamera& camera) { return camera.parameters().*member; };
}

void bindCamera(py::module_& m) {
  using P = XrayCamera::Parameters;
  py::class_<XrayCamera> camera(m, "XrayCamera", doc("XrayCamera"));
  camera.def(py::init(&cameraOf), doc("XrayCamera.XrayCamera"), "width_px"_a, "height_px"_a, "fx_px"_a, "fy_px"_a,
             "cx_px"_a, "cy_px"_a, py::kw_only(), "pixel_spacing_m"_a = py::none(),
             "source_detector_distance_m"_a = py::none());
  camera.def_static("centered", &XrayCamera::centered, doc("XrayCamera.centered"), "width_px"_a, "height_px"_a,
                    "pixel_spacing_m"_a, "source_detector_distance_m"_a);
  camera.def_property_readonly("width_px", &XrayCamera::width_px, "Of the detector.");
  camera.def_property_readonly("height_px", &XrayCamera::height_px, "Of the detector.");
  camera.def_property_readonly("fx_px", parameter(&P::fx_px), doc("XrayCamera.Parameters.fx_px"));
  camera.def_property_readonly("fy_px", parameter(&P::fy_px), doc("XrayCamera.Parameters.fx_px"));
  camera.def_property_readonly("cx_px", parameter(&P::cx_px), doc("XrayCamera.Parameters.cx_px"));
  camera.def_property_readonly("cy_px", parameter(&P::cy_px), doc("XrayCamera.Parameters.cx_px"));
  camera.def_property_readonly("pixel_spacing_m", parameter(&P::pixel_spacing_m),
                               doc("XrayCamera.Parameters.pixel_spacing_m"));
  camera.def_property_readonly("source_detector_distance_m", parameter(&P::source_detector_distance_m),
                               doc("XrayCamera.Parameters.source_detector_distance_m"));
  camera.def_property_readonly(
      "K",
      [](const XrayCamera& c) {
        const auto& p = c.parameters();
        return (Eigen::Matrix3d() << p.fx_px, 0, p.cx_px, 0, p.fy_px, p.cy_px, 0, 0, 1).finished();
      },
      "The 3 x 3 matrix of the intrinsic parameters [px].");
  camera.def("project", &projected,
             "Projects points in the camera frame, N x 3 [m], onto the detector, N x 2 [px]. Throws InputError for a "
             "point that is not in front of the source.",
             "points"_a);
  camera.def(
      "sees", [](const XrayCamera& c, const Eigen::Vector2d& pixel) { return c.sees(pixel); }, doc("XrayCamera.sees"),
      "pixel"_a);
  camera.def("__repr__", [](const XrayCamera& c) {
    return "<angio.XrayCamera of " + std::to_string(c.width_px()) + " x " + std::to_string(c.height_px()) + " px, f " +
           formatValue(c.parameters().fx_px) + " px>";
  });
}

void bindCArm(py::module_& m) {
  BoundStruct<ViewAngles>(m, "ViewAngles")
      .field("primary_rad", &ViewAngles::primary_rad)
      .field("secondary_rad", &ViewAngles::secondary_rad)
      .takesFields();
  BoundStruct<CArmGeometry> carm(m, "CArmGeometry");
  carm.field("source_isocenter_distance_m", &CArmGeometry::source_isocenter_distance_m)
      .field("source_detector_distance_m", &CArmGeometry::source_detector_distance_m)
      .field("pixel_spacing_m", &CArmGeometry::pixel_spacing_m)
      .field("image_width_px", &CArmGeometry::image_width_px)
      .field("image_height_px", &CArmGeometry::image_height_px)
      .field("l_arm_rad", &CArmGeometry::l_arm_rad)
      .takesFields();
  carm.get()
      .def("check", &CArmGeometry::check, doc("CArmGeometry.check"))
      .def("camera", py::overload_cast<>(&CArmGeometry::camera, py::const_), doc("CArmGeometry.camera"))
      .def(
          "T_camera_patient",
          [](const CArmGeometry& c, const CArmJoints& joints) { return arrayOf(c.T_camera_patient(joints)); },
          doc("CArmGeometry.T_camera_patient"), "joints"_a)
      .def("eJe", &CArmGeometry::eJe, doc("CArmGeometry.eJe"), "joints"_a)
      .def("joints_for", &CArmGeometry::jointsFor, doc("CArmGeometry.jointsFor"), "angles"_a, "target_patient"_a)
      .def("reachable", &CArmGeometry::reachable, doc("CArmGeometry.reachable"), "angles"_a, "target_patient"_a,
           "limits"_a, "near"_a);
  m.def("view_angles_of", py::overload_cast<const Eigen::Vector3d&>(&viewAnglesOf),
        "The view angles of a beam: the inverse of beam_direction(), for a direction of any length.",
        "beam_direction"_a);
  m.def("beam_direction", &beamDirection, doc("beamDirection"), "angles"_a);
  m.def("view_rotation", &viewRotation, doc("viewRotation"), "angles"_a);
}

}  // namespace

void bindGeometry(py::module_& m) {
  bindCamera(m);
  py::class_<CArmLimits>(m, "CArmLimits", doc("CArmLimits"))
      .def(py::init([](double isocenter_detector_m, const py::object& settings) {
             return withFields(CArmLimitsSettings{}, settings, "settings").limits(isocenter_detector_m);
           }),
           "As the section `limits` of a loop's settings says it, for a detector whose front is so far from the "
           "isocentre [m].",
           "isocenter_detector_m"_a, "settings"_a = py::none())
      .def_readwrite("lower", &CArmLimits::lower, "Range of the joints [rad, m].")
      .def_readwrite("upper", &CArmLimits::upper, "Range of the joints [rad, m].")
      .def_readwrite("velocity", &CArmLimits::velocity, "Of each joint [rad/s, m/s].")
      .def_readwrite("acceleration", &CArmLimits::acceleration, "Of each joint [rad/s^2, m/s^2].")
      .def_readwrite("jerk", &CArmLimits::jerk, fieldDoc("CArmLimits.jerk"));
  bindCArm(m);
  m.def(
      "exp_se3", [](const Twist& twist) { return arrayOf(expSE3(twist)); }, doc("expSE3"), "xi"_a);
  m.def(
      "log_se3", [](const Numbers& T) { return logSE3(poseOf(T, "T")); }, doc("logSE3"), "T"_a);
}

}  // namespace angio::python
