// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "angio/perception/gated_perception.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/perception/point_of_interest.hpp"
#include "angio/servo/desired_view.hpp"
#include "angio/types/any_message.hpp"
#include "angio/types/view_request.hpp"

namespace angio::servo {

/// What one trusted frame says, as a task is told it.
struct TaskInput {
  std::int64_t time_us = 0;  ///< Of the exposure, sender's monotonic clock.
  XrayCamera camera;
  Pose T_camera_model = Pose::Identity();          ///< This frame's own registration.
  Matrix6d covariance = Matrix6d::Zero();          ///< Of it, [translation; rotation], m and rad.
  Pose T_camera_model_tracked = Pose::Identity();  ///< Averaged over trusted frames: the patient as a slow one.
  CArmState state;                                 ///< Joints at the exposure.
  CArmJoints last_velocity = CArmJoints::Zero();   ///< Of the last command [rad/s, m/s].
  double period_s = 0;                             ///< Since the frame before.
  double latency_s = 0;                            ///< From an exposure until its command moves the machine.

  /// Where the target is in this frame, model frame [m], when it moves within the model, as a catheter's tip does;
  /// nothing: the task's own target.
  std::optional<Eigen::Vector3d> target_model = std::nullopt;
  Eigen::Matrix3d target_covariance = Eigen::Matrix3d::Zero();  ///< Of it, model axes [m^2].

  /// This frame's own registration, and where the frames of a turn have the tree, where they have told it.
  PatientObservation patient() const { return {T_camera_model, covariance, places ? points : nullptr, places}; }

  /// The averaged pose, moved so that a point of the model is where patient() has it along the beam, and where it was
  /// in the average across it. Without `places` the pose as it is.
  Pose trackedPoseAt(const Eigen::Vector3d& p_model) const;

  /// What the frame shows of the place that the task watches; nothing: only what the registration says.
  std::optional<PointObservation> place = std::nullopt;

  /// What the frame's registration knows of single points; null: the covariance says all.
  std::shared_ptr<const PointUncertainty> points = nullptr;
  /// Where points of the model are by the frames of a turn; null: the pose says all.
  std::shared_ptr<const PointPlaces> places = nullptr;
  /// Where the target was by the frames of a turn, for a task that resolves its depth; null: not known yet. Borrowed.
  const ResolvedDepth* depth = nullptr;
};

/// What a task wants. The default stands still.
struct TaskAnswer {
  std::optional<CArmJoints> velocity;          ///< Before any limit [rad/s, m/s]; nothing: hold.
  std::optional<std::string> hold_reason;      ///< Why it holds; nothing while it has a velocity.
  std::optional<ViewError> view_error;         ///< From the desired view, where the task has one.
  std::optional<Eigen::Vector2d> pixel_error;  ///< From the target's desired pixel, where the task has one ...
  std::optional<double> target_off_m;          ///< ... and the same across the beam, at the target's own depth [m].
  bool reached = false;                        ///< The task's end is reached; it goes on keeping it.
  std::optional<std::string> remark;           ///< What a person should know of the frame while the task goes on.
};

/// How far the C-arm is with a view that was asked for.
struct ViewProgress {
  std::int64_t request_us = 0;  ///< ViewRequest::time_us; 0: none is obeyed.
  bool reached = false;
};

/// What the C-arm is to do with what is seen: `view`, `centre`, `hold`. Knows neither clock nor bus; the same inputs
/// give the same answers.
class Task {
 public:
  virtual ~Task() = default;

  /// What it wants to have seen for itself; asked once, before the first frame.
  virtual std::optional<PointOfInterest> place() const { return std::nullopt; }

  /// Whether its target is a catheter's tip: then every input has to say where that is.
  virtual bool followsTip() const { return false; }

  /// Takes the view that is asked for by the time of a frame. Returns why there is nothing to do, so that the frame
  /// need not be observed; nothing when there is.
  virtual std::optional<std::string> waits(const ViewRequest&) { return std::nullopt; }

  /// Of the last request.
  virtual ViewProgress progress() const { return {}; }

  /// Answers one trusted frame.
  virtual TaskAnswer answer(const TaskInput& input) = 0;

  /// A frame could not be trusted: what was derived from consecutive frames must not be carried over it.
  virtual void interrupt() = 0;

  /// Learns from the frames it has answered, where it has something to learn: what need not be done before an answer.
  virtual void learn() {}

  /// The desired pose of the model in the camera, where the task has one.
  virtual std::optional<Pose> desired_T_camera_model() const = 0;
};

}  // namespace angio::servo
