// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/igtl/igtl_messages.hpp"

#include <gmock/gmock.h>

#include "angio/base/big_endian.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

Pose somePose() {
  Twist xi;
  xi << 0.1, -0.2, 0.3, 0.4, -0.5, 0.6;
  return expSE3(xi);
}

std::variant<Received, std::string> readBytes(const std::string& bytes) {
  const auto header = readHeader(bytes);
  if (!header) return "no header";
  return readBody(*header, std::string_view(bytes).substr(IgtlHeader::kBytes));
}

TEST(IgtlMessages, ATransformComesBackInBothHeaderVersions) {
  IgtlMessage sent = transformMessage("Target", somePose());
  sent.metadata = {{"key", "value"}, {"other", ""}};
  for (const auto version : {HeaderVersion::k1, HeaderVersion::k2}) {
    const auto read = readBytes(bytesOf(sent, version, 1'700'000'000'500'000));
    ASSERT_TRUE(std::holds_alternative<Received>(read)) << std::get<std::string>(read);
    const auto& transform = std::get<ReceivedTransform>(std::get<Received>(read));
    EXPECT_EQ(transform.device, "Target");
    // Floats: 6e-8 of a rotation, and of 600 mm.
    EXPECT_LT((transform.T.matrix() - somePose().matrix()).cwiseAbs().maxCoeff(), 1e-6);
  }
}

// By the protocol's page on header version 2: an extended header of 12 bytes, the content, an index of 2 + 8 bytes for
// each key, keys and values.
TEST(IgtlMessages, HeaderVersion2IsLaidOutAsTheProtocolSays) {
  IgtlMessage sent = stringMessage("Target", "lao_deg 1 cra_deg 2");
  sent.metadata = {{"key", "value"}};
  const std::string bytes = bytesOf(sent, HeaderVersion::k2, 1'500'000);
  EXPECT_EQ(bigEndian<std::uint16_t>(bytes.data()), 2);
  EXPECT_EQ(bigEndian<std::uint32_t>(bytes.data() + 34), 1u);
  EXPECT_EQ(bigEndian<std::uint32_t>(bytes.data() + 38), 0x80000000u);
  EXPECT_EQ(bigEndian<std::uint64_t>(bytes.data() + 42), bytes.size() - 58);
  const std::string body = bytes.substr(58);
  EXPECT_EQ(body.substr(0, 12), std::string("\0\x0C\0\x0A\0\0\0\x08\0\0\0\0", 12));
  EXPECT_EQ(body.substr(12 + 4, 19), "lao_deg 1 cra_deg 2");
  EXPECT_EQ(body.substr(12 + 4 + 19), std::string("\0\1\0\3\0\3\0\0\0\5keyvalue", 18));
  EXPECT_EQ(std::get<ReceivedString>(std::get<Received>(readBytes(bytes))).text, "lao_deg 1 cra_deg 2");
}

TEST(IgtlMessages, RefusesWhatIsWrongAndReadsNothingBeyond) {
  const std::string good = bytesOf(transformMessage("Target", somePose()), HeaderVersion::k1, 0);
  const auto why = [](const std::string& bytes) {
    const auto read = readBytes(bytes);
    return std::holds_alternative<std::string>(read) ? std::get<std::string>(read) : "read";
  };
  EXPECT_EQ(why(good), "read");
  std::string changed = good;
  changed[70] = static_cast<char>(changed[70] ^ 1);
  EXPECT_EQ(why(changed), "TRANSFORM: its CRC is wrong");
  EXPECT_THAT(why(good.substr(0, 90)), testing::HasSubstr("not as long"));
  changed = good;
  changed[1] = 9;
  EXPECT_EQ(why(changed), "no header");
  Pose mirrored = Pose::Identity();
  mirrored.linear() = Eigen::Vector3d(1, 1, -1).asDiagonal();
  EXPECT_THAT(why(bytesOf(transformMessage("Target", mirrored), HeaderVersion::k1, 0)), testing::HasSubstr("rotation"));
  mirrored = Pose::Identity();
  mirrored.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(why(bytesOf(transformMessage("Target", mirrored), HeaderVersion::k1, 0)), testing::HasSubstr("rotation"));
  EXPECT_THAT(why(bytesOf({"TRANSFORM", "Target", "short", {}}, HeaderVersion::k1, 0)),
              testing::HasSubstr("12 numbers"));
  EXPECT_THAT(why(bytesOf({"STRING", "Target", std::string("\0\3\0\7ab", 6), {}}, HeaderVersion::k1, 0)),
              testing::HasSubstr("its length"));
  EXPECT_THAT(why(bytesOf(stringMessage("Target", "a\x1b[2J"), HeaderVersion::k1, 0)), testing::HasSubstr("printable"));
}

TEST(IgtlMessages, AnyBytesEnd) {
  Random random(1);
  for (const auto version : {HeaderVersion::k1, HeaderVersion::k2}) {
    for (const IgtlMessage& message : {transformMessage("Target", somePose()), stringMessage("Target", "lao_deg 3")}) {
      for (int i = 0; i < 2000; ++i) {
        // Its CRC is right, so that what lies behind is read.
        IgtlMessage hostile = message;
        std::string body = bytesOf(message, version, 0).substr(IgtlHeader::kBytes);
        for (int k = 0; k < 3; ++k) {
          body[static_cast<std::size_t>(random.uniform(0, 1) * body.size())] =
              static_cast<char>(static_cast<std::uint8_t>(random.uniform(0, 256)));
        }
        hostile.content = body.substr(0, static_cast<std::size_t>(random.uniform(0, 1) * (body.size() + 1)));
        const std::string bytes = bytesOf(hostile, HeaderVersion::k1, 0);
        std::string as_other = bytes;
        as_other[1] = static_cast<char>(version);
        (void)readBytes(as_other);
      }
    }
  }
}

}  // namespace
}  // namespace angio::test
