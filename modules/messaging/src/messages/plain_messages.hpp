// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/carm_command_t.hpp>
#include <angio_lcm/carm_state_t.hpp>
#include <angio_lcm/catheter_command_t.hpp>
#include <angio_lcm/catheter_input_t.hpp>
#include <angio_lcm/catheter_state_t.hpp>
#include <angio_lcm/catheter_tip_t.hpp>
#include <angio_lcm/registration_points_t.hpp>
#include <angio_lcm/registration_t.hpp>
#include <angio_lcm/servo_input_t.hpp>
#include <angio_lcm/servo_request_t.hpp>
#include <angio_lcm/servo_session_t.hpp>
#include <angio_lcm/servo_status_t.hpp>
#include <angio_lcm/view_request_t.hpp>

#include "angio/types/any_message.hpp"
#include "description.hpp"

namespace angio::messaging::wire {

template <>
struct Description<ServoRequest> : PlainDescription<ServoRequest, angio_lcm::servo_request_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.number("status_utime", m.status_time_us);
    v.number("transitions", m.transitions, kNotNegative);
    v.number("request", m.request, oneOf(kServoRequestKindCount));
  };

  static std::string line(const ServoRequest& m) {
    static constexpr const char* kNames[kServoRequestKindCount] = {"stop", "arm", "start", "reset", "emergency stop"};
    return kNames[static_cast<int>(m.request)];
  }
};

template <>
struct Description<ServoSession> : PlainDescription<ServoSession, angio_lcm::servo_session_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.number("session", m.session);
    v.number("command_sequence", m.command_sequence, kNotNegative);
  };

  static std::string line(const ServoSession& m) {
    return formatted("session %lld, after command %lld", count(m.session), count(m.command_sequence));
  }
};

template <>
struct Description<ViewRequest> : PlainDescription<ViewRequest, angio_lcm::view_request_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("sequence", m.sequence);
    v.number("model_id", m.model_id);
    v.array("beam", m.beam_model);
    v.array("target", m.target_model);
    v.number("within_angle", m.within_rad, kNotNegative);
    v.number("within_distance", m.within_m, kNotNegative);
    v.text("reason", m.reason);
  };

  static std::string line(const ViewRequest& m) {
    return formatted("view %lld along %.2f %.2f %.2f, target %.1f %.1f %.1f mm", count(m.sequence), m.beam_model.x(),
                     m.beam_model.y(), m.beam_model.z(), 1e3 * m.target_model.x(), 1e3 * m.target_model.y(),
                     1e3 * m.target_model.z()) +
           (m.reason.empty() ? "" : ": " + harmless(m.reason));
  }
};

template <>
struct Description<CArmState> : PlainDescription<CArmState, angio_lcm::carm_state_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("sequence", m.sequence);
    v.array("joint_position", m.joints);
    v.array("joint_velocity", m.velocity);
  };

  static std::string line(const CArmState& m) { return jointsText(m.joints); }
};

template <>
struct Description<CArmCommand> : PlainDescription<CArmCommand, angio_lcm::carm_command_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.number("frame_sequence", m.frame_sequence);
    v.number("valid_for_us", m.valid_for_us, kNotNegative);
    v.array("joint_velocity", m.velocity);
  };

  static std::string line(const CArmCommand& m) {
    return answerText(m.frame_sequence, m.valid_for_us) + jointsText(m.velocity, "/s");
  }
};

template <>
struct Description<CatheterState> : PlainDescription<CatheterState, angio_lcm::catheter_state_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("sequence", m.sequence);
    v.number("insertion", m.insertion_m);
    v.number("roll", m.roll_rad);
    v.number("bend", m.bend_rad, kNotNegative);
    v.number("insertion_speed", m.insertion_speed_m_per_s);
    v.number("roll_speed", m.roll_speed_rad_per_s);
    v.number("bend_speed", m.bend_speed_rad_per_s);
    v.number("insertion_force", m.insertion_force_n);
  };

  static std::string line(const CatheterState& m) {
    return formatted("in %.1f mm, roll %.1f deg, bend %.1f deg, force %.2f N", 1e3 * m.insertion_m,
                     radToDeg(m.roll_rad), radToDeg(m.bend_rad), m.insertion_force_n);
  }
};

template <>
struct Description<CatheterCommand> : PlainDescription<CatheterCommand, angio_lcm::catheter_command_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.number("frame_sequence", m.frame_sequence);
    v.number("valid_for_us", m.valid_for_us, kNotNegative);
    v.number("insertion_speed", m.insertion_speed_m_per_s);
    v.number("roll_speed", m.roll_speed_rad_per_s);
    v.number("bend_speed", m.bend_speed_rad_per_s);
  };

  static std::string line(const CatheterCommand& m) {
    return answerText(m.frame_sequence, m.valid_for_us) +
           formatted("%+.1f mm/s, roll %+.1f deg/s, bend %+.1f deg/s", 1e3 * m.insertion_speed_m_per_s,
                     radToDeg(m.roll_speed_rad_per_s), radToDeg(m.bend_speed_rad_per_s));
  }
};

template <>
struct Description<CatheterTip> : PlainDescription<CatheterTip, angio_lcm::catheter_tip_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("frame_sequence", m.frame_sequence);
    v.number("model_id", m.model_id);
    v.number("status", m.status, oneOf(kCatheterTipStatusCount));
    v.array("tip", m.tip_model);
    v.array("covariance", m.covariance, ArrayRule::kCovariance);
    v.number("branch", m.branch, kNotNegative);
    v.number("tree_point", m.tree_point, kNotNegative);
    v.number("arc_length", m.arc_length_m, kNotNegative);
    v.number("probability", m.probability, kProbability);
    v.text("reason", m.reason);
  };

  static std::string line(const CatheterTip& m) {
    if (m.status == CatheterTipStatus::kLost) {
      return formatted("frame %lld lost: ", count(m.frame_sequence)) + harmless(m.reason);
    }
    return formatted("frame %lld %s, branch %d at %.1f mm (%.0f %%), tip %.1f %.1f %.1f mm", count(m.frame_sequence),
                     m.status == CatheterTipStatus::kLocated ? "located" : "ambiguous", m.branch, 1e3 * m.arc_length_m,
                     100 * m.probability, 1e3 * m.tip_model.x(), 1e3 * m.tip_model.y(), 1e3 * m.tip_model.z());
  }
};

template <>
struct Description<ServoInput> : PlainDescription<ServoInput, angio_lcm::servo_input_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("frame_sequence", m.frame_sequence);
    v.number("state_utime", m.state.time_us, kUtime);
    v.number("state_sequence", m.state.sequence);
    v.array("joint_position", m.state.joints);
    v.array("joint_velocity", m.state.velocity);
    v.number("verdict", m.verdict, oneOf(kServoVerdictCount));
    v.message("view", m.view);
  };

  static std::string line(const ServoInput& m) {
    return verdictText(m.frame_sequence, m.verdict) + jointsText(m.state.joints);
  }
};

template <>
struct Description<CatheterInput> : PlainDescription<CatheterInput, angio_lcm::catheter_input_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("frame_sequence", m.frame_sequence);
    v.number("verdict", m.verdict, oneOf(kServoVerdictCount));
    v.message("arm", m.arm);
    v.message("drive", m.drive);
    v.number("view_reached_utime", m.view_reached_us);
  };

  static std::string line(const CatheterInput& m) {
    return verdictText(m.frame_sequence, m.verdict) + jointsText(m.arm.joints) + ", " +
           Description<CatheterState>::line(m.drive);
  }
};

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
struct Description<RegistrationPoints> : PlainDescription<RegistrationPoints, angio_lcm::registration_points_t> {
  // Which of xx, xy, xz, yy, yz, zz are variances.
  static constexpr std::array<bool, 6> kVariances = {true, false, false, true, false, true};

  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("frame_sequence", m.frame_sequence);
    v.number("model_id", m.model_id);
    v.columns("points", "covariance", m.covariance, kVariances);
  };

  /// The worst of the points' standard deviations, along the camera's axes.
  static std::string line(const RegistrationPoints& m) {
    const auto worst_mm = [&](Eigen::Index row) {
      return m.covariance.cols() > 0 ? 1e3 * std::sqrt(m.covariance.row(row).maxCoeff()) : 0.0;
    };
    return formatted("frame %lld, %lld points, %.2f x %.2f mm across, %.2f mm in depth at most",
                     count(m.frame_sequence), count(m.covariance.cols()), worst_mm(0), worst_mm(3), worst_mm(5));
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
