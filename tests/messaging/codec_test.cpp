// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/codec.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>

#include "angio/base/errors.hpp"
#include "angio/imaging/xray_frame.hpp"
#include "random_messages.hpp"

namespace angio {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

using Bytes = std::vector<std::uint8_t>;

// Sound by our own account, not by the codec's rules.
void expectSound(const CArmState& m) { EXPECT_TRUE(m.joints.allFinite() && m.velocity.allFinite()); }
void expectSound(const ServoInput& m) { expectSound(m.state); }
void expectSound(const CArmCommand& m) {
  EXPECT_TRUE(m.velocity.allFinite());
  EXPECT_GE(m.valid_for_us, 0);
}
void expectSound(const RegistrationMessage& m) {
  EXPECT_TRUE(m.T_camera_model.matrix().allFinite() && m.covariance.allFinite() && std::isfinite(m.mean_residual_px));
  // Entries within 1e-6 of orthonormal, as the codec promises; doubled for the cost of asking in another norm.
  EXPECT_LT((m.T_camera_model.linear() * m.T_camera_model.linear().transpose()).trace() - 3, 6e-6);
  EXPECT_GT(m.T_camera_model.linear().determinant(), 0.99);
}
void expectSound(const ServoStatus& m) {
  EXPECT_TRUE(std::isfinite(m.view_error_rad) && std::isfinite(m.target_error_m));
  EXPECT_TRUE(static_cast<int>(m.state) >= 0 && static_cast<int>(m.state) <= 5);
  EXPECT_TRUE(static_cast<int>(m.cause) >= 0 && static_cast<int>(m.cause) <= 15);
  EXPECT_GE(m.transitions, 0);
}
void expectSound(const ServoRequest& m) {
  EXPECT_TRUE(static_cast<int>(m.request) >= 0 && static_cast<int>(m.request) <= 4);
  EXPECT_GE(m.transitions, 0);
}
void expectSound(const CatheterState& m) {
  EXPECT_TRUE(std::isfinite(m.insertion_m) && std::isfinite(m.roll_rad) && std::isfinite(m.bend_rad));
  EXPECT_TRUE(std::isfinite(m.insertion_speed_mps) && std::isfinite(m.roll_speed_radps));
  EXPECT_TRUE(std::isfinite(m.bend_speed_radps) && std::isfinite(m.insertion_force_n));
  EXPECT_GE(m.bend_rad, 0);
}
void expectSound(const CatheterCommand& m) {
  EXPECT_TRUE(std::isfinite(m.insertion_speed_mps) && std::isfinite(m.roll_speed_radps));
  EXPECT_TRUE(std::isfinite(m.bend_speed_radps));
  EXPECT_GE(m.valid_for_us, 0);
}
void expectSound(const CatheterTip& m) {
  EXPECT_TRUE(m.tip_model.allFinite() && m.covariance.allFinite() && std::isfinite(m.arc_length_m));
  EXPECT_TRUE(m.probability >= 0 && m.probability <= 1 && m.branch >= 0 && m.tree_point >= 0 && m.arc_length_m >= 0);
  EXPECT_TRUE(m.status == CatheterTipStatus::kLost || m.status == CatheterTipStatus::kAmbiguous ||
              m.status == CatheterTipStatus::kLocated);
}
void expectSound(const CatheterInput& m) {
  expectSound(m.arm);
  expectSound(m.drive);
  EXPECT_TRUE(static_cast<int>(m.verdict) >= 0 && static_cast<int>(m.verdict) <= 2);
}
void expectSound(const XrayFrame& m) {
  const auto& p = m.camera.parameters();
  EXPECT_TRUE(p.fx_px > 0 && p.fy_px > 0 && std::isfinite(p.fx_px + p.fy_px + p.cx_px + p.cy_px));
  EXPECT_EQ(m.image.size(), cv::Size(p.width_px, p.height_px));
}

void expectEqual(const CArmState& a, const CArmState& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.joints, b.joints);
  EXPECT_EQ(a.velocity, b.velocity);
}
void expectEqual(const ServoInput& a, const ServoInput& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.frame_sequence, b.frame_sequence);
  expectEqual(a.state, b.state);
  EXPECT_EQ(a.verdict, b.verdict);
}
void expectEqual(const CArmCommand& a, const CArmCommand& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.frame_sequence, b.frame_sequence);
  EXPECT_EQ(a.valid_for_us, b.valid_for_us);
  EXPECT_EQ(a.velocity, b.velocity);
}
void expectEqual(const RegistrationMessage& a, const RegistrationMessage& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.frame_sequence, b.frame_sequence);
  EXPECT_EQ(a.model_id, b.model_id);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.status_text, b.status_text);
  EXPECT_EQ(a.T_camera_model.matrix(), b.T_camera_model.matrix());
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.mean_residual_px, b.mean_residual_px);
  EXPECT_EQ(a.points_3d, b.points_3d);
  EXPECT_EQ(a.points_2d, b.points_2d);
}
void expectEqual(const ServoStatus& a, const ServoStatus& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.frame_sequence, b.frame_sequence);
  EXPECT_EQ(a.state, b.state);
  EXPECT_EQ(a.reason, b.reason);
  EXPECT_EQ(a.view_error_rad, b.view_error_rad);
  EXPECT_EQ(a.target_error_m, b.target_error_m);
  EXPECT_EQ(a.image_us, b.image_us);
  EXPECT_EQ(a.registration_us, b.registration_us);
  EXPECT_EQ(a.control_us, b.control_us);
  EXPECT_EQ(a.transitions, b.transitions);
  EXPECT_EQ(a.transition_time_us, b.transition_time_us);
  EXPECT_EQ(a.cause, b.cause);
}
void expectEqual(const ServoRequest& a, const ServoRequest& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.status_time_us, b.status_time_us);
  EXPECT_EQ(a.transitions, b.transitions);
  EXPECT_EQ(a.request, b.request);
}
void expectEqual(const CatheterState& a, const CatheterState& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.insertion_m, b.insertion_m);
  EXPECT_EQ(a.roll_rad, b.roll_rad);
  EXPECT_EQ(a.bend_rad, b.bend_rad);
  EXPECT_EQ(a.insertion_speed_mps, b.insertion_speed_mps);
  EXPECT_EQ(a.roll_speed_radps, b.roll_speed_radps);
  EXPECT_EQ(a.bend_speed_radps, b.bend_speed_radps);
  EXPECT_EQ(a.insertion_force_n, b.insertion_force_n);
}
void expectEqual(const CatheterCommand& a, const CatheterCommand& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.frame_sequence, b.frame_sequence);
  EXPECT_EQ(a.valid_for_us, b.valid_for_us);
  EXPECT_EQ(a.insertion_speed_mps, b.insertion_speed_mps);
  EXPECT_EQ(a.roll_speed_radps, b.roll_speed_radps);
  EXPECT_EQ(a.bend_speed_radps, b.bend_speed_radps);
}
void expectEqual(const CatheterTip& a, const CatheterTip& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.frame_sequence, b.frame_sequence);
  EXPECT_EQ(a.model_id, b.model_id);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.tip_model, b.tip_model);
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.branch, b.branch);
  EXPECT_EQ(a.tree_point, b.tree_point);
  EXPECT_EQ(a.arc_length_m, b.arc_length_m);
  EXPECT_EQ(a.probability, b.probability);
  EXPECT_EQ(a.reason, b.reason);
}
void expectEqual(const CatheterInput& a, const CatheterInput& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.frame_sequence, b.frame_sequence);
  EXPECT_EQ(a.verdict, b.verdict);
  expectEqual(a.arm, b.arm);
  expectEqual(a.drive, b.drive);
}
void expectEqual(const XrayFrame& a, const XrayFrame& b) {
  EXPECT_EQ(a.time_us, b.time_us);
  EXPECT_EQ(a.sequence, b.sequence);
  const auto &p = a.camera.parameters(), &q = b.camera.parameters();
  EXPECT_EQ(p.fx_px, q.fx_px);
  EXPECT_EQ(p.fy_px, q.fy_px);
  EXPECT_EQ(p.cx_px, q.cx_px);
  EXPECT_EQ(p.cy_px, q.cy_px);
  EXPECT_EQ(p.pixel_spacing_m, q.pixel_spacing_m);
  EXPECT_EQ(p.source_detector_distance_m, q.source_detector_distance_m);
  ASSERT_EQ(a.image.size(), b.image.size());
  ASSERT_EQ(a.image.type(), b.image.type());
  for (int y = 0; y < a.image.rows; ++y) {
    EXPECT_EQ(std::memcmp(a.image.ptr(y), b.image.ptr(y), static_cast<std::size_t>(a.image.cols) * a.image.elemSize()),
              0);
  }
}

// Decodes from memory of exactly this size, so that a sanitizer sees the first byte read beyond it.
template <typename T>
Decoded<T> decodeExactly(const Bytes& bytes) {
  const std::unique_ptr<std::uint8_t[]> copy(new std::uint8_t[bytes.size()]);
  std::copy(bytes.begin(), bytes.end(), copy.get());
  Decoded<T> decoded = decode<T>(copy.get(), bytes.size());
  EXPECT_NE(decoded.value.has_value(), !decoded.error.empty());
  EXPECT_THAT(decoded.error, testing::Not(testing::HasSubstr("\n")));
  if (decoded.value) expectSound(*decoded.value);
  return decoded;
}

template <typename T>
void expectRefused(const Bytes& bytes) {
  EXPECT_FALSE(decodeExactly<T>(bytes).value.has_value());
}

template <typename T>
struct EveryMessage : testing::Test {};
using Messages = testing::Types<XrayFrame, CArmState, CArmCommand, RegistrationMessage, ServoStatus, ServoRequest,
                                CatheterState, CatheterCommand, CatheterTip, ServoInput, CatheterInput>;
struct MessageNames {
  template <typename T>
  static std::string GetName(int i) {
    static const char* const kNames[] = {"XrayFrame",   "CArmState",    "CArmCommand",   "Registration",
                                         "ServoStatus", "ServoRequest", "CatheterState", "CatheterCommand",
                                         "CatheterTip", "ServoInput",   "CatheterInput"};
    return kNames[i];
  }
};
TYPED_TEST_SUITE(EveryMessage, Messages, MessageNames);

TYPED_TEST(EveryMessage, RoundTripIsExact) {
  test::Random random(1);
  for (int i = 0; i < 50; ++i) {
    const auto sent = test::randomMessage<TypeParam>(random);
    const auto received = decodeExactly<TypeParam>(encode(sent));
    ASSERT_TRUE(received.value) << received.error;
    expectEqual(sent, *received.value);
  }
}

TYPED_TEST(EveryMessage, RefusesEveryTruncationAndTrailingBytes) {
  test::Random random(2);
  Bytes bytes = encode(test::randomMessage<TypeParam>(random));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    expectRefused<TypeParam>(Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)));
  bytes.push_back(0);
  expectRefused<TypeParam>(bytes);
  EXPECT_FALSE(decode<TypeParam>(nullptr, 0).value.has_value());
}

TYPED_TEST(EveryMessage, AcceptsNothingUnsoundWhateverByteIsFlipped) {
  test::Random random(3);
  const Bytes bytes = encode(test::randomMessage<TypeParam>(random));
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const int flip : {0x01, 0x80, 0x7f, 0xff}) {
      Bytes wrong = bytes;
      wrong[i] = static_cast<std::uint8_t>(wrong[i] ^ flip);
      const auto decoded = decodeExactly<TypeParam>(wrong);
      EXPECT_FALSE(i < 8 && decoded.value) << "fingerprint byte " << i;
    }
  }
}

TYPED_TEST(EveryMessage, AcceptsNothingUnsoundWhateverIntegerOrDoubleStandsAnywhere) {
  test::Random random(4);
  const Bytes bytes = encode(test::randomMessage<TypeParam>(random));
  // The largest and smallest sizes, and the first bytes of NaN and infinities, at every place: lying size fields among
  // them.
  const Bytes patterns[] = {{0x7f, 0xff, 0xff, 0xff},
                            {0x80, 0, 0, 0},
                            {0xff, 0xff, 0xff, 0xff},
                            {0, 0, 0, 0},
                            {0x7f, 0xf8, 0, 0},
                            {0x7f, 0xf0, 0, 0, 0, 0, 0, 0},
                            {0xff, 0xf0, 0, 0, 0, 0, 0, 0}};
  int tried = 0, accepted = 0;
  for (const Bytes& pattern : patterns) {
    for (std::size_t i = 0; i + pattern.size() <= bytes.size(); ++i) {
      Bytes wrong = bytes;
      std::copy(pattern.begin(), pattern.end(), wrong.begin() + static_cast<std::ptrdiff_t>(i));
      accepted += decodeExactly<TypeParam>(wrong).value.has_value();
      ++tried;
    }
  }
  // Some are sound (a time, say), many are not; decodeExactly() looks at those that are accepted.
  EXPECT_GT(accepted, 0);
  EXPECT_LT(accepted, tried);
}

TYPED_TEST(EveryMessage, RefusesEveryOtherType) {
  test::Random random(5);
  const Bytes foreign[] = {
      encode(test::randomMessage<XrayFrame>(random)),     encode(test::randomMessage<CArmState>(random)),
      encode(test::randomMessage<CArmCommand>(random)),   encode(test::randomMessage<RegistrationMessage>(random)),
      encode(test::randomMessage<ServoStatus>(random)),   encode(test::randomMessage<ServoRequest>(random)),
      encode(test::randomMessage<CatheterState>(random)), encode(test::randomMessage<CatheterCommand>(random)),
      encode(test::randomMessage<CatheterTip>(random)),   encode(test::randomMessage<ServoInput>(random)),
      encode(test::randomMessage<CatheterInput>(random))};
  int accepted = 0;
  for (const Bytes& bytes : foreign) accepted += decodeExactly<TypeParam>(bytes).value.has_value();
  EXPECT_EQ(accepted, 1);
}

// The bytes that stand for `value` in a message, replaced by those of `other`: what a sender without our rules could
// send.
Bytes withDouble(Bytes bytes, double value, double other) {
  const auto big_endian = [](double d) {
    Bytes b(8);
    std::memcpy(b.data(), &d, 8);
    std::reverse(b.begin(), b.end());
    return b;
  };
  const Bytes from = big_endian(value), to = big_endian(other);
  const auto at = std::search(bytes.begin(), bytes.end(), from.begin(), from.end());
  EXPECT_NE(at, bytes.end());
  std::copy(to.begin(), to.end(), at);
  return bytes;
}

TEST(Decode, RefusesNumbersThatBreakTheirRule) {
  test::Random random(6);
  const auto frame = test::randomMessage<XrayFrame>(random);
  const auto registration = test::randomMessage<RegistrationMessage>(random);
  const auto command = test::randomMessage<CArmCommand>(random);
  const auto& p = frame.camera.parameters();
  for (const double wrong : {0.0, -1.0, kNan, kInf}) {
    expectRefused<XrayFrame>(withDouble(encode(frame), p.fx_px, wrong));
    expectRefused<XrayFrame>(withDouble(encode(frame), p.fy_px, wrong));
  }
  for (const double wrong : {kNan, kInf, -kInf}) {
    expectRefused<XrayFrame>(withDouble(encode(frame), p.cx_px, wrong));
    expectRefused<CArmCommand>(withDouble(encode(command), command.velocity[4], wrong));
    expectRefused<RegistrationMessage>(withDouble(encode(registration), registration.covariance(5, 4), wrong));
    expectRefused<RegistrationMessage>(
        withDouble(encode(registration), registration.T_camera_model.translation().z(), wrong));
  }
  const double r = registration.T_camera_model.linear()(1, 2);
  expectRefused<RegistrationMessage>(withDouble(encode(registration), r, r + 1e-3));
}

TEST(Decode, SaysWhichTypeFieldAndRule) {
  CArmCommand command;
  command.velocity[3] = 0.5;
  const auto decoded = decodeExactly<CArmCommand>(withDouble(encode(command), 0.5, kNan));
  EXPECT_EQ(decoded.error, "carm_command_t: joint_velocity[3] = nan: must be finite");
}

TEST(Decode, SixteenBitPixelsAreLittleEndianOnTheWire) {
  cv::Mat image(1, 1, CV_16UC1);
  image.at<std::uint16_t>(0, 0) = 0x1234;
  const Bytes bytes = encode(XrayFrame{0, 0, image, XrayCamera::centred(1, 1, 1e-3, 1)});
  EXPECT_EQ(bytes[bytes.size() - 2], 0x34);
  EXPECT_EQ(bytes[bytes.size() - 1], 0x12);
}

TEST(Encode, RefusesWhatMustNotGoOnTheWire) {
  test::Random random(7);
  CArmState state;
  state.joints[1] = kNan;
  EXPECT_THROW(encode(state), std::invalid_argument);
  CArmCommand command;
  command.velocity[0] = kInf;
  EXPECT_THROW(encode(command), std::invalid_argument);
  command = CArmCommand();
  command.valid_for_us = -1;
  EXPECT_THROW(encode(command), std::invalid_argument);
  RegistrationMessage registration;
  registration.T_camera_model.linear() *= -1;  // Orthonormal, but a mirror.
  EXPECT_THROW(encode(registration), std::invalid_argument);
  registration = RegistrationMessage();
  registration.covariance(2, 2) = -1e-9;
  EXPECT_THROW(encode(registration), std::invalid_argument);
  registration = RegistrationMessage();
  registration.status_text = std::string("a\0b", 3);
  EXPECT_THROW(encode(registration), std::invalid_argument);
  ServoStatus status;
  status.state = static_cast<ServoState>(6);
  EXPECT_THROW(encode(status), std::invalid_argument);
  status = ServoStatus();
  status.cause = static_cast<ServoCause>(-1);
  EXPECT_THROW(encode(status), std::invalid_argument);
  ServoRequest request;
  request.request = static_cast<ServoRequestKind>(5);
  EXPECT_THROW(encode(request), std::invalid_argument);
  XrayFrame frame = test::randomMessage<XrayFrame>(random);
  frame.image = frame.image.rowRange(0, 3);
  EXPECT_THROW(encode(frame), std::invalid_argument);
  frame.image = cv::Mat();
  EXPECT_THROW(encode(frame), std::invalid_argument);
  frame.image = cv::Mat::zeros(5, 7, CV_32FC1);
  EXPECT_THROW(encode(frame), std::invalid_argument);
}

// Noise, so that nothing compresses; and 8 and 16 bit, odd sizes, windows of larger images.
TEST(XrayFramePng, GivesTheSamePixelsAsRaw) {
  test::Random random(11);
  for (const int type : {CV_8UC1, CV_16UC1}) {
    XrayFrame frame = test::randomFrame(random, 67, 41, type);
    const auto raw = decodeExactly<XrayFrame>(encode(frame));
    const auto png = decodeExactly<XrayFrame>(encode(frame, ImageEncoding::kPng));
    ASSERT_TRUE(raw.value && png.value) << png.error;
    expectEqual(*raw.value, *png.value);
    const XrayFrame window = cropped(frame, {11, 7, 40, 30});
    EXPECT_EQ(window.camera.parameters().cx_px, frame.camera.parameters().cx_px - 11);
    const auto sent = decodeExactly<XrayFrame>(encode(window, ImageEncoding::kPng));
    ASSERT_TRUE(sent.value) << sent.error;
    expectEqual(window, *sent.value);
  }
}

TEST(XrayFramePng, SurvivesEveryCutAndAnyChange) {
  test::Random random(12);
  const Bytes bytes = encode(test::randomFrame(random, 9, 8, CV_16UC1), ImageEncoding::kPng);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    expectRefused<XrayFrame>(Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)));
  }
  for (int i = 0; i < 3000; ++i) {
    Bytes changed = bytes;
    for (int k = 0; k < 1 + i % 4; ++k) {
      changed[static_cast<std::size_t>(random.uniform(0, 1) * changed.size())] =
          static_cast<std::uint8_t>(random.uniform(0, 256));
    }
    const auto decoded = decodeExactly<XrayFrame>(changed);
    if (decoded.value) expectSound(*decoded.value);
  }
}

// Both the message and the PNG inside it claim 8192 x 8192 pixels, and hold a few bytes.
TEST(XrayFramePng, AFewBytesDoNotClaimAHugeImage) {
  const cv::Mat image(1, 1, CV_16UC1, cv::Scalar(5));
  Bytes bytes = encode(XrayFrame{0, 0, image, XrayCamera::centred(1, 1, 1e-3, 1)}, ImageEncoding::kPng);
  const auto set = [&](std::size_t at, std::uint32_t number) {
    for (int i = 0; i < 4; ++i)
      bytes[at + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(number >> (24 - 8 * i));
  };
  const std::string ihdr = "IHDR";
  const auto header = std::search(bytes.begin(), bytes.end(), ihdr.begin(), ihdr.end());
  ASSERT_NE(header, bytes.end());
  set(24, 8192);  // Behind the fingerprint, time and sequence.
  set(28, 8192);
  expectRefused<XrayFrame>(bytes);
  set(static_cast<std::size_t>(header - bytes.begin()) + 4, 8192);
  set(static_cast<std::size_t>(header - bytes.begin()) + 8, 8192);
  const auto decoded = decodeExactly<XrayFrame>(bytes);
  EXPECT_FALSE(decoded.value);
  EXPECT_THAT(decoded.error, testing::HasSubstr("too small"));
}

TEST(XrayFrame, AWindowMustLieWithinTheImage) {
  test::Random random(13);
  const XrayFrame frame = test::randomFrame(random, 20, 10, CV_8UC1);
  for (const cv::Rect& wrong : {cv::Rect(0, 0, 21, 10), cv::Rect(-1, 0, 5, 5), cv::Rect(0, 0, 0, 5),
                                cv::Rect(19, 0, 2, 1), cv::Rect(2147483647, 0, 2147483647, 1)}) {
    EXPECT_THROW(cropped(frame, wrong), InputError);
  }
}

}  // namespace
}  // namespace angio
