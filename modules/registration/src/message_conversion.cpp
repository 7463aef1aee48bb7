// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/message_conversion.hpp"

#include <cmath>

namespace angio::registration {

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
  if (std::isfinite(seen.alignment.model_residual_px)) message.mean_residual_px = seen.alignment.model_residual_px;
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
  result.alignment.model_residual_px = message.mean_residual_px;
  result.points_3d = message.points_3d;
  result.points_2d = message.points_2d;
  return result;
}

}  // namespace angio::registration
