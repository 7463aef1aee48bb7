// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/lab/namespace.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/simulation/simulated_catheter.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "angio/types/channels.hpp"

namespace angio::lab {

/// A simulated machine's side of a bus: hears its commands and sessions, and says its state. Owns no clock: its caller
/// says what time it is.
template <typename Machine, typename Command>
class SimulatedMachineNode {
 public:
  /// Obeys the commands that wait, as such that arrive now.
  void listen(std::int64_t now_us) {
    // A session first: a command that is as new is one of its own, or one that it ends.
    for (const auto& [session, sender] : sessions_.take()) machine_.begin(session, now_us, sender);
    for (const auto& [command, sender] : commands_.take()) machine_.obey(command, now_us, sender);
  }

  /// Moves to `now_us` and publishes the state there.
  void report(std::int64_t now_us) {
    machine_.advance(now_us);
    auto state = machine_.state();
    state.sequence = ++sequence_;
    publish(bus_, state_channel_, state);
  }

  /// As CommandReceiver::takeNews().
  std::optional<std::string> takeNews() { return machine_.takeNews(); }

 protected:
  /// Borrows the bus, which must outlive it; `setup` is what the machine is made of.
  template <typename... Setup>
  SimulatedMachineNode(Bus& bus, const char* commands, const char* sessions, const char* states, const Setup&... setup)
      : bus_(bus), state_channel_(states), commands_(bus, commands), sessions_(bus, sessions), machine_(setup...) {}

  const Machine& machine() const { return machine_; }

 private:
  Bus& bus_;
  std::string state_channel_;
  HeardMessages<Command> commands_;
  HeardMessages<ServoSession> sessions_;
  Machine machine_;
  std::int64_t sequence_ = 0;
};

/// A simulated C-arm that hears CARM_COMMAND and says CARM_STATE.
class SimulatedCArmNode : public SimulatedMachineNode<SimulatedCArm, CArmCommand> {
 public:
  SimulatedCArmNode(Bus& bus, const CArmLimits& limits, const CArmJoints& start, std::int64_t now_us)
      : SimulatedMachineNode(bus, kCArmCommandChannel, kServoSessionChannel, kCArmStateChannel, limits, start, now_us) {
  }

  const SimulatedCArm& arm() const { return machine(); }
};

/// A simulated catheter's drive that hears CATHETER_COMMAND and says CATHETER_STATE.
class SimulatedCatheterNode : public SimulatedMachineNode<SimulatedCatheter, CatheterCommand> {
 public:
  /// Throws InputError as SimulatedCatheter does.
  SimulatedCatheterNode(Bus& bus, const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start,
                        std::int64_t now_us)
      : SimulatedMachineNode(bus, kCatheterCommandChannel, kCatheterSessionChannel, kCatheterStateChannel, tree,
                             settings, start, now_us) {}

  const SimulatedCatheter& catheter() const { return machine(); }
};

/// The X-ray of a lab: renders the tree from where the C-arm is, as a frame with its camera. How the patient really
/// lies is its secret.
class SimulatedXrayNode {
 public:
  /// @param T_patient_model  The truth: the model frame in the patient frame.
  /// @param claimed_camera   What frames say of their camera, by some calibration; nothing: the true one.
  SimulatedXrayNode(const VesselTree& tree, const SimulatedPatientSettings& settings, const CArmGeometry& carm,
                    const Pose& T_patient_model, const std::optional<XrayCamera>& claimed_camera = std::nullopt);

  /// Renders one frame; the first one's time is the patient's time 0.
  XrayFrame render(std::int64_t now_us, const CArmJoints& joints);

  /// Shows a device in all frames from now on, where the vessels stand at 3 x N points [m] (as
  /// SimulatedCatheter::device). Borrows what the function borrows.
  void show(std::function<Device(const Eigen::Matrix3Xd& points)> device) { device_ = std::move(device); }

  /// Begin and end an injection of contrast agent, as Bolus does. A time before the first frame counts as the first
  /// frame's.
  void beginInjection(std::int64_t now_us) { patient_.beginInjection(patientTime_s(now_us)); }
  void endInjection(std::int64_t now_us) { patient_.endInjection(patientTime_s(now_us)); }

  /// A frame without an image; time runs for the patient all the same.
  XrayFrame blank(std::int64_t now_us);

  /// Where a point of the model [m] really is in the camera with these joints: breathing, heartbeat and shift have
  /// moved it. The truth that a loop must not know.
  Eigen::Vector3d inCamera(const Eigen::Vector3d& p_model, const CArmJoints& joints, std::int64_t now_us) const;

  /// Pose of the model in the camera with these joints, before the patient shifts: the truth that a loop must not know.
  Pose T_camera_model(const CArmJoints& joints) const { return carm_.T_camera_patient(joints) * T_patient_model_; }

 private:
  double patientTime_s(std::int64_t now_us) const;

  SimulatedPatient patient_;
  CArmGeometry carm_;
  Pose T_patient_model_;
  XrayCamera camera_, claimed_camera_;
  std::function<Device(const Eigen::Matrix3Xd& points)> device_;
  std::optional<std::int64_t> first_us_;
  std::int64_t sequence_ = 0;
};

/// The person at the injector: injects contrast agent from when a view is asked for (VIEW_REQUEST) until some time
/// after the C-arm's loop says that it is reached (SERVO_STATUS). Owns no clock: the caller says what time it is.
class SimulatedInjector {
 public:
  /// Borrows the bus, which must outlive it.
  /// @param after_s  That the injection goes on for when the view is reached [s], >= 0.
  SimulatedInjector(Bus& bus, double after_s);

  /// Whether contrast agent is injected at `now_us`. To be called at least as often as frames are exposed.
  bool injects(std::int64_t now_us);

 private:
  LatestMessage<ViewRequest> requests_;
  LatestMessage<ServoStatus> statuses_;
  std::int64_t after_us_;
  std::int64_t request_us_ = 0;             // Of the view that is being reached, or was; 0: none.
  std::optional<std::int64_t> reached_us_;  // When it was reached, by the caller's clock.
};

}  // namespace angio::lab
