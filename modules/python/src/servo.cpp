// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_loop.hpp"

#include "angio/calibration_records/carm_calibration.hpp"
#include "fields.hpp"
#include "seen.hpp"
#include "servo_settings.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

using TreeLoop = OnTree<ServoLoop>;
using LoopReport = TreeReport<ServoReport>;

std::unique_ptr<TreeLoop> loopOn(std::shared_ptr<VesselTree> tree, const CArmCalibration& calibration,
                                 const py::object& given) {
  const ServoLoopSettings settings =
      apps::ServoSettings(withFields(apps::ServoSettings{}, given, "settings")).loop(calibration);
  return std::make_unique<TreeLoop>(
      std::move(tree), [&](const VesselTree& of) { return std::make_unique<Guarded<ServoLoop>>(settings, of); });
}

LoopReport propose(TreeLoop& loop, const XrayFrame& frame, const py::object& given) {
  const bool whole = py::isinstance<ServoInput>(given);
  if (!whole && !py::isinstance<CArmState>(given)) throw py::type_error("state must be a CArmState or a ServoInput");
  const ServoInput input =
      whole ? given.cast<ServoInput>() : ServoInput{frame.time_us, frame.sequence, given.cast<CArmState>()};
  return {loop.use([&](ServoLoop& l) { return l.propose(frame, input); }), loop.tree()};
}

void bindReport(py::module_& m) {
  BoundStruct<ViewError>(m, "ViewError")
      .shows("direction_rad", &ViewError::direction_rad)
      .shows("roll_rad", &ViewError::roll_rad)
      .shows("target_m", &ViewError::target_m);
  BoundStruct<TaskAnswer>(m, "TaskAnswer")
      .shows("velocity", &TaskAnswer::velocity)
      .shows("hold_reason", &TaskAnswer::hold_reason)
      .shows("view_error", &TaskAnswer::view_error)
      .shows("pixel_error", &TaskAnswer::pixel_error)
      .shows("target_off_m", &TaskAnswer::target_off_m)
      .shows("reached", &TaskAnswer::reached)
      .shows("remark", &TaskAnswer::remark);
  using R = ServoReport;
  const auto said = [](const char* field) { return doc(std::string("ServoReport.") + field); };
  py::class_<LoopReport>(m, "ServoReport", doc("ServoReport"))
      .def_property_readonly("command", LoopReport::told(&R::command), said("command"))
      .def_property_readonly("hold_reason", LoopReport::told(&R::hold_reason), said("hold_reason"))
      .def_property_readonly("contradicts", LoopReport::told(&R::contradicts), said("contradicts"))
      .def_property_readonly("observed", LoopReport::told(&R::observed), said("observed"))
      .def_property_readonly("task", LoopReport::told(&R::task), said("task"))
      .def_property_readonly("control_s", LoopReport::told(&R::control_s), said("control_s"))
      .def_property_readonly(
          "registration",
          [](const LoopReport& s) {
            const Observation& seen = s.report.observation;
            return TreeResult{seen.registration, s.tree, seen.image_s};
          },
          "Of a frame that was looked at.")
      .def_property_readonly(
          "centerline", [](const LoopReport& s) { return s.report.observation.centerline; },
          "What the registration went by.")
      .def_property_readonly(
          "predicted_T_camera_model",
          [](const LoopReport& s) { return arrayOf(s.report.observation.predicted.T_camera_model); },
          "Where the model was looked for, 4 x 4.")
      .def_property_readonly(
          "T_camera_model",
          [](const LoopReport& s) {
            return s.report.patient ? std::optional(arrayOf(s.report.patient->T_camera_model)) : std::nullopt;
          },
          "Where the model is, of a frame that may move the machine, 4 x 4; None of another one.");
}

}  // namespace

void bindServo(py::module_& m) {
  bindReport(m);
  py::class_<TreeLoop>(m, "ServoLoop", doc("ServoLoop"))
      .def(py::init(&loopOn),
           "The loop of a machine that is as its calibration says. Settings are a dict or a file of angio-servo: "
           "`task`, "
           "`view`, `law`, `limits` and so on.",
           py::arg("tree").none(false), "calibration"_a, "settings"_a = py::none())
      .def("propose", &propose, doc("ServoLoop.propose"), "frame"_a, "state"_a)
      .def(
          "refuse",
          [](TreeLoop& loop, const XrayFrame& frame, const std::string& why) {
            return LoopReport{loop.use([&](ServoLoop& l) { return l.refuse(frame, why); }), loop.tree()};
          },
          doc("ServoLoop.refuse"), "frame"_a, "why"_a)
      .def(
          "commit", [](TreeLoop& loop, const CArmCommand& sent) { loop.use([&](ServoLoop& l) { l.commit(sent); }); },
          doc("ServoLoop.commit"), "sent"_a)
      .def(
          "step",
          [](TreeLoop& loop, const XrayFrame& frame, const CArmState& state) {
            return LoopReport{loop.use([&](ServoLoop& l) { return l.step(frame, state); }), loop.tree()};
          },
          doc("ServoLoop.step"), "frame"_a, "state"_a)
      .def(
          "learn", [](TreeLoop& loop) { loop.use([](ServoLoop& l) { l.learn(); }); }, doc("ServoLoop.learn"))
      .def_static(
          "withheld",
          [](const LoopReport& proposal, const std::string& why) {
            LoopReport held = proposal;
            ServoLoop::withhold(held.report, why);
            return held;
          },
          "A proposal made one to stand still.", "proposal"_a, "why"_a)
      .def_property_readonly(
          "desired_T_camera_model",
          [](TreeLoop& loop) {
            const auto pose = loop.use([](ServoLoop& l) { return l.task().desired_T_camera_model(); });
            return pose ? std::optional(arrayOf(*pose)) : std::nullopt;
          },
          "The desired pose of the model in the camera, where the task has one, 4 x 4.")
      .def_property_readonly(
          "target_model", [](TreeLoop& loop) { return loop.use([](ServoLoop& l) { return l.target_model(); }); },
          "The point that matters [m].");
  m.def(
      "view_error",
      [](const Numbers& T_camera_model, const Numbers& desired, const Eigen::Vector3d& target_model) {
        return viewError(poseOf(T_camera_model, "T_camera_model"), poseOf(desired, "desired_T_camera_model"),
                         target_model);
      },
      "How far a pose is from a view.", "T_camera_model"_a, "desired_T_camera_model"_a, "target_model"_a);
}

}  // namespace angio::python
