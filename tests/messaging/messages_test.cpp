// SPDX-License-Identifier: GPL-2.0-or-later
// What must hold for every message. A message that is added to AnyMessage is tested here without an edit.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <set>

#include "angio/messaging/any_message.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/types_of.hpp"
#include "decode_exactly.hpp"
#include "random_messages.hpp"

namespace angio::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <typename T>
using Described = wire::Description<T>;

template <typename T>
constexpr bool kPlain = std::is_same_v<T, typename Described<T>::Packed>;

// A frame's fields are those of its packed form.
template <typename T>
typename Described<T>::Packed packed(const T& message) {
  return Described<T>::pack(message);
}

// What a sender without our rules could send.
template <typename T>
Bytes uncheckedBytes(const typename Described<T>::Packed& fields) {
  Bytes bytes;
  wire::FieldWriter writer(bytes);
  writer.number("", std::int64_t{Described<T>::Wire::getHash()});
  Described<T>::fields(writer, fields);
  return bytes;
}

template <typename T>
test::FieldValues::List valuesOf(const typename Described<T>::Packed& fields) {
  return test::FieldValues::of(fields, Described<T>::fields);
}

using test::decodeExactly;
using test::expectRefused;

struct TypeName {
  template <typename T>
  static std::string GetName(int) {
    return Described<T>::Wire::getTypeName();
  }
};

template <typename T>
struct EveryMessage : testing::Test {};
TYPED_TEST_SUITE(EveryMessage, test::TypesOf<AnyMessage>::type, TypeName);

TYPED_TEST(EveryMessage, IsDescribedAsItsLcmFileSays) {
  test::Random random(1);
  const auto message = test::randomMessage<TypeParam>(random);
  EXPECT_EQ(test::FieldHash::of(message), Described<TypeParam>::Wire::getHash())
      << "names, types, sizes and order of the fields must be those of the .lcm file";
}

// All of a struct's bytes belong to its fields, but for the padding that the next field's alignment asks for.
TYPED_TEST(EveryMessage, IsDescribedWithAllItsMembers) {
  if constexpr (kPlain<TypeParam>) {
    const TypeParam message;
    test::FieldPlaces fields;
    Described<TypeParam>::fields(fields, message);
    auto places = fields.places();
    std::sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.begin < b.begin; });
    const auto aligned = [](std::size_t offset, std::size_t to) { return (offset + to - 1) / to * to; };
    const char* const start = reinterpret_cast<const char*>(&message);
    std::size_t covered = 0;
    for (const auto& place : places) {
      const auto offset = static_cast<std::size_t>(place.begin - start);
      const bool next = place.alignment ? offset == aligned(covered, place.alignment)
                                        : offset == aligned(covered, 8) || offset == aligned(covered, 16);
      EXPECT_TRUE(next) << "a member between the bytes " << covered << " and " << offset << " is not described";
      covered = static_cast<std::size_t>(place.end - start);
    }
    EXPECT_EQ(aligned(covered, alignof(TypeParam)), sizeof(TypeParam)) << "the last member is not described";
  }
}

TYPED_TEST(EveryMessage, RoundTripIsExact) {
  test::Random random(1);
  for (int i = 0; i < 50; ++i) {
    const auto sent = test::randomMessage<TypeParam>(random);
    const auto received = decodeExactly<TypeParam>(encode(sent));
    ASSERT_TRUE(received.value) << received.error;
    EXPECT_EQ(valuesOf<TypeParam>(packed(sent)), valuesOf<TypeParam>(packed(*received.value)));
  }
}

TYPED_TEST(EveryMessage, HasTheBytesOfLcmsOwnCode) {
  test::Random random(2);
  for (int i = 0; i < 20; ++i) {
    const Bytes bytes = encode(test::randomMessage<TypeParam>(random));
    const int size = static_cast<int>(bytes.size());
    typename Described<TypeParam>::Wire wire{};
    ASSERT_EQ(wire.decode(bytes.data(), 0, size), size);
    Bytes again(bytes.size());
    ASSERT_EQ(wire.encode(again.data(), 0, size), size);
    EXPECT_EQ(again, bytes);
  }
}

// Every field travels, and none is taken for another.
TYPED_TEST(EveryMessage, EachFieldCounts) {
  test::Random random(3);
  const auto before = packed(test::randomMessage<TypeParam>(random));
  const auto values_before = valuesOf<TypeParam>(before);
  for (int field = 0;; ++field) {
    test::FieldChange change(field, 0);
    auto changed = before;
    Described<TypeParam>::fields(change, changed);
    if (!change.made()) {
      EXPECT_GT(field, 2);
      break;
    }
    const auto decoded = decodeExactly<TypeParam>(uncheckedBytes<TypeParam>(changed));
    if (!kPlain<TypeParam> && !decoded.value) continue;  // The fields of a frame depend on each other.
    ASSERT_TRUE(decoded.value) << change.name() << ": " << decoded.error;
    const auto values = valuesOf<TypeParam>(packed(*decoded.value));
    EXPECT_EQ(values, valuesOf<TypeParam>(changed)) << change.name();
    EXPECT_NE(values, values_before) << change.name();
  }
}

// NaN, infinities and whatever lies outside a field's limits, in one field after the other: neither sent nor believed.
TYPED_TEST(EveryMessage, EachFieldKeepsItsRule) {
  test::Random random(4);
  const auto before = packed(test::randomMessage<TypeParam>(random));
  int tried = 0;
  for (int field = 0;; ++field) {
    test::FieldChange change(field, 0);
    auto changed = before;
    Described<TypeParam>::fields(change, changed);
    if (!change.made()) break;
    for (int way = 1;; ++way) {
      test::FieldChange wrong(field, way);
      changed = before;
      Described<TypeParam>::fields(wrong, changed);
      if (!wrong.made()) break;
      ++tried;
      const auto decoded = decodeExactly<TypeParam>(uncheckedBytes<TypeParam>(changed));
      EXPECT_FALSE(decoded.value) << wrong.name() << ", way " << way;
      if constexpr (kPlain<TypeParam>) {
        EXPECT_THAT(decoded.error, testing::StartsWith(TypeName::GetName<TypeParam>(0) + ": " + wrong.name()));
        EXPECT_THROW(encode(changed), std::invalid_argument) << wrong.name() << ", way " << way;
      }
    }
  }
  EXPECT_GT(tried, 0);
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

// One message of each type.
template <typename... T>
std::vector<AnyMessage> oneOfEach(test::Random& random, const std::variant<T...>*) {
  return {AnyMessage(test::randomMessage<T>(random))...};
}
std::vector<AnyMessage> oneOfEach(test::Random& random) {
  return oneOfEach(random, static_cast<const AnyMessage*>(nullptr));
}

Bytes bytesOf(const AnyMessage& message) {
  return std::visit([](const auto& m) { return encode(m); }, message);
}

TYPED_TEST(EveryMessage, RefusesEveryOtherType) {
  test::Random random(5);
  int accepted = 0;
  for (const AnyMessage& message : oneOfEach(random)) {
    accepted += decodeExactly<TypeParam>(bytesOf(message)).value.has_value();
  }
  EXPECT_EQ(accepted, 1);
}

TEST(AnyMessage, IsKnownByItsFingerprintAndShownInOneLine) {
  test::Random random(6);
  for (int i = 0; i < 200; ++i) {
    for (const AnyMessage& message : oneOfEach(random)) {
      const Bytes bytes = bytesOf(message);
      const auto decoded = decodeAny(bytes.data(), bytes.size());
      ASSERT_TRUE(decoded.value) << decoded.error;
      EXPECT_EQ(decoded.value->index(), message.index());
      EXPECT_EQ(bytesOf(*decoded.value), bytes);
      EXPECT_EQ(timeOf(*decoded.value), timeOf(message));
      EXPECT_EQ(sequenceOf(*decoded.value), sequenceOf(message));
      const std::string line = describe(message);
      EXPECT_FALSE(line.empty());
      EXPECT_TRUE(std::all_of(line.begin(), line.end(), [](unsigned char c) { return c >= 0x20 && c < 0x7f; })) << line;
    }
  }
}

TEST(AnyMessage, HasOneLcmFileForEachOfItsTypes) {
  test::Random random(7);
  std::set<std::string> types, files;
  for (const AnyMessage& message : oneOfEach(random)) {
    const Bytes bytes = bytesOf(message);
    types.insert(messageType(bytes.data(), bytes.size()).value());
  }
  for (const auto& entry : std::filesystem::directory_iterator(ANGIO_LCM_TYPES)) {
    files.insert(entry.path().stem().string());
  }
  EXPECT_EQ(types, files);
  EXPECT_EQ(types.size(), std::variant_size_v<AnyMessage>);
}

TEST(AnyMessage, NumbersOfItsOwnComeBeforeThoseOfTheFrame) {
  CArmCommand command;
  command.sequence = 3;
  command.frame_sequence = 7;
  EXPECT_EQ(sequenceOf(command), 3);
  CatheterTip tip;
  tip.frame_sequence = 7;
  EXPECT_EQ(sequenceOf(tip), 7);
}

template <typename... T>
std::vector<std::string> allLimits(const std::variant<XrayFrame, T...>*) {
  std::vector<std::string> all;
  const auto add = [&](const auto& message) {
    for (const std::string& line : test::FieldLimits::of(message)) {
      all.push_back(std::string(Described<std::decay_t<decltype(message)>>::Wire::getTypeName()) + "." + line);
    }
  };
  (add(T()), ...);
  return all;
}

// By our own account, not by the descriptions'; an X-ray frame's are those of its camera.
TEST(AnyMessage, IsRestrictedAsItsReceiversTrust) {
  EXPECT_THAT(allLimits(static_cast<const AnyMessage*>(nullptr)),
              testing::IsSupersetOf({"servo_input_t.verdict in [0, 2]",
                                     "carm_command_t.valid_for_us in [0, inf]",
                                     "registration_t.status in [0, inf]",
                                     "carm_state_t.utime in [-4.50359963e+15, 4.50359963e+15]",
                                     "registration_t.rotation: rotation",
                                     "registration_t.covariance: covariance",
                                     "registration_t.mean_residual in [0, inf]",
                                     "registration_t.points_3d in [0, inf]",
                                     "registration_t.points_2d in [0, inf]",
                                     "servo_status_t.transitions in [0, inf]",
                                     "servo_status_t.state in [0, 5]",
                                     "servo_status_t.cause in [0, 16]",
                                     "servo_request_t.transitions in [0, inf]",
                                     "servo_request_t.request in [0, 4]",
                                     "servo_session_t.command_sequence in [0, inf]",
                                     "catheter_state_t.bend in [0, inf]",
                                     "catheter_command_t.valid_for_us in [0, inf]",
                                     "catheter_tip_t.status in [0, 2]",
                                     "catheter_tip_t.covariance: covariance",
                                     "catheter_tip_t.branch in [0, inf]",
                                     "catheter_tip_t.tree_point in [0, inf]",
                                     "catheter_tip_t.arc_length in [0, inf]",
                                     "catheter_tip_t.probability in [0, 1]",
                                     "catheter_input_t.verdict in [0, 2]",
                                     "catheter_input_t.drive.bend in [0, inf]",
                                     "registration_points_t.covariance[][0] in [0, inf]",
                                     "registration_points_t.covariance[][3] in [0, inf]",
                                     "registration_points_t.covariance[][5] in [0, inf]"}));
}

}  // namespace
}  // namespace angio::test
