// SPDX-License-Identifier: GPL-2.0-or-later
// What perception and the loop say, and what an operator asks of it.
#include <angio_lcm/catheter_tip_t.hpp>
#include <angio_lcm/registration_t.hpp>
#include <angio_lcm/servo_input_t.hpp>
#include <angio_lcm/servo_request_t.hpp>
#include <angio_lcm/servo_status_t.hpp>

#include "codec_parts.hpp"

namespace angio {

std::vector<std::uint8_t> encode(const ServoInput& input) {
  codec::requireSound<angio_lcm::servo_input_t>(input);
  angio_lcm::servo_input_t wire{};
  wire.utime = input.time_us;
  wire.frame_sequence = input.frame_sequence;
  wire.state_utime = input.state.time_us;
  wire.state_sequence = input.state.sequence;
  CArmJoints::Map(wire.joint_position) = input.state.joints;
  CArmJoints::Map(wire.joint_velocity) = input.state.velocity;
  wire.verdict = static_cast<std::int8_t>(input.verdict);
  return codec::bytesOf(wire);
}

template <>
Decoded<ServoInput> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<ServoInput, angio_lcm::servo_input_t>(codec::Tail::kNone, data, size, [](const auto& wire) {
    ServoInput input;
    input.time_us = wire.utime;
    input.frame_sequence = wire.frame_sequence;
    input.state.time_us = wire.state_utime;
    input.state.sequence = wire.state_sequence;
    input.state.joints = CArmJoints::Map(wire.joint_position);
    input.state.velocity = CArmJoints::Map(wire.joint_velocity);
    input.verdict = static_cast<ServoVerdict>(wire.verdict);
    return input;
  });
}

std::vector<std::uint8_t> encode(const RegistrationMessage& registration) {
  codec::requireSound<angio_lcm::registration_t>(registration);
  angio_lcm::registration_t wire{};
  wire.utime = registration.time_us;
  wire.frame_sequence = registration.frame_sequence;
  wire.model_id = static_cast<std::int64_t>(registration.model_id);
  wire.status = registration.status;
  codec::RowMajor3::Map(wire.rotation) = registration.T_camera_model.linear();
  Eigen::Vector3d::Map(wire.translation) = registration.T_camera_model.translation();
  codec::RowMajor6::Map(wire.covariance) = registration.covariance;
  wire.mean_residual = registration.mean_residual_px;
  wire.points_3d = registration.points_3d;
  wire.points_2d = registration.points_2d;
  wire.status_text = registration.status_text;
  return codec::bytesOf(wire);
}

template <>
Decoded<RegistrationMessage> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<RegistrationMessage, angio_lcm::registration_t>(
      codec::Tail::kText, data, size, [](const auto& wire) {
        RegistrationMessage registration;
        registration.time_us = wire.utime;
        registration.frame_sequence = wire.frame_sequence;
        registration.model_id = static_cast<ModelId>(wire.model_id);
        registration.status = wire.status;
        registration.status_text = wire.status_text;
        registration.T_camera_model.linear() = codec::RowMajor3::Map(wire.rotation);
        registration.T_camera_model.translation() = Eigen::Vector3d::Map(wire.translation);
        registration.covariance = codec::RowMajor6::Map(wire.covariance);
        registration.mean_residual_px = wire.mean_residual;
        registration.points_3d = wire.points_3d;
        registration.points_2d = wire.points_2d;
        return registration;
      });
}

std::vector<std::uint8_t> encode(const ServoStatus& status) {
  codec::requireSound<angio_lcm::servo_status_t>(status);
  angio_lcm::servo_status_t wire{};
  wire.utime = status.time_us;
  wire.frame_sequence = status.frame_sequence;
  wire.state = static_cast<std::int8_t>(status.state);
  wire.view_error = status.view_error_rad;
  wire.target_error = status.target_error_m;
  wire.image_us = status.image_us;
  wire.registration_us = status.registration_us;
  wire.control_us = status.control_us;
  wire.reason = status.reason;
  wire.transitions = status.transitions;
  wire.transition_utime = status.transition_time_us;
  wire.cause = static_cast<std::int8_t>(status.cause);
  return codec::bytesOf(wire);
}

template <>
Decoded<ServoStatus> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<ServoStatus, angio_lcm::servo_status_t>(codec::Tail::kText, data, size, [](const auto& wire) {
    ServoStatus status;
    status.time_us = wire.utime;
    status.frame_sequence = wire.frame_sequence;
    status.state = static_cast<ServoState>(wire.state);
    status.reason = wire.reason;
    status.transitions = wire.transitions;
    status.transition_time_us = wire.transition_utime;
    status.cause = static_cast<ServoCause>(wire.cause);
    status.view_error_rad = wire.view_error;
    status.target_error_m = wire.target_error;
    status.image_us = wire.image_us;
    status.registration_us = wire.registration_us;
    status.control_us = wire.control_us;
    return status;
  });
}

std::vector<std::uint8_t> encode(const ServoRequest& request) {
  codec::requireSound<angio_lcm::servo_request_t>(request);
  angio_lcm::servo_request_t wire{};
  wire.utime = request.time_us;
  wire.sequence = request.sequence;
  wire.status_utime = request.status_time_us;
  wire.transitions = request.transitions;
  wire.request = static_cast<std::int8_t>(request.request);
  return codec::bytesOf(wire);
}

template <>
Decoded<ServoRequest> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<ServoRequest, angio_lcm::servo_request_t>(
      codec::Tail::kNone, data, size, [](const auto& wire) {
        ServoRequest request;
        request.time_us = wire.utime;
        request.sequence = wire.sequence;
        request.status_time_us = wire.status_utime;
        request.transitions = wire.transitions;
        request.request = static_cast<ServoRequestKind>(wire.request);
        return request;
      });
}

std::vector<std::uint8_t> encode(const CatheterTip& tip) {
  codec::requireSound<angio_lcm::catheter_tip_t>(tip);
  angio_lcm::catheter_tip_t wire{};
  wire.utime = tip.time_us;
  wire.frame_sequence = tip.frame_sequence;
  wire.model_id = static_cast<std::int64_t>(tip.model_id);
  wire.status = static_cast<std::int8_t>(tip.status);
  Eigen::Vector3d::Map(wire.tip) = tip.tip_model;
  codec::RowMajor3::Map(wire.covariance) = tip.covariance;
  wire.branch = tip.branch;
  wire.tree_point = tip.tree_point;
  wire.arc_length = tip.arc_length_m;
  wire.probability = tip.probability;
  wire.reason = tip.reason;
  return codec::bytesOf(wire);
}

template <>
Decoded<CatheterTip> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<CatheterTip, angio_lcm::catheter_tip_t>(codec::Tail::kText, data, size, [](const auto& wire) {
    CatheterTip tip;
    tip.time_us = wire.utime;
    tip.frame_sequence = wire.frame_sequence;
    tip.model_id = static_cast<ModelId>(wire.model_id);
    tip.status = static_cast<CatheterTipStatus>(wire.status);
    tip.tip_model = Eigen::Vector3d::Map(wire.tip);
    tip.covariance = codec::RowMajor3::Map(wire.covariance);
    tip.branch = wire.branch;
    tip.tree_point = wire.tree_point;
    tip.arc_length_m = wire.arc_length;
    tip.probability = wire.probability;
    tip.reason = wire.reason;
    return tip;
  });
}

}  // namespace angio
