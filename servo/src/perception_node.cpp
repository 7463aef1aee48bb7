// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/perception_node.hpp"

#include <cmath>

#include "angio/messaging/channels.hpp"

namespace angio {

PerceptionNode::PerceptionNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree)
    : bus_(bus),
      frames_(bus, kXrayFrameChannel),
      joints_(bus, kCArmStateChannel),
      perception_(settings.perceptionForTask(), settings.carm, settings.T_dsa_cb, tree),
      supervisor_(settings.supervisor, settings.limits, settings.target_model.value_or(tree.centroid()),
                  targetNeed(settings.task)) {}

std::optional<PerceptionReport> PerceptionNode::look() {
  if (joints_.empty()) return std::nullopt;
  const auto frame = frames_.take();
  if (!frame) return std::nullopt;
  const CArmState state = *joints_.at(frame->time_us);
  PerceptionReport report;
  report.doubted = supervisor_.objection(*frame, state);
  if (!report.doubted) {
    report.sight = perception_.look(*frame, state);
    const Sight& sight = report.sight;
    report.doubted =
        supervisor_.objection(sight.registration, perception_.calibrated_T_camera_model(state.joints),
                              sight.tracked ? std::optional(sight.predicted.T_camera_model) : std::nullopt);
    if (report.doubted) {
      perception_.doubt();
    } else {
      perception_.trust(sight, state);
    }
  }
  report.message =
      registrationMessage(report.sight.registration, report.sight.model_id, frame->time_us, frame->sequence);
  publish(bus_, kRegistrationChannel, report.message);
  perception_.learn();
  return report;
}

RegistrationMessage registrationMessage(const RegistrationResult& seen, ModelId model_id, std::int64_t frame_time_us,
                                        std::int64_t frame_sequence) {
  RegistrationMessage message;
  message.time_us = frame_time_us;
  message.frame_sequence = frame_sequence;
  message.model_id = model_id;
  message.status = static_cast<std::int8_t>(seen.status);
  message.status_text = statusName(seen.status);
  // What cannot go on the wire stays at rest: a poor image must not end the loop that reports it, and the status says
  // that the pose means nothing.
  if (seen.T_camera_model.matrix().allFinite()) message.T_camera_model = seen.T_camera_model;
  if (seen.covariance && seen.covariance->allFinite() && seen.covariance->diagonal().minCoeff() >= 0) {
    message.covariance = *seen.covariance;
  }
  if (std::isfinite(seen.agreement.model_residual_px)) message.mean_residual_px = seen.agreement.model_residual_px;
  message.points_3d = seen.points_3d;
  message.points_2d = seen.points_2d;
  return message;
}

RegistrationResult registrationResult(const RegistrationMessage& message) {
  RegistrationResult result;
  result.status = static_cast<RegistrationStatus>(message.status);
  if (result.status != RegistrationStatus::kConverged) result.reason = "as another program says";
  result.T_camera_model = message.T_camera_model;
  // Zero is what a message says that knows none.
  if (message.covariance.diagonal().minCoeff() > 0) result.covariance = message.covariance;
  result.agreement.model_residual_px = message.mean_residual_px;
  result.points_3d = message.points_3d;
  result.points_2d = message.points_2d;
  return result;
}

}  // namespace angio
