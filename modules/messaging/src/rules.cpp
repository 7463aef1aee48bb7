// SPDX-License-Identifier: GPL-2.0-or-later
#include "rules.hpp"

#include <cmath>

#include "angio/base/errors.hpp"

namespace angio::rules {
namespace {

using Broken = std::optional<std::string>;

// Far looser than rounding (1e-15) and far tighter than any error that matters (1e-6 rad is 1 um at 1 m).
constexpr double kLargestRotationDefect = 1e-6;

template <typename Vector>
Broken brokenVector(const char* name, const Vector& v) {
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    if (!std::isfinite(v[i]))
      return std::string(name) + "[" + std::to_string(i) + "] = " + shown(v[i]) + ": must be finite";
  }
  return std::nullopt;
}

Broken brokenNumber(const char* name, double value) {
  if (!std::isfinite(value)) return std::string(name) + " = " + shown(value) + ": must be finite";
  return std::nullopt;
}

template <typename Number>
Broken negative(const char* name, Number value) {
  if (value < 0) return std::string(name) + " = " + shown(static_cast<double>(value)) + ": must not be negative";
  return std::nullopt;
}

template <typename Enum>
Broken unknownNumber(const char* name, Enum value, int count) {
  const int number = static_cast<int>(value);
  if (number >= 0 && number < count) return std::nullopt;
  return std::string(name) + " = " + std::to_string(number) + ": must be in [0, " + std::to_string(count - 1) + "]";
}

Broken brokenText(const char* name, const std::string& text) {
  if (text.find('\0') != std::string::npos) return std::string(name) + ": must not contain a NUL";
  if (static_cast<std::int64_t>(text.size()) > kLongestMessage) return std::string(name) + ": is too long";
  return std::nullopt;
}

}  // namespace

Broken broken(const XrayFrame& frame) {
  const cv::Mat& image = frame.image;
  if (image.dims != 2 || (image.type() != CV_8UC1 && image.type() != CV_16UC1)) {
    return "image: must be of type CV_8UC1 or CV_16UC1";
  }
  if (image.cols != frame.camera.width_px() || image.rows != frame.camera.height_px()) {
    return "image = " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
           ": must be of its camera's size";
  }
  if (static_cast<double>(image.total()) * static_cast<double>(image.elemSize()) > kLongestMessage) {
    return "image: is too large for one message";
  }
  return std::nullopt;
}

Broken broken(const CArmState& state) {
  if (auto b = brokenVector("joint_position", state.joints)) return b;
  return brokenVector("joint_velocity", state.velocity);
}

Broken broken(const ServoInput& input) {
  if (auto b = unknownNumber("verdict", input.verdict, kServoVerdictCount)) return b;
  return broken(input.state);
}

Broken broken(const CArmCommand& command) {
  if (auto b = negative("valid_for_us", command.valid_for_us)) return b;
  return brokenVector("joint_velocity", command.velocity);
}

Broken broken(const RegistrationMessage& registration) {
  const Pose& T = registration.T_camera_model;
  if (!(rotationDefect(T.linear()) <= kLargestRotationDefect)) return "rotation: must be a rotation matrix";
  if (auto b = brokenVector("translation", T.translation())) return b;
  if (auto b = brokenVector("covariance", registration.covariance.reshaped<Eigen::RowMajor>())) return b;
  for (int i = 0; i < 6; ++i) {
    if (auto b = negative("covariance's diagonal", registration.covariance(i, i))) return b;
  }
  if (auto b = brokenNumber("mean_residual", registration.mean_residual_px)) return b;
  if (auto b = negative("mean_residual", registration.mean_residual_px)) return b;
  if (auto b = negative("status", registration.status)) return b;
  if (auto b = negative("points_3d", registration.points_3d)) return b;
  if (auto b = negative("points_2d", registration.points_2d)) return b;
  return brokenText("status_text", registration.status_text);
}

Broken broken(const ServoStatus& status) {
  if (auto b = unknownNumber("state", status.state, kServoStateCount)) return b;
  if (auto b = unknownNumber("cause", status.cause, kServoCauseCount)) return b;
  if (auto b = negative("transitions", status.transitions)) return b;
  if (auto b = brokenNumber("view_error", status.view_error_rad)) return b;
  if (auto b = brokenNumber("target_error", status.target_error_m)) return b;
  return brokenText("reason", status.reason);
}

Broken broken(const ServoRequest& request) {
  if (auto b = unknownNumber("request", request.request, kServoRequestKindCount)) return b;
  return negative("transitions", request.transitions);
}

Broken broken(const CatheterState& state) {
  for (const auto& [name, value] : {std::pair<const char*, double>{"insertion", state.insertion_m},
                                    {"roll", state.roll_rad},
                                    {"bend", state.bend_rad},
                                    {"insertion_speed", state.insertion_speed_mps},
                                    {"roll_speed", state.roll_speed_radps},
                                    {"bend_speed", state.bend_speed_radps},
                                    {"insertion_force", state.insertion_force_n}}) {
    if (auto b = brokenNumber(name, value)) return b;
  }
  return negative("bend", state.bend_rad);
}

Broken broken(const CatheterCommand& command) {
  if (auto b = negative("valid_for_us", command.valid_for_us)) return b;
  if (auto b = brokenNumber("insertion_speed", command.insertion_speed_mps)) return b;
  if (auto b = brokenNumber("roll_speed", command.roll_speed_radps)) return b;
  return brokenNumber("bend_speed", command.bend_speed_radps);
}

Broken broken(const CatheterTip& tip) {
  if (tip.status < CatheterTipStatus::kLost || tip.status > CatheterTipStatus::kLocated) {
    return "status = " + std::to_string(static_cast<int>(tip.status)) +
           ": must be lost (0), ambiguous (1) or located (2)";
  }
  if (auto b = brokenVector("tip", tip.tip_model)) return b;
  if (auto b = brokenVector("covariance", tip.covariance.reshaped<Eigen::RowMajor>())) return b;
  for (int i = 0; i < 3; ++i) {
    if (auto b = negative("covariance's diagonal", tip.covariance(i, i))) return b;
  }
  if (auto b = negative("branch", tip.branch)) return b;
  if (auto b = negative("tree_point", tip.tree_point)) return b;
  if (auto b = brokenNumber("arc_length", tip.arc_length_m)) return b;
  if (auto b = negative("arc_length", tip.arc_length_m)) return b;
  if (!(tip.probability >= 0 && tip.probability <= 1)) {
    return "probability = " + shown(tip.probability) + ": must be within 0 and 1";
  }
  return brokenText("reason", tip.reason);
}

Broken broken(const CatheterInput& input) {
  if (auto b = unknownNumber("verdict", input.verdict, kServoVerdictCount)) return b;
  if (auto b = broken(input.arm)) return b;
  return broken(input.drive);
}

}  // namespace angio::rules
