// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/codec.hpp"

#include <angio_lcm/carm_command_t.hpp>
#include <angio_lcm/carm_state_t.hpp>
#include <angio_lcm/catheter_command_t.hpp>
#include <angio_lcm/catheter_state_t.hpp>
#include <angio_lcm/catheter_tip_t.hpp>
#include <angio_lcm/registration_t.hpp>
#include <angio_lcm/servo_input_t.hpp>
#include <angio_lcm/servo_request_t.hpp>
#include <angio_lcm/servo_status_t.hpp>
#include <angio_lcm/xray_frame_t.hpp>
#include <cstring>
#include <stdexcept>

#include "angio/base/errors.hpp"
#include "angio/imaging/png.hpp"
#include "rules.hpp"

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "16-bit pixels are copied to the wire as they lie in memory, which must be little-endian"
#endif

namespace angio {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

template <typename Wire, typename T>
void requireSound(const T& value) {
  if (const auto broken = rules::broken(value)) {
    throw std::invalid_argument(std::string(Wire::getTypeName()) + ": " + *broken);
  }
}

template <typename Wire>
std::vector<std::uint8_t> bytesOf(const Wire& wire) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(wire.getEncodedSize()));
  if (wire.encode(bytes.data(), 0, static_cast<int>(bytes.size())) != static_cast<int>(bytes.size())) {
    throw std::invalid_argument(std::string(Wire::getTypeName()) + ": cannot be encoded");
  }
  return bytes;
}

std::int32_t readInt32(const std::uint8_t* data) {
  std::int32_t value = 0;
  __int32_t_decode_array(data, 0, 4, &value, 1);
  return value;
}

// How a type's variable part, which stands last, says its length: LCM's own decoder believes a length field and
// allocates or reads by it, so the length is checked against the bytes that are there before the decoder sees them.
enum class Tail { kNone, kBytes, kText };

// The rule that the bytes break, or null.
template <typename Wire>
const char* brokenLayout(Tail tail, const std::uint8_t* data, std::size_t size) {
  const auto smallest = static_cast<std::size_t>(Wire{}.getEncodedSize());
  std::int64_t fingerprint = 0;
  if (size < 8) return "too short for a fingerprint";
  __int64_t_decode_array(data, 0, 8, &fingerprint, 1);
  if (fingerprint != Wire::getHash()) return "another type's fingerprint";
  if (size < smallest) return "truncated";
  if (size > static_cast<std::size_t>(rules::kLongestMessage)) return "too long";
  const auto extra = static_cast<std::int64_t>(size - smallest);
  switch (tail) {
    case Tail::kNone:
      return extra == 0 ? nullptr : "bytes behind its end";
    case Tail::kBytes:
      return readInt32(data + smallest - 4) == extra ? nullptr : "its size field is not the number of its bytes";
    case Tail::kText:
      // A text's length counts its closing NUL, which the smallest message has as well.
      if (readInt32(data + smallest - 5) != extra + 1) return "its text length is not the number of its bytes";
      return data[size - 1] == 0 ? nullptr : "its text does not end in NUL";
  }
  return "unknown layout";
}

// Bytes to value: layout, LCM's decoder, conversion, rules. `toValue` gives the value, or throws InputError.
template <typename T, typename Wire, typename Convert>
Decoded<T> decodeAs(Tail tail, const std::uint8_t* data, std::size_t size, Convert toValue) {
  Decoded<T> result;
  const std::string name = std::string(Wire::getTypeName()) + ": ";
  if (const char* broken = brokenLayout<Wire>(tail, data, size)) {
    result.error = name + broken;
    return result;
  }
  Wire wire{};
  if (wire.decode(data, 0, static_cast<int>(size)) != static_cast<int>(size)) {
    result.error = name + "cannot be decoded";
    return result;
  }
  try {
    result.value.emplace(toValue(wire));
  } catch (const InputError& wrong) {
    result.error = name + wrong.what();
    return result;
  }
  if (const auto broken = rules::broken(*result.value)) {
    result.value.reset();
    result.error = name + *broken;
  }
  return result;
}

// A byte of deflate gives at most 1032.
constexpr std::int64_t kMostDeflated = 1032;

std::optional<double> known(double value) { return value == 0 ? std::nullopt : std::optional<double>(value); }

std::vector<std::uint8_t> rawPixels(const cv::Mat& image) {
  std::vector<std::uint8_t> pixels;
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  pixels.reserve(row_bytes * static_cast<std::size_t>(image.rows));
  for (int y = 0; y < image.rows; ++y) {  // Row by row: an image may be a window into a larger one.
    pixels.insert(pixels.end(), image.ptr(y), image.ptr(y) + row_bytes);
  }
  return pixels;
}

cv::Mat rawImage(const angio_lcm::xray_frame_t& wire) {
  if (std::int64_t{wire.width} * wire.height * (wire.bits / 8) != wire.size) {
    throw InputError("", "size", shown(wire.size), "must be width * height * bits / 8");
  }
  cv::Mat image(wire.height, wire.width, wire.bits == 8 ? CV_8UC1 : CV_16UC1);
  std::memcpy(image.data, wire.pixels.data(), wire.pixels.size());
  return image;
}

// The image must be what the message's own fields say before memory is taken for it: a few bytes can claim a large one.
cv::Mat pngImage(const angio_lcm::xray_frame_t& wire) {
  const std::string_view content(reinterpret_cast<const char*>(wire.pixels.data()), wire.pixels.size());
  const auto header = pngHeader(content);
  const bool as_said = header && header->width_px == static_cast<std::uint32_t>(wire.width) &&
                       header->height_px == static_cast<std::uint32_t>(wire.height) && header->bits == wire.bits &&
                       header->grey;
  if (!as_said) throw InputError("", "pixels", "", "must be a grey PNG of the message's width, height and bits");
  if (std::int64_t{wire.width} * wire.height * (wire.bits / 8) > kMostDeflated * wire.size) {
    throw InputError("", "size", shown(wire.size), "is too small for the image it promises");
  }
  cv::Mat image = decodePng("pixels", content);
  if (image.type() != (wire.bits == 8 ? CV_8UC1 : CV_16UC1)) throw InputError("", "pixels", "", "must be grey");
  return image;
}

XrayFrame frameOf(const angio_lcm::xray_frame_t& wire) {
  if (wire.bits != 8 && wire.bits != 16) throw InputError("", "bits", shown(wire.bits), "must be 8 or 16");
  XrayCamera::Parameters p;
  p.width_px = wire.width;
  p.height_px = wire.height;
  p.fx_px = wire.fx;
  p.fy_px = wire.fy;
  p.cx_px = wire.cx;
  p.cy_px = wire.cy;
  p.pixel_spacing_m = known(wire.pixel_spacing);
  p.source_detector_distance_m = known(wire.source_detector_distance);
  const XrayCamera camera(p);  // Refuses sizes that are not positive, before they are multiplied.
  switch (wire.encoding) {
    case angio_lcm::xray_frame_t::RAW:
      return {wire.utime, wire.sequence, rawImage(wire), camera};
    case angio_lcm::xray_frame_t::PNG:
      return {wire.utime, wire.sequence, pngImage(wire), camera};
  }
  throw InputError("", "encoding", shown(wire.encoding), "must be RAW (0) or PNG (1)");
}

}  // namespace

std::vector<std::uint8_t> encode(const XrayFrame& frame, ImageEncoding encoding) {
  requireSound<angio_lcm::xray_frame_t>(frame);
  const auto& p = frame.camera.parameters();
  angio_lcm::xray_frame_t wire{};
  wire.utime = frame.time_us;
  wire.sequence = frame.sequence;
  wire.width = p.width_px;
  wire.height = p.height_px;
  wire.bits = frame.image.depth() == CV_8U ? 8 : 16;
  wire.fx = p.fx_px;
  wire.fy = p.fy_px;
  wire.cx = p.cx_px;
  wire.cy = p.cy_px;
  wire.pixel_spacing = p.pixel_spacing_m.value_or(0);
  wire.source_detector_distance = p.source_detector_distance_m.value_or(0);
  wire.encoding = static_cast<std::int8_t>(encoding);
  wire.pixels = encoding == ImageEncoding::kPng ? encodePng(frame.image) : rawPixels(frame.image);
  wire.size = static_cast<std::int32_t>(wire.pixels.size());
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const CArmState& state) {
  requireSound<angio_lcm::carm_state_t>(state);
  angio_lcm::carm_state_t wire{};
  wire.utime = state.time_us;
  wire.sequence = state.sequence;
  CArmJoints::Map(wire.joint_position) = state.joints;
  CArmJoints::Map(wire.joint_velocity) = state.velocity;
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const ServoInput& input) {
  requireSound<angio_lcm::servo_input_t>(input);
  angio_lcm::servo_input_t wire{};
  wire.utime = input.time_us;
  wire.frame_sequence = input.frame_sequence;
  wire.state_utime = input.state.time_us;
  wire.state_sequence = input.state.sequence;
  CArmJoints::Map(wire.joint_position) = input.state.joints;
  CArmJoints::Map(wire.joint_velocity) = input.state.velocity;
  wire.verdict = static_cast<std::int8_t>(input.verdict);
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const CArmCommand& command) {
  requireSound<angio_lcm::carm_command_t>(command);
  angio_lcm::carm_command_t wire{};
  wire.utime = command.time_us;
  wire.sequence = command.sequence;
  wire.frame_sequence = command.frame_sequence;
  wire.valid_for_us = command.valid_for_us;
  CArmJoints::Map(wire.joint_velocity) = command.velocity;
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const RegistrationMessage& registration) {
  requireSound<angio_lcm::registration_t>(registration);
  angio_lcm::registration_t wire{};
  wire.utime = registration.time_us;
  wire.frame_sequence = registration.frame_sequence;
  wire.status = registration.status;
  RowMajor3::Map(wire.rotation) = registration.T_camera_model.linear();
  Eigen::Vector3d::Map(wire.translation) = registration.T_camera_model.translation();
  RowMajor6::Map(wire.covariance) = registration.covariance;
  wire.mean_residual = registration.mean_residual_px;
  wire.points_3d = registration.points_3d;
  wire.points_2d = registration.points_2d;
  wire.status_text = registration.status_text;
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const ServoStatus& status) {
  requireSound<angio_lcm::servo_status_t>(status);
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
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const ServoRequest& request) {
  requireSound<angio_lcm::servo_request_t>(request);
  angio_lcm::servo_request_t wire{};
  wire.utime = request.time_us;
  wire.sequence = request.sequence;
  wire.status_utime = request.status_time_us;
  wire.transitions = request.transitions;
  wire.request = static_cast<std::int8_t>(request.request);
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const CatheterState& state) {
  requireSound<angio_lcm::catheter_state_t>(state);
  angio_lcm::catheter_state_t wire{};
  wire.utime = state.time_us;
  wire.sequence = state.sequence;
  wire.insertion = state.insertion_m;
  wire.roll = state.roll_rad;
  wire.bend = state.bend_rad;
  wire.insertion_speed = state.insertion_speed_mps;
  wire.roll_speed = state.roll_speed_radps;
  wire.bend_speed = state.bend_speed_radps;
  wire.insertion_force = state.insertion_force_n;
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const CatheterCommand& command) {
  requireSound<angio_lcm::catheter_command_t>(command);
  angio_lcm::catheter_command_t wire{};
  wire.utime = command.time_us;
  wire.sequence = command.sequence;
  wire.frame_sequence = command.frame_sequence;
  wire.valid_for_us = command.valid_for_us;
  wire.insertion_speed = command.insertion_speed_mps;
  wire.roll_speed = command.roll_speed_radps;
  wire.bend_speed = command.bend_speed_radps;
  return bytesOf(wire);
}

std::vector<std::uint8_t> encode(const CatheterTip& tip) {
  requireSound<angio_lcm::catheter_tip_t>(tip);
  angio_lcm::catheter_tip_t wire{};
  wire.utime = tip.time_us;
  wire.frame_sequence = tip.frame_sequence;
  wire.status = static_cast<std::int8_t>(tip.status);
  Eigen::Vector3d::Map(wire.tip) = tip.tip_model;
  RowMajor3::Map(wire.covariance) = tip.covariance;
  wire.branch = tip.branch;
  wire.tree_point = tip.tree_point;
  wire.arc_length = tip.arc_length_m;
  wire.probability = tip.probability;
  wire.reason = tip.reason;
  return bytesOf(wire);
}

template <>
Decoded<XrayFrame> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<XrayFrame, angio_lcm::xray_frame_t>(Tail::kBytes, data, size, frameOf);
}

template <>
Decoded<CArmState> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<CArmState, angio_lcm::carm_state_t>(Tail::kNone, data, size, [](const auto& wire) {
    CArmState state;
    state.time_us = wire.utime;
    state.sequence = wire.sequence;
    state.joints = CArmJoints::Map(wire.joint_position);
    state.velocity = CArmJoints::Map(wire.joint_velocity);
    return state;
  });
}

template <>
Decoded<ServoInput> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<ServoInput, angio_lcm::servo_input_t>(Tail::kNone, data, size, [](const auto& wire) {
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

template <>
Decoded<CArmCommand> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<CArmCommand, angio_lcm::carm_command_t>(Tail::kNone, data, size, [](const auto& wire) {
    CArmCommand command;
    command.time_us = wire.utime;
    command.sequence = wire.sequence;
    command.frame_sequence = wire.frame_sequence;
    command.valid_for_us = wire.valid_for_us;
    command.velocity = CArmJoints::Map(wire.joint_velocity);
    return command;
  });
}

template <>
Decoded<RegistrationMessage> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<RegistrationMessage, angio_lcm::registration_t>(Tail::kText, data, size, [](const auto& wire) {
    RegistrationMessage registration;
    registration.time_us = wire.utime;
    registration.frame_sequence = wire.frame_sequence;
    registration.status = wire.status;
    registration.status_text = wire.status_text;
    registration.T_camera_model.linear() = RowMajor3::Map(wire.rotation);
    registration.T_camera_model.translation() = Eigen::Vector3d::Map(wire.translation);
    registration.covariance = RowMajor6::Map(wire.covariance);
    registration.mean_residual_px = wire.mean_residual;
    registration.points_3d = wire.points_3d;
    registration.points_2d = wire.points_2d;
    return registration;
  });
}

template <>
Decoded<ServoRequest> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<ServoRequest, angio_lcm::servo_request_t>(Tail::kNone, data, size, [](const auto& wire) {
    ServoRequest request;
    request.time_us = wire.utime;
    request.sequence = wire.sequence;
    request.status_time_us = wire.status_utime;
    request.transitions = wire.transitions;
    request.request = static_cast<ServoRequestKind>(wire.request);
    return request;
  });
}

template <>
Decoded<ServoStatus> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<ServoStatus, angio_lcm::servo_status_t>(Tail::kText, data, size, [](const auto& wire) {
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

template <>
Decoded<CatheterState> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<CatheterState, angio_lcm::catheter_state_t>(Tail::kNone, data, size, [](const auto& wire) {
    CatheterState state;
    state.time_us = wire.utime;
    state.sequence = wire.sequence;
    state.insertion_m = wire.insertion;
    state.roll_rad = wire.roll;
    state.bend_rad = wire.bend;
    state.insertion_speed_mps = wire.insertion_speed;
    state.roll_speed_radps = wire.roll_speed;
    state.bend_speed_radps = wire.bend_speed;
    state.insertion_force_n = wire.insertion_force;
    return state;
  });
}

template <>
Decoded<CatheterCommand> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<CatheterCommand, angio_lcm::catheter_command_t>(Tail::kNone, data, size, [](const auto& wire) {
    CatheterCommand command;
    command.time_us = wire.utime;
    command.sequence = wire.sequence;
    command.frame_sequence = wire.frame_sequence;
    command.valid_for_us = wire.valid_for_us;
    command.insertion_speed_mps = wire.insertion_speed;
    command.roll_speed_radps = wire.roll_speed;
    command.bend_speed_radps = wire.bend_speed;
    return command;
  });
}

template <>
Decoded<CatheterTip> decode(const std::uint8_t* data, std::size_t size) {
  return decodeAs<CatheterTip, angio_lcm::catheter_tip_t>(Tail::kText, data, size, [](const auto& wire) {
    CatheterTip tip;
    tip.time_us = wire.utime;
    tip.frame_sequence = wire.frame_sequence;
    tip.status = static_cast<CatheterTipStatus>(wire.status);
    tip.tip_model = Eigen::Vector3d::Map(wire.tip);
    tip.covariance = RowMajor3::Map(wire.covariance);
    tip.branch = wire.branch;
    tip.tree_point = wire.tree_point;
    tip.arc_length_m = wire.arc_length;
    tip.probability = wire.probability;
    tip.reason = wire.reason;
    return tip;
  });
}

}  // namespace angio
