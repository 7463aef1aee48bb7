// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "angio/messaging/bus.hpp"
#include "angio/messaging/codec.hpp"

namespace angio::messaging {

/// Encodes and sends one message. Throws as encode() and Bus::publish() do; then nothing was sent.
template <typename T>
void publish(Bus& bus, const std::string& channel, const T& message) {
  bus.publish(channel, encode(message));
}

namespace wire {
template <typename Message>
auto sequenceOf(const Message& m, int) -> decltype(m.sequence) {
  return m.sequence;
}
template <typename Message>
auto sequenceOf(const Message& m, long) -> decltype(m.frame_sequence) {
  return m.frame_sequence;
}
}  // namespace wire

/// The number that orders the messages of one sender: their own, or the frame's if they have none.
template <typename Message>
std::int64_t sequenceOf(const Message& message) {
  return wire::sequenceOf(message, 0);
}

/// What a receiver has heard on its channel, to say why nothing can be done with it.
struct ChannelRecord {
  std::string channel;
  std::int64_t received = 0;            ///< Messages, good or not.
  std::string sender;                   ///< Of the newest message (Bus::sender()); empty: unknown, or none has come.
  std::int64_t dropped_in_a_row = 0;    ///< Duplicates and late ones since the newest message.
  std::int64_t refused_in_a_row = 0;    ///< Messages that could not be decoded since the last one that could.
  std::string refused_sender, refused;  ///< Who sent the last message that could not be decoded, and why it could not.
};

/// Keeps the newest message of a channel; filled by Bus::handle().
///
/// Newer is what has a higher sequence. A lower one is newer only if its time is later too: then its sender has started
/// again, and must not go unheard. Duplicates and late ones are dropped and counted; a status of the same frame is none
/// unless its transitions are fewer.
template <typename T>
class LatestMessage {
 public:
  /// Throws InputError as Bus::subscribe() does. May end before or after the bus, which must live while it hands out
  /// messages.
  LatestMessage(Bus& bus, const std::string& channel) : box_(std::make_shared<Box>()) {
    box_->record.channel = channel;
    bus.subscribe(channel, [&bus, kept = std::weak_ptr(box_)](const std::uint8_t* data, std::size_t size) {
      if (const auto box = kept.lock()) box->put(data, size, bus);
    });
  }
  LatestMessage(const LatestMessage&) = delete;
  LatestMessage& operator=(const LatestMessage&) = delete;

  /// The newest message, or nothing when none has come yet or it was taken.
  const std::optional<T>& peek() const { return box_->value; }

  /// The same, and leaves the box empty until a newer message comes.
  std::optional<T> take() { return std::exchange(box_->value, std::nullopt); }

  std::int64_t received() const { return box_->record.received; }  ///< Messages on the channel, good or not.
  std::int64_t dropped() const { return box_->dropped; }           ///< Duplicates and late ones among them.
  std::int64_t refused() const { return box_->refused; }           ///< Those among them that could not be decoded.

  /// Why the last refused message was refused; empty when none was.
  const std::string& lastError() const { return box_->record.refused; }

  const ChannelRecord& record() const { return box_->record; }

 private:
  struct Box {
    std::optional<T> value;
    std::optional<std::pair<std::int64_t, std::int64_t>> newest;  // Sequence and time, kept when the value is taken.
    std::int64_t transitions = 0;  // The newest one's, of a status: it may change several times between two frames.
    std::int64_t dropped = 0, refused = 0;
    ChannelRecord record;

    void put(const std::uint8_t* data, std::size_t size, const Bus& bus) {
      ++record.received;
      Decoded<T> decoded = decode<T>(data, size);
      if (!decoded.value) {
        ++refused;
        ++record.refused_in_a_row;
        record.refused = std::move(decoded.error);
        record.refused_sender = bus.sender();
        return;
      }
      record.refused_in_a_row = 0;
      const std::pair<std::int64_t, std::int64_t> now(sequenceOf(*decoded.value), decoded.value->time_us);
      std::int64_t of_this = -1;
      if constexpr (std::is_same_v<T, ServoStatus>) of_this = decoded.value->transitions;
      const bool newer = !newest || now.first > newest->first ||
                         (now.first < newest->first && now.second > newest->second) ||
                         (now == *newest && of_this >= transitions);
      if (!newer) {
        ++dropped;
        ++record.dropped_in_a_row;
        return;
      }
      newest = now;
      transitions = std::max<std::int64_t>(of_this, 0);
      record.dropped_in_a_row = 0;
      record.sender = bus.sender();
      value = std::move(decoded.value);
    }
  };

  std::shared_ptr<Box> box_;  // Shared with the bus's handler, which may outlive this object.
};

/// A message, and who sent it (Bus::sender()).
template <typename T>
struct Heard {
  T value;
  std::string sender;
};

/// Keeps all messages of a channel that can be decoded, each with its sender, in the order of their arrival, until they
/// are taken: LatestMessage would lose an emergency stop behind what came after it.
template <typename T>
class HeardMessages {
 public:
  /// Throws InputError as Bus::subscribe() does. The bus must live while it hands out messages.
  HeardMessages(Bus& bus, const std::string& channel) : heard_(std::make_shared<std::vector<Heard<T>>>()) {
    bus.subscribe(channel, [&bus, box = std::weak_ptr(heard_)](const std::uint8_t* data, std::size_t size) {
      const auto heard = box.lock();
      if (!heard) return;
      Decoded<T> decoded = decode<T>(data, size);
      if (decoded.value) heard->push_back({std::move(*decoded.value), bus.sender()});
    });
  }
  HeardMessages(const HeardMessages&) = delete;
  HeardMessages& operator=(const HeardMessages&) = delete;

  /// What has come since the last call, in its order.
  std::vector<Heard<T>> take() { return std::exchange(*heard_, {}); }

 private:
  std::shared_ptr<std::vector<Heard<T>>> heard_;  // Shared with the bus's handler, which may outlive this object.
};

/// The same without the senders.
template <typename T>
class MessageQueue {
 public:
  MessageQueue(Bus& bus, const std::string& channel) : heard_(bus, channel) {}

  std::vector<T> take() {
    std::vector<T> values;
    for (Heard<T>& heard : heard_.take()) values.push_back(std::move(heard.value));
    return values;
  }

 private:
  HeardMessages<T> heard_;
};

}  // namespace angio::messaging
