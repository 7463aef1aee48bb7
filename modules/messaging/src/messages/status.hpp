// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/registration_t.hpp>
#include <angio_lcm/servo_status_t.hpp>

#include "angio/types/registration_message.hpp"
#include "angio/types/servo_status.hpp"
#include "description.hpp"

namespace angio::messaging::wire {

template <>
struct Description<RegistrationMessage> : PlainDescription<RegistrationMessage, angio_lcm::registration_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("frame_sequence", m.frame_sequence);
    v.number("model_id", m.model_id);
    v.number("status", m.status, kNotNegative);
    v.array("rotation", m.T_camera_model.linear(), ArrayRule::kRotation);
    v.array("translation", m.T_camera_model.translation());
    v.array("covariance", m.covariance, ArrayRule::kCovariance);
    v.number("mean_residual", m.mean_residual_px, kNotNegative);
    v.number("points_3d", m.points_3d, kNotNegative);
    v.number("points_2d", m.points_2d, kNotNegative);
    v.text("status_text", m.status_text);
  };

  static std::string line(const RegistrationMessage& m) {
    const Eigen::Vector3d t_mm = 1e3 * m.T_camera_model.translation();
    return formatted("frame %lld ", count(m.frame_sequence)) + harmless(m.status_text) +
           formatted(", residual %.2f px, model at %.1f %.1f %.1f mm, %d / %d points", m.mean_residual_px, t_mm.x(),
                     t_mm.y(), t_mm.z(), m.points_3d, m.points_2d);
  }
};

template <>
struct Description<ServoStatus> : PlainDescription<ServoStatus, angio_lcm::servo_status_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("frame_sequence", m.frame_sequence);
    v.number("transitions", m.transitions, kNotNegative);
    v.number("transition_utime", m.transition_time_us);
    v.number("state", m.state, oneOf(kServoStateCount));
    v.number("cause", m.cause, oneOf(kServoCauseCount));
    v.number("view_error", m.view_error_rad);
    v.number("target_error", m.target_error_m);
    v.number("image_us", m.image_us);
    v.number("registration_us", m.registration_us);
    v.number("control_us", m.control_us);
    v.number("view_reached_utime", m.view_reached_us);
    v.text("reason", m.reason);
  };

  static std::string line(const ServoStatus& m) {
    const std::int64_t spent_us = m.image_us / 1000 + m.registration_us / 1000 + m.control_us / 1000;
    return formatted("frame %lld %s, view %.3f deg, target %.2f mm, %lld ms", count(m.frame_sequence), nameOf(m.state),
                     radToDeg(m.view_error_rad), 1e3 * m.target_error_m, count(spent_us)) +
           (m.reason.empty() ? "" : ": " + harmless(m.reason, 240));
  }
};

}  // namespace angio::messaging::wire
