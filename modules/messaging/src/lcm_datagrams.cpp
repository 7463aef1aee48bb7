// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/lcm_datagrams.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "angio/base/big_endian.hpp"

namespace angio::messaging {
namespace {

// All numbers are big-endian. Both headers begin with a magic word and the message's sequence number (32 bit each). A
// long one goes on with the message's size and the fragment's offset in it (32 bit), the fragment's number and how many
// fragments there are (16 bit). The channel, ended by a NUL, stands behind a short header and behind that of fragment
// 0.
constexpr std::uint32_t kMagicShort = 0x4c433032, kMagicLong = 0x4c433033;
constexpr std::size_t kShortHeader_bytes = 8, kLongHeader_bytes = 20;

// Bookkeeping of one fragment, so that many small ones are bounded as well.
constexpr std::size_t kFragmentCost_bytes = 128;

// The channel at the beginning of a payload; nothing when it is empty, too long or has no end.
std::optional<std::string> channelOf(const std::uint8_t* payload, std::size_t size) {
  const std::uint8_t* const behind = payload + std::min(size, LcmDatagrams::kMaxChannel_bytes + 1);
  const std::uint8_t* const end = std::find(payload, behind, 0);
  if (end == behind || end == payload) return std::nullopt;
  return std::string(payload, end);
}

}  // namespace

std::string UdpSender::text() const {
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8) {
    text += std::to_string(address >> shift & 0xff) + (shift > 0 ? "." : ":");
  }
  return text + std::to_string(port);
}

std::optional<LcmMessage> LcmDatagrams::refuse() {
  ++refused_;
  return std::nullopt;
}

std::optional<LcmMessage> LcmDatagrams::take(const UdpSender& sender, const std::uint8_t* datagram, std::size_t size) {
  if (size < kShortHeader_bytes) return refuse();
  const auto magic = bigEndian<std::uint32_t>(datagram);
  if (magic == kMagicShort) return takeShort(sender, datagram + kShortHeader_bytes, size - kShortHeader_bytes);
  if (magic != kMagicLong || size < kLongHeader_bytes) return refuse();
  Header header{};
  header.sequence = bigEndian<std::uint32_t>(datagram + 4);
  header.message_bytes = bigEndian<std::uint32_t>(datagram + 8);
  header.offset = bigEndian<std::uint32_t>(datagram + 12);
  header.number = bigEndian<std::uint16_t>(datagram + 16);
  header.fragments = bigEndian<std::uint16_t>(datagram + 18);
  return takeFragment(sender, header, datagram + kLongHeader_bytes, size - kLongHeader_bytes);
}

std::optional<LcmMessage> LcmDatagrams::takeShort(const UdpSender& sender, const std::uint8_t* payload,
                                                  std::size_t size) {
  const auto channel = channelOf(payload, size);
  if (!channel) return refuse();
  if (!wanted_(*channel)) return std::nullopt;
  return LcmMessage{sender, *channel, {payload + channel->size() + 1, payload + size}};
}

std::optional<LcmMessage> LcmDatagrams::takeFragment(const UdpSender& sender, const Header& header,
                                                     const std::uint8_t* payload, std::size_t size) {
  const bool first = header.number == 0;
  std::string channel;
  if (first) {
    auto found = channelOf(payload, size);
    if (!found) return refuse();
    channel = std::move(*found);
    payload += channel.size() + 1;
    size -= channel.size() + 1;
  }
  // Only the first fragment may be empty, and it is the one that begins at 0.
  const bool sound = header.message_bytes <= kMaxMessage_bytes && header.number < header.fragments &&
                     header.fragments - 1u <= header.message_bytes && (first ? header.offset == 0 : size > 0) &&
                     header.offset <= header.message_bytes && size <= header.message_bytes - header.offset;
  if (!sound) return refuse();

  const Place place = unfinishedOf(sender, header);
  if (first && place->channel.empty()) {
    place->unwanted = !wanted_(channel);
    place->channel = std::move(channel);
  }
  if (place->unwanted) {
    unfinished_bytes_ -= std::exchange(place->held_bytes, 0);
    place->fragments.clear();
    return std::nullopt;
  }
  // Of a fragment that comes twice, the first one counts.
  if (!place->fragments.try_emplace(header.number, Fragment{header.offset, {payload, payload + size}}).second) {
    return std::nullopt;
  }
  place->held_bytes += size + kFragmentCost_bytes;
  unfinished_bytes_ += size + kFragmentCost_bytes;
  if (place->fragments.size() == header.fragments) {
    auto whole = joined(*place);
    drop(place);
    return whole;
  }
  while (unfinished_bytes_ > kMaxUnfinished_bytes) drop(unfinished_.begin());
  return std::nullopt;
}

// Comes last in the list. A message that another one of the same sender replaces lost a fragment on its way.
LcmDatagrams::Place LcmDatagrams::unfinishedOf(const UdpSender& sender, const Header& header) {
  auto place = std::find_if(unfinished_.begin(), unfinished_.end(),
                            [&](const Unfinished& unfinished) { return unfinished.sender == sender; });
  if (place != unfinished_.end()) {
    const Header& begun = place->header;
    if (begun.sequence == header.sequence && begun.message_bytes == header.message_bytes &&
        begun.fragments == header.fragments) {
      unfinished_.splice(unfinished_.end(), unfinished_, place);
      return place;
    }
    drop(place);
  }
  while (unfinished_.size() >= kMaxUnfinished) drop(unfinished_.begin());
  Unfinished begun;
  begun.sender = sender;
  begun.header = header;
  unfinished_.push_back(std::move(begun));
  return std::prev(unfinished_.end());
}

// The fragments must follow each other without gap or overlap, up to the message's size.
std::optional<LcmMessage> LcmDatagrams::joined(const Unfinished& whole) {
  std::size_t end = 0;
  for (const auto& [number, fragment] : whole.fragments) {
    if (fragment.offset != end) return refuse();
    end += fragment.bytes.size();
  }
  if (end != whole.header.message_bytes) return refuse();
  LcmMessage message{whole.sender, whole.channel, {}};
  message.bytes.reserve(end);
  for (const auto& [number, fragment] : whole.fragments) {
    message.bytes.insert(message.bytes.end(), fragment.bytes.begin(), fragment.bytes.end());
  }
  return message;
}

void LcmDatagrams::drop(Place place) {
  unfinished_bytes_ -= place->held_bytes;
  unfinished_.erase(place);
}

}  // namespace angio::messaging
