// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

/// The channel on which LCM programs speak to themselves when they begin to listen. Others on the network hear it.
constexpr const char* kLcmSelfTestChannel = "LCM_SELF_TEST";

/// The address that the network names as a datagram's origin. A sender can forge it.
struct UdpSender {
  std::uint32_t address = 0;  ///< IPv4, in the host's byte order.
  std::uint16_t port = 0;     ///< In the host's byte order.

  bool operator==(const UdpSender& other) const { return address == other.address && port == other.port; }

  /// "127.0.0.1:40123".
  std::string text() const;
};

/// A whole message of LCM's protocol over UDP.
struct LcmMessage {
  UdpSender sender;
  std::string channel;  ///< 1 to LcmDatagrams::kMaxChannel_bytes characters.
  std::vector<std::uint8_t> bytes;
};

/// Puts LCM's messages together from UDP datagrams: a short message is one datagram ("LC02"), a long one is in
/// fragments
/// ("LC03") that may come in any order. The wire format is that of liblcm 1.x (lcm/udpm_util.h).
///
/// Every length of a datagram is checked before it is used. Memory is taken for bytes that came, never for bytes that a
/// header announces. Knows no socket and no clock.
class LcmDatagrams {
 public:
  /// LCM's own bound.
  static constexpr std::size_t kMaxChannel_bytes = 63;
  /// Larger messages are refused: a frame of 4096 x 4096 pixels of 16 bit is 32 MiB.
  static constexpr std::size_t kMaxMessage_bytes = std::size_t{48} << 20;
  /// Bounds of the unfinished messages, of which each sender has one at most. Past them, the message whose last
  /// fragment came first is dropped.
  static constexpr std::size_t kMaxUnfinished = 16, kMaxUnfinished_bytes = std::size_t{64} << 20;

  /// Whether anybody wants messages of a channel.
  using Wanted = std::function<bool(const std::string& channel)>;

  /// Drops messages that nobody wants as soon as their channel is known.
  explicit LcmDatagrams(Wanted wanted) : wanted_(std::move(wanted)) {}

  /// Returns the message that is whole with this datagram; nothing for any other datagram. A sender's unfinished
  /// message is dropped when a fragment of another one comes from the same sender.
  std::optional<LcmMessage> take(const UdpSender& sender, const std::uint8_t* datagram, std::size_t size);

  /// Datagrams that were malformed, and whole messages whose fragments did not fit together.
  std::int64_t refused() const { return refused_; }

  /// Memory of the unfinished messages [bytes], with what the bookkeeping of their fragments costs.
  std::size_t unfinished_bytes() const { return unfinished_bytes_; }

 private:
  struct Header {
    std::uint32_t sequence, message_bytes, offset;
    std::uint16_t number, fragments;
  };
  struct Fragment {
    std::uint32_t offset;
    std::vector<std::uint8_t> bytes;
  };
  struct Unfinished {
    UdpSender sender;
    Header header;  // Of the fragment that began it.
    bool unwanted = false;
    std::string channel;
    std::map<std::uint16_t, Fragment> fragments;
    std::size_t held_bytes = 0;
  };
  using Place = std::list<Unfinished>::iterator;

  std::optional<LcmMessage> refuse();
  std::optional<LcmMessage> takeShort(const UdpSender& sender, const std::uint8_t* payload, std::size_t size);
  std::optional<LcmMessage> takeFragment(const UdpSender& sender, const Header& header, const std::uint8_t* payload,
                                         std::size_t size);
  Place unfinishedOf(const UdpSender& sender, const Header& header);
  std::optional<LcmMessage> joined(const Unfinished& whole);
  void drop(Place place);

  Wanted wanted_;
  std::list<Unfinished> unfinished_;  // The one whose last fragment came first is in front.
  std::size_t unfinished_bytes_ = 0;
  std::int64_t refused_ = 0;
};

}  // namespace angio::messaging
