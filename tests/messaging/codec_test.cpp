// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/codec.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "angio/base/errors.hpp"
#include "angio/imaging/xray_frame.hpp"
#include "decode_exactly.hpp"
#include "random_messages.hpp"

namespace angio::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

using Bytes = std::vector<std::uint8_t>;

// All of a frame, pixels among it.
void expectEqual(const XrayFrame& a, const XrayFrame& b) {
  EXPECT_EQ(test::FieldValues::of(a), test::FieldValues::of(b));
}

using test::decodeExactly;
using test::expectRefused;

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
  const Bytes bytes = encode(XrayFrame{0, 0, image, XrayCamera::centered(1, 1, 1e-3, 1)});
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
    (void)decodeExactly<XrayFrame>(changed);
  }
}

// Both the message and the PNG inside it claim 8192 x 8192 pixels, and hold a few bytes.
TEST(XrayFramePng, AFewBytesDoNotClaimAHugeImage) {
  const cv::Mat image(1, 1, CV_16UC1, cv::Scalar(5));
  Bytes bytes = encode(XrayFrame{0, 0, image, XrayCamera::centered(1, 1, 1e-3, 1)}, ImageEncoding::kPng);
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
}  // namespace angio::test
