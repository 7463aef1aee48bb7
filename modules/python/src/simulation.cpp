// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/nodes.hpp"
#include "fields.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

using GuardedXray = Guarded<SimulatedXrayNode>;
using GuardedCatheter = Guarded<SimulatedCatheter>;

std::shared_ptr<GuardedCatheter> catheterOf(const VesselTree& tree, const TreeLocation& start,
                                            const py::object& settings, bool elastic, std::int64_t now_us) {
  auto catheter = withFields(CatheterSettings{}, settings, "settings");
  if (elastic) catheter.elastic.emplace();
  return unlocked([&] { return std::make_shared<GuardedCatheter>(tree, catheter, start, now_us); });
}

void bindCatheter(py::module_& m) {
  BoundStruct<CatheterTruth>(m, "CatheterTruth")
      .shows("tip", &CatheterTruth::tip)
      .shows("path_m", &CatheterTruth::path_m)
      .shows("tip_model", &CatheterTruth::tip_model)
      .shows("direction_model", &CatheterTruth::direction_model)
      .shows("roll_rad", &CatheterTruth::roll_rad)
      .shows("bend_rad", &CatheterTruth::bend_rad)
      .shows("touches_wall", &CatheterTruth::touches_wall)
      .shows("buckled", &CatheterTruth::buckled)
      .shows("wall_contacts", &CatheterTruth::wall_contacts)
      .shows("tip_force_n", &CatheterTruth::tip_force_n)
      .shows("max_tip_force_n", &CatheterTruth::max_tip_force_n)
      .shows("max_push_n", &CatheterTruth::max_push_n)
      .shows("max_pull_n", &CatheterTruth::max_pull_n);
  py::class_<GuardedCatheter, std::shared_ptr<GuardedCatheter>>(m, "SimulatedCatheter", doc("SimulatedCatheter"))
      .def(
          py::init(&catheterOf),
          "With its tip at `start` at the time `now_us`. Settings are a dict or a file of what a simulated catheter is "
          "like; `elastic`: a rod between the walls, else one that follows the vessels.",
          "tree"_a, "start"_a, py::kw_only(), "settings"_a = py::none(), "elastic"_a = false, "now_us"_a = 0)
      .def(
          "obey",
          [](GuardedCatheter& c, const CatheterCommand& command, std::int64_t now_us, const std::string& sender) {
            c.use([&](SimulatedCatheter& s) { s.obey(command, now_us, sender); });
          },
          doc("SimulatedCatheter.obey"), "command"_a, "now_us"_a, "sender"_a = "")
      .def(
          "advance",
          [](GuardedCatheter& c, std::int64_t now_us) { c.use([&](SimulatedCatheter& s) { s.advance(now_us); }); },
          doc("SimulatedCatheter.advance"), "now_us"_a)
      .def(
          "state", [](GuardedCatheter& c) { return c.use([](SimulatedCatheter& s) { return s.state(); }); },
          doc("SimulatedCatheter.state"))
      .def(
          "truth", [](GuardedCatheter& c) { return c.use([](SimulatedCatheter& s) { return s.truth(); }); },
          doc("CatheterTruth"))
      .def_property_readonly(
          "ignored",
          [](GuardedCatheter& c) { return c.use([](SimulatedCatheter& s) { return IgnoredCommands(s.ignored()); }); },
          doc("IgnoredCommands"));
}

std::unique_ptr<GuardedXray> xrayOf(const VesselTree& tree, const CArmGeometry& carm, const Numbers& T_patient_model,
                                    const py::object& settings, const std::optional<XrayCamera>& claimed_camera) {
  const auto patient = withFields(SimulatedPatientSettings{}, settings, "settings");
  return std::make_unique<GuardedXray>(tree, patient, carm, poseOf(T_patient_model, "T_patient_model"), claimed_camera);
}

}  // namespace

void bindSimulation(py::module_& m) {
  BoundStruct<IgnoredCommands>(m, "IgnoredCommands")
      .shows("not_finite", &IgnoredCommands::not_finite)
      .shows("bad_validity", &IgnoredCommands::bad_validity)
      .shows("out_of_sequence", &IgnoredCommands::out_of_sequence)
      .shows("jumped", &IgnoredCommands::jumped)
      .shows("other_sender", &IgnoredCommands::other_sender)
      .shows("too_old", &IgnoredCommands::too_old)
      .shows("wrong_unit", &IgnoredCommands::wrong_unit);
  py::class_<SimulatedCArm>(m, "SimulatedCArm", doc("SimulatedCArm"))
      .def(py::init([](const CArmLimits& limits, const CArmJoints& start, std::int64_t now_us) {
             return std::make_unique<SimulatedCArm>(limits, start, now_us);
           }),
           doc("SimulatedCArm.SimulatedCArm"), "limits"_a, "start"_a, "now_us"_a = 0)
      .def("obey", &SimulatedCArm::obey, doc("SimulatedCArm.obey"), "command"_a, "now_us"_a, "sender"_a = "")
      .def("advance", &SimulatedCArm::advance, doc("SimulatedCArm.advance"), "now_us"_a)
      .def("state", &SimulatedCArm::state, doc("SimulatedCArm.state"))
      .def_property_readonly(
          "ignored", [](const SimulatedCArm& arm) { return arm.ignored(); }, doc("IgnoredCommands"))
      .def_property_readonly("ran_out", &SimulatedCArm::ranOut, doc("SimulatedCArm.ranOut"));
  bindCatheter(m);
  py::class_<GuardedXray>(m, "SimulatedXray", doc("SimulatedXrayNode"))
      .def(py::init(&xrayOf),
           "How the patient really lies is `T_patient_model`, 4 x 4. Settings are a dict or a file of what a simulated "
           "X-ray run can be told; frames say their true camera, or the claimed one.",
           "tree"_a, "carm"_a, "T_patient_model"_a, py::kw_only(), "settings"_a = py::none(),
           "claimed_camera"_a = py::none())
      .def(
          "render",
          [](GuardedXray& xray, std::int64_t now_us, const CArmJoints& joints) {
            return xray.use([&](auto& x) { return x.render(now_us, joints); });
          },
          doc("SimulatedXrayNode.render"), "now_us"_a, "joints"_a)
      .def(
          "show",
          [](GuardedXray& xray, std::shared_ptr<GuardedCatheter> catheter) {
            xray.use([&](auto& x) {
              x.show([catheter](const Eigen::Matrix3Xd& points) {
                return catheter->useUnlocked([&](SimulatedCatheter& c) { return c.device(points); });
              });
            });
          },
          "Shows a catheter in all frames from now on, as it is when a frame is rendered.",
          py::arg("catheter").none(false))
      .def(
          "begin_injection",
          [](GuardedXray& xray, std::int64_t now_us) { xray.use([&](auto& x) { x.beginInjection(now_us); }); },
          "Begins an injection of contrast agent, where the settings' bolus waits for one: `bolus: {enabled: true, "
          "trigger: demand}`. A time before the first frame counts as the first frame's.",
          "now_us"_a)
      .def(
          "end_injection",
          [](GuardedXray& xray, std::int64_t now_us) { xray.use([&](auto& x) { x.endInjection(now_us); }); },
          "Ends that injection.", "now_us"_a)
      .def(
          "in_camera",
          [](GuardedXray& xray, const Eigen::Vector3d& p_model, const CArmJoints& joints, std::int64_t now_us) {
            return xray.use([&](auto& x) { return x.inCamera(p_model, joints, now_us); });
          },
          doc("SimulatedXrayNode.inCamera"), "p_model"_a, "joints"_a, "now_us"_a)
      .def(
          "T_camera_model",
          [](GuardedXray& xray, const CArmJoints& joints) {
            return arrayOf(xray.use([&](auto& x) { return x.T_camera_model(joints); }));
          },
          doc("SimulatedXrayNode.T_camera_model"), "joints"_a);
}

}  // namespace angio::python
