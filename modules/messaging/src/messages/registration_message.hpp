// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/registration_t.hpp>

#include "angio/types/registration_message.hpp"
#include "description.hpp"
#include "message_text.hpp"

namespace angio::messaging::wire {

template <>
struct Description<RegistrationMessage> : PlainDescription<RegistrationMessage, angio_lcm::registration_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
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

}  // namespace angio::messaging::wire
