// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/lcm_datagrams.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "udp_group.hpp"

namespace angio::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

using namespace std::string_literals;
using test::Bytes;
using test::LongDatagram;

const UdpSender kSender{0x7f000001, 5000};

struct Datagrams : testing::Test {
  std::optional<LcmMessage> take(const Bytes& datagram, const UdpSender& sender = kSender) {
    return datagrams.take(sender, datagram.data(), datagram.size());
  }
  std::optional<LcmMessage> take(const LongDatagram& fragment, const UdpSender& sender = kSender) {
    return take(fragment.bytes(), sender);
  }

  LcmDatagrams datagrams{[](const std::string& channel) { return channel != "UNWANTED"; }};
};

// "abcdefghij" on channel "CH" in three fragments.
LongDatagram part(std::uint16_t number, std::uint32_t sequence = 1) {
  const std::string payloads[] = {"CH"s + '\0' + "abcd", "efg", "hij"};
  const std::uint32_t offsets[] = {0, 4, 7};
  return {sequence, 10, offsets[number], number, 3, payloads[number]};
}

TEST_F(Datagrams, TakeAShortMessage) {
  const auto message = take(test::shortDatagram(1, "CH"s + '\0' + "data"));
  ASSERT_TRUE(message);
  EXPECT_EQ(message->channel, "CH");
  EXPECT_EQ(message->bytes, test::bytesOf("data"));
  EXPECT_EQ(message->sender, kSender);
  EXPECT_TRUE(take(test::shortDatagram(1, "CH"s + '\0'))->bytes.empty());
  EXPECT_FALSE(take(test::shortDatagram(1, "UNWANTED"s + '\0' + "data")));
  EXPECT_EQ(datagrams.refused(), 0);
}

TEST_F(Datagrams, RefuseAShortMessageThatIsMalformed) {
  const Bytes wrong[] = {{},
                         test::bytesOf("LC0"),
                         test::bytesOf("LC02\0\0\0"s),
                         test::bytesOf("LC04aaaaCH"s + '\0'),
                         test::shortDatagram(1, ""),
                         test::shortDatagram(1, "\0data"s),
                         test::shortDatagram(1, "SERVO_REQUEST"),
                         test::shortDatagram(1, std::string(64, 'c') + '\0'),
                         test::shortDatagram(1, std::string(60000, 'c'))};
  for (const Bytes& datagram : wrong) EXPECT_FALSE(take(datagram)) << datagram.size();
  EXPECT_EQ(datagrams.refused(), static_cast<std::int64_t>(std::size(wrong)));
  EXPECT_TRUE(take(test::shortDatagram(1, std::string(63, 'c') + '\0')));
}

TEST_F(Datagrams, JoinFragmentsInAnyOrderAndOnce) {
  const int orders[][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  std::uint32_t sequence = 0;
  for (const auto& order : orders) {
    ++sequence;
    EXPECT_FALSE(take(part(order[0], sequence)));
    EXPECT_FALSE(take(part(order[0], sequence))) << "a fragment that comes twice";
    EXPECT_FALSE(take(part(order[1], sequence)));
    const auto message = take(part(order[2], sequence));
    ASSERT_TRUE(message) << sequence;
    EXPECT_EQ(message->channel, "CH");
    EXPECT_EQ(message->bytes, test::bytesOf("abcdefghij"));
    EXPECT_EQ(datagrams.unfinished_bytes(), 0u);
  }
  EXPECT_EQ(datagrams.refused(), 0);
}

TEST_F(Datagrams, OfAFragmentThatComesTwiceTheFirstCounts) {
  take(part(0));
  take(part(1));
  LongDatagram other = part(1);
  other.payload = "EFG";
  EXPECT_FALSE(take(other));
  EXPECT_EQ(take(part(2))->bytes, test::bytesOf("abcdefghij"));
}

TEST_F(Datagrams, KeepSendersApart) {
  const UdpSender other{kSender.address, 5001}, third{kSender.address + 1, 5000};
  for (const std::uint16_t number : {0, 1}) {
    for (const UdpSender& sender : {kSender, other, third}) EXPECT_FALSE(take(part(number), sender));
  }
  for (const UdpSender& sender : {other, kSender, third}) {
    const auto message = take(part(2), sender);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->sender, sender);
    EXPECT_EQ(message->bytes.size(), 10u);
  }
}

TEST_F(Datagrams, ANewMessageOfASenderReplacesItsUnfinishedOne) {
  take(part(0, 1));
  take(part(1, 1));
  EXPECT_FALSE(take(part(0, 2)));
  EXPECT_FALSE(take(part(2, 2)));
  EXPECT_TRUE(take(part(1, 2)));
  EXPECT_FALSE(take(part(2, 1)));
  EXPECT_EQ(datagrams.refused(), 0);
}

TEST_F(Datagrams, RefuseAFragmentThatIsMalformed) {
  take(part(0));
  const auto changed = [](auto change) {
    LongDatagram fragment = part(1);
    change(fragment);
    return fragment.bytes();
  };
  const Bytes sound = part(1).bytes();
  const Bytes wrong[] = {Bytes(sound.begin(), sound.begin() + 8),
                         Bytes(sound.begin(), sound.begin() + 19),
                         changed([](LongDatagram& f) { f.payload.clear(); }),
                         changed([](LongDatagram& f) { f.fragments = 0; }),
                         changed([](LongDatagram& f) { f.number = 3; }),
                         changed([](LongDatagram& f) { f.fragments = 12; }),
                         changed([](LongDatagram& f) { f.offset = 8; }),
                         changed([](LongDatagram& f) { f.offset = 11; }),
                         changed([](LongDatagram& f) { f.offset = 0xFFFFFFFF; }),
                         changed([](LongDatagram& f) { f.message_bytes = 0; }),
                         changed([](LongDatagram& f) { f.message_bytes = LcmDatagrams::kMaxMessage_bytes + 1; }),
                         LongDatagram{1, 10, 0, 0, 3, "CH"}.bytes(),
                         LongDatagram{1, 10, 0, 0, 3, ""}.bytes(),
                         LongDatagram{1, 10, 0, 0, 3, "\0abcd"s}.bytes(),
                         LongDatagram{1, 10, 1, 0, 3, "CH"s + '\0' + "abcd"}.bytes(),
                         LongDatagram{1, 3, 0, 0, 3, "CH"s + '\0' + "abcd"}.bytes(),
                         LongDatagram{1, 10, 0, 0, 3, std::string(64, 'c') + '\0'}.bytes()};
  for (const Bytes& datagram : wrong) EXPECT_FALSE(take(datagram));
  EXPECT_EQ(datagrams.refused(), static_cast<std::int64_t>(std::size(wrong)));
  take(part(1));
  EXPECT_EQ(take(part(2))->bytes, test::bytesOf("abcdefghij")) << "the message under way is not lost by them";
}

TEST_F(Datagrams, RefuseFragmentsWithAGapOrAnOverlap) {
  for (const int shift : {-1, 1}) {
    take(part(0));
    take(part(2));
    LongDatagram middle = part(1);
    middle.offset += static_cast<std::uint32_t>(shift);
    EXPECT_FALSE(take(middle));
  }
  LongDatagram early = part(2);
  early.payload = "hi";
  take(part(0));
  take(part(1));
  EXPECT_FALSE(take(early));
  EXPECT_EQ(datagrams.refused(), 3);
  EXPECT_EQ(datagrams.unfinished_bytes(), 0u);
}

TEST_F(Datagrams, KeepNothingOfAMessageThatNobodyWants) {
  const std::string begin = "UNWANTED"s + '\0' + "abcd";
  take(part(1));
  EXPECT_GT(datagrams.unfinished_bytes(), 0u);
  LongDatagram first = part(0);
  first.payload = begin;
  take(first);
  EXPECT_EQ(datagrams.unfinished_bytes(), 0u);
  take(part(1));
  take(part(2));
  EXPECT_EQ(datagrams.unfinished_bytes(), 0u);
  EXPECT_EQ(datagrams.refused(), 0);
}

TEST_F(Datagrams, BoundTheUnfinishedMessagesAndDropTheOldest) {
  const auto bound = static_cast<std::uint16_t>(LcmDatagrams::kMaxUnfinished);
  for (std::uint16_t port = 0; port <= bound; ++port) {
    take(part(0), {1, port});
    take(part(1), {1, port});
  }
  EXPECT_FALSE(take(part(2), {1, 0})) << "the oldest was dropped";
  EXPECT_TRUE(take(part(2), {1, bound}));
}

TEST_F(Datagrams, BoundTheBytesOfUnfinishedMessages) {
  constexpr std::uint32_t kPiece = 60000, kPieces = 400;
  const std::string piece(kPiece, 'p');
  LongDatagram fragment{1, kPiece * kPieces, 0, 0, kPieces, ""};
  for (std::uint16_t port = 0; port < 4; ++port) {
    for (std::uint16_t number = 1; number < kPieces; ++number) {
      fragment.number = number;
      fragment.offset = number * kPiece;
      fragment.payload = piece;
      take(fragment, {1, port});
      ASSERT_LE(datagrams.unfinished_bytes(), LcmDatagrams::kMaxUnfinished_bytes);
    }
  }
  fragment.number = 0;
  fragment.offset = 0;
  fragment.payload = "CH"s + '\0' + piece;
  EXPECT_TRUE(take(fragment, {1, 3}));
  EXPECT_FALSE(take(fragment, {1, 0}));
}

}  // namespace
}  // namespace angio::test
