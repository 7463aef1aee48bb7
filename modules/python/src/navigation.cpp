// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_controller.hpp"

#include "angio/calibration_records/carm_calibration.hpp"
#include "fields.hpp"
#include "navigate_options.hpp"
#include "seen.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

using navigation::CatheterController;
using navigation::NavigationAnswer;
using navigation::NavigationState;

using TreeController = OnTree<CatheterController>;
using ControllerReport = TreeReport<navigation::CatheterControllerReport>;

std::unique_ptr<TreeController> controllerOn(std::shared_ptr<VesselTree> tree, const CArmCalibration& calibration,
                                             const TreeLocation& start, const TreeLocation& target,
                                             const py::object& given) {
  const apps::NavigateSettings settings = withFields(apps::NavigateSettings{}, given, "settings");
  settings.limits.check();
  const navigation::CArmSetup setup = settings.stage(calibration);
  return std::make_unique<TreeController>(std::move(tree), [&](const VesselTree& of) {
    return std::make_unique<Guarded<CatheterController>>(setup, of, start, target, settings.controller);
  });
}

void bindBelief(py::module_& m) {
  py::enum_<BeliefStatus>(m, "BeliefStatus", doc("BeliefStatus"))
      .value("unknown", BeliefStatus::kUnknown, doc("BeliefStatus.kUnknown"))
      .value("seen", BeliefStatus::kSeen, doc("BeliefStatus.kSeen"))
      .value("unsure", BeliefStatus::kUnsure, doc("BeliefStatus.kUnsure"))
      .value("predicted", BeliefStatus::kPredicted, doc("BeliefStatus.kPredicted"))
      .value("lost", BeliefStatus::kLost, doc("BeliefStatus.kLost"));
  BoundStruct<TipPlace>(m, "TipPlace")
      .shows("branch", &TipPlace::branch)
      .shows("arc_m", &TipPlace::arc_m)
      .shows("path_m", &TipPlace::path_m)
      .shows("std_m", &TipPlace::std_m)
      .shows("probability", &TipPlace::probability)
      .shows("tip_model", &TipPlace::tip_model)
      .shows("direction_model", &TipPlace::direction_model);
  BoundStruct<TipBelief>(m, "TipBelief")
      .shows("status", &TipBelief::status)
      .shows("why", &TipBelief::why)
      .shows("tip", &TipBelief::tip)
      .shows("near_probability", &TipBelief::near_probability)
      .shows("alternatives", &TipBelief::alternatives)
      .shows("residual_px", &TipBelief::residual_px)
      .shows("shift_px", &TipBelief::shift_px);
  py::enum_<NavigationState>(m, "NavigationState", "What a catheter's controller does with a frame.")
      .value("waiting", NavigationState::kWaiting, doc("NavigationState.kWaiting"))
      .value("following", NavigationState::kFollowing, doc("NavigationState.kFollowing"))
      .value("looking", NavigationState::kLooking, doc("NavigationState.kLooking"))
      .value("aiming", NavigationState::kAiming, doc("NavigationState.kAiming"))
      .value("crossing", NavigationState::kCrossing, doc("NavigationState.kCrossing"))
      .value("backing_off", NavigationState::kBackingOff, doc("NavigationState.kBackingOff"))
      .value("arrived", NavigationState::kArrived)
      .value("given_up", NavigationState::kGivenUp, doc("NavigationState.kGivenUp"));
  BoundStruct<NavigationAnswer>(m, "NavigationAnswer")
      .shows("command", &NavigationAnswer::command)
      .shows("state", &NavigationAnswer::state)
      .shows("why", &NavigationAnswer::why)
      .shows("another_view", &NavigationAnswer::another_view);
}

void bindCatheterReport(py::module_& m) {
  using R = navigation::CatheterControllerReport;
  const auto said = [](const char* field) { return doc(std::string("CatheterControllerReport.") + field); };
  py::class_<ControllerReport>(m, "CatheterControllerReport", doc("CatheterControllerReport"))
      .def_property_readonly("command", ControllerReport::told(&R::command), said("command"))
      .def_property_readonly("hold_reason", ControllerReport::told(&R::hold_reason), said("hold_reason"))
      .def_property_readonly("contradicts", ControllerReport::told(&R::contradicts), said("contradicts"))
      .def_property_readonly("roadmap", ControllerReport::told(&R::roadmap), said("roadmap"))
      .def_property_readonly("view_request", ControllerReport::told(&R::view_request), said("view_request"))
      .def_property_readonly(
          "registration",
          [](const ControllerReport& s) {
            return s.report.registration ? std::optional(TreeResult{*s.report.registration, s.tree, 0}) : std::nullopt;
          },
          said("registration"))
      .def_property_readonly(
          "T_camera_model",
          [](const ControllerReport& s) {
            return s.report.patient ? std::optional(arrayOf(s.report.patient->T_camera_model)) : std::nullopt;
          },
          "Where the model is, of a frame that was searched for the catheter, 4 x 4; None of another one.")
      .def_property_readonly(
          "state", [](const ControllerReport& s) { return s.report.loop.answer.state; },
          "What the navigator does with the frame.")
      .def_property_readonly(
          "why", [](const ControllerReport& s) { return s.report.loop.answer.why; },
          "Why it stands still or goes back; empty when all is well.")
      .def_property_readonly(
          "answer", [](const ControllerReport& s) { return s.report.loop.answer; },
          "The navigator's answer, whose command is not cut by force and limits yet.")
      .def_property_readonly(
          "belief", [](const ControllerReport& s) { return s.report.loop.input.belief; },
          "Where the tip is in the tree; None of a frame that was not searched for the catheter.")
      .def_property_readonly(
          "catheter_px",
          [](const ControllerReport& s) {
            const auto& trace = s.report.loop.trace;
            return trace ? std::optional(rowsOf<2, double>(trace->seen.points_px)) : std::nullopt;
          },
          "The catheter's line in the image, N x 2, the tip last [px]; None where it was not seen.");
}

}  // namespace

void bindNavigation(py::module_& m) {
  bindBelief(m);
  bindCatheterReport(m);
  const auto said = [](const char* member) { return doc(std::string("CatheterController.") + member); };
  py::class_<TreeController>(m, "CatheterController", doc("CatheterController"))
      .def(py::init(&controllerOn),
           "The controller of a catheter whose tip is near `start`, on its way to `target`, in a C-arm that is as its "
           "calibration says. Settings are a dict or a file of angio-navigate. Throws InputError when a setting is out "
           "of its range, or a place is none of the tree's.",
           py::arg("tree").none(false), "calibration"_a, "start"_a, "target"_a, "settings"_a = py::none())
      .def(
          "propose",
          [](TreeController& c, const XrayFrame& frame, const CatheterInput& input) {
            return ControllerReport{c.use([&](CatheterController& l) { return l.propose(frame, input); }), c.tree()};
          },
          said("propose"), "frame"_a, "input"_a)
      .def(
          "refuse",
          [](TreeController& c, const XrayFrame& frame, const std::string& why) {
            return ControllerReport{c.use([&](CatheterController& l) { return l.refuse(frame, why); }), c.tree()};
          },
          said("refuse"), "frame"_a, "why"_a)
      .def(
          "commit",
          [](TreeController& c, const CatheterCommand& sent) { c.use([&](CatheterController& l) { l.commit(sent); }); },
          said("commit"), "sent"_a)
      .def(
          "learn", [](TreeController& c) { c.use([](CatheterController& l) { l.learn(); }); }, said("learn"))
      .def_static(
          "withheld",
          [](const ControllerReport& proposal, const std::string& why) {
            ControllerReport held = proposal;
            CatheterController::withhold(held.report, why);
            return held;
          },
          "A proposal made one to stand still.", "proposal"_a, "why"_a)
      .def_property_readonly(
          "navigation", [](TreeController& c) { return c.use([](CatheterController& l) { return l.navigation(); }); },
          "What it does, by the last frame that was searched for the catheter.")
      .def_property_readonly(
          "misses", [](TreeController& c) { return c.use([](CatheterController& l) { return l.misses(); }); },
          said("misses"))
      .def_property_readonly(
          "target_model",
          [](TreeController& c) {
            return c.use([](CatheterController& l) -> Eigen::Vector3d { return l.target_model(); });
          },
          "The tree's centroid [m].");
}

}  // namespace angio::python
