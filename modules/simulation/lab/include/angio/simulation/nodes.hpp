// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/lab/namespace.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/simulation/simulated_catheter.hpp"
#include "angio/simulation/simulated_patient.hpp"

namespace angio::lab {

/// The robot's side of a bus: a simulated C-arm that hears CARM_COMMAND and says CARM_STATE. Owns no clock: its caller
/// says what time it is.
class SimulatedCArmNode {
 public:
  /// Borrows the bus, which must outlive it.
  SimulatedCArmNode(Bus& bus, const CArmLimits& limits, const CArmJoints& start, std::int64_t now_us);

  /// Obeys the commands that wait, as such that arrive now.
  void listen(std::int64_t now_us);

  /// Moves to `now_us` and publishes the state there.
  void report(std::int64_t now_us);

  /// As SimulatedCArm::takeNews().
  std::optional<std::string> takeNews() { return arm_.takeNews(); }

  const SimulatedCArm& arm() const { return arm_; }

 private:
  Bus& bus_;
  HeardMessages<CArmCommand> commands_;
  HeardMessages<ServoSession> sessions_;
  SimulatedCArm arm_;
  std::int64_t sequence_ = 0;
};

/// The X-ray's side of a bus: renders the tree from where the C-arm says it is, and publishes XRAY_FRAME with its
/// camera. How the patient really lies is its secret.
class SimulatedXrayNode {
 public:
  /// @param T_patient_model  The truth: the model frame in the patient frame. Borrows the bus.
  /// @param claimed_camera   What frames say of their camera, by some calibration; nothing: the true one.
  SimulatedXrayNode(Bus& bus, const VesselTree& tree, const SimulatedPatientSettings& settings,
                    const CArmGeometry& carm, const Pose& T_patient_model,
                    const std::optional<XrayCamera>& claimed_camera = std::nullopt);

  /// Renders and publishes one frame; the first one's time is the patient's time 0. Returns it, or nothing when no
  /// state has been heard yet.
  std::optional<XrayFrame> expose(std::int64_t now_us);

  /// The same from joints that are known without the bus.
  XrayFrame expose(std::int64_t now_us, const CArmJoints& joints);

  /// Renders without publishing.
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

  Bus& bus_;
  LatestMessage<CArmState> states_;
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

/// The catheter drive's side of a bus: hears CATHETER_COMMAND and says CATHETER_STATE. Owns no clock: its caller says
/// what time it is.
class SimulatedCatheterNode {
 public:
  /// Borrows the bus, which must outlive it. Throws InputError as SimulatedCatheter does.
  SimulatedCatheterNode(Bus& bus, const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start,
                        std::int64_t now_us);

  /// Obeys the commands that wait, as such that arrive now.
  void listen(std::int64_t now_us);

  /// Moves to `now_us` and publishes the state there.
  void report(std::int64_t now_us);

  /// As SimulatedCatheter::takeNews().
  std::optional<std::string> takeNews() { return catheter_.takeNews(); }

  const SimulatedCatheter& catheter() const { return catheter_; }

 private:
  Bus& bus_;
  HeardMessages<CatheterCommand> commands_;
  HeardMessages<ServoSession> sessions_;
  SimulatedCatheter catheter_;
  std::int64_t sequence_ = 0;
};

}  // namespace angio::lab
