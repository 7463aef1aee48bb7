// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/formatted.hpp"
#include "angio/messaging/any_message.hpp"

namespace angio {
namespace {

constexpr std::size_t kLongestText = 60;

// Text from the bus may hold anything, also what would move a terminal's cursor.
std::string harmless(const std::string& text) {
  std::string shown = text.substr(0, kLongestText);
  for (char& c : shown) {
    if (c < 0x20 || c >= 0x7f) c = '?';
  }
  return text.size() > kLongestText ? shown + "..." : shown;
}

long long count(std::int64_t number) { return static_cast<long long>(number); }

std::string joints(const CArmJoints& q, const char* per_s) {
  return formatted("%+.2f %+.2f deg%s, table %+.1f %+.1f %+.1f mm%s", radToDeg(q[0]), radToDeg(q[1]), per_s, 1e3 * q[2],
                   1e3 * q[3], 1e3 * q[4], per_s);
}

std::string line(const XrayFrame& m) {
  const auto& p = m.camera.parameters();
  return formatted("%d x %d, %d bit, f %.0f px, centre %.1f %.1f px", p.width_px, p.height_px,
                   static_cast<int>(8 * m.image.elemSize()), p.fx_px, p.cx_px, p.cy_px);
}

std::string line(const CArmState& m) { return joints(m.joints, ""); }

template <typename Input>
std::string judged(const Input& m) {
  constexpr const char* kVerdicts[kServoVerdictCount] = {"", ", taken back", ", refused"};
  return formatted("frame %lld%s with ", count(m.frame_sequence), kVerdicts[static_cast<int>(m.verdict)]);
}

std::string line(const ServoInput& m) { return judged(m) + joints(m.state.joints, ""); }

std::string line(const CArmCommand& m) {
  return formatted("frame %lld, for %.0f ms: ", count(m.frame_sequence), 1e-3 * static_cast<double>(m.valid_for_us)) +
         joints(m.velocity, "/s");
}

std::string line(const RegistrationMessage& m) {
  const Eigen::Vector3d t_mm = 1e3 * m.T_camera_model.translation();
  return formatted("frame %lld ", count(m.frame_sequence)) + harmless(m.status_text) +
         formatted(", residual %.2f px, model at %.1f %.1f %.1f mm, %d / %d points", m.mean_residual_px, t_mm.x(),
                   t_mm.y(), t_mm.z(), m.points_3d, m.points_2d);
}

std::string line(const ServoStatus& m) {
  const std::int64_t spent_us = m.image_us / 1000 + m.registration_us / 1000 + m.control_us / 1000;
  return formatted("frame %lld %s, view %.3f deg, target %.2f mm, %lld ms", count(m.frame_sequence), nameOf(m.state),
                   radToDeg(m.view_error_rad), 1e3 * m.target_error_m, count(spent_us)) +
         (m.reason.empty() ? "" : ": " + harmless(m.reason));
}

std::string line(const ServoRequest& m) {
  static constexpr const char* kNames[kServoRequestKindCount] = {"stop", "arm", "start", "reset", "emergency stop"};
  return kNames[static_cast<int>(m.request)];
}

std::string line(const CatheterState& m) {
  return formatted("in %.1f mm, roll %.1f deg, bend %.1f deg, force %.2f N", 1e3 * m.insertion_m, radToDeg(m.roll_rad),
                   radToDeg(m.bend_rad), m.insertion_force_n);
}

std::string line(const CatheterCommand& m) {
  return formatted("frame %lld, for %.0f ms: %+.1f mm/s, roll %+.1f deg/s, bend %+.1f deg/s", count(m.frame_sequence),
                   1e-3 * static_cast<double>(m.valid_for_us), 1e3 * m.insertion_speed_mps,
                   radToDeg(m.roll_speed_radps), radToDeg(m.bend_speed_radps));
}

std::string line(const CatheterTip& m) {
  if (m.status == CatheterTipStatus::kLost) {
    return formatted("frame %lld lost: ", count(m.frame_sequence)) + harmless(m.reason);
  }
  return formatted("frame %lld %s, branch %d at %.1f mm (%.0f %%), tip %.1f %.1f %.1f mm", count(m.frame_sequence),
                   m.status == CatheterTipStatus::kLocated ? "located" : "ambiguous", m.branch, 1e3 * m.arc_length_m,
                   100 * m.probability, 1e3 * m.tip_model.x(), 1e3 * m.tip_model.y(), 1e3 * m.tip_model.z());
}

std::string line(const CatheterInput& m) { return judged(m) + joints(m.arm.joints, "") + ", " + line(m.drive); }

}  // namespace

std::string describe(const AnyMessage& message) {
  return std::visit([](const auto& m) { return line(m); }, message);
}

}  // namespace angio
