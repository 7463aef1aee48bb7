// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
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

/// Keeps the newest message of a channel; filled by Bus::handle().
///
/// Newer is what has a higher sequence. A lower one is newer only if its time is later too: then its sender has started
/// again, and must not go unheard. Duplicates and late ones are dropped and counted.
template <typename T>
class LatestMessage {
 public:
  /// Throws InputError as Bus::subscribe() does. May end before or after the bus.
  LatestMessage(Bus& bus, const std::string& channel) : box_(std::make_shared<Box>()) {
    bus.subscribe(channel, [box = box_](const std::uint8_t* data, std::size_t size) { box->put(data, size); });
  }
  LatestMessage(const LatestMessage&) = delete;
  LatestMessage& operator=(const LatestMessage&) = delete;

  /// The newest message, or nothing when none has come yet or it was taken.
  const std::optional<T>& peek() const { return box_->value; }

  /// The same, and leaves the box empty until a newer message comes.
  std::optional<T> take() { return std::exchange(box_->value, std::nullopt); }

  std::int64_t received() const { return box_->received; }  ///< Messages on the channel, good or not.
  std::int64_t dropped() const { return box_->dropped; }    ///< Duplicates and late ones among them.
  std::int64_t refused() const { return box_->refused; }    ///< Those among them that could not be decoded.

  /// Why the last refused message was refused; empty when none was.
  const std::string& lastError() const { return box_->last_error; }

 private:
  struct Box {
    std::optional<T> value;
    std::optional<std::pair<std::int64_t, std::int64_t>> newest;  // Sequence and time, kept when the value is taken.
    std::int64_t received = 0, dropped = 0, refused = 0;
    std::string last_error;

    void put(const std::uint8_t* data, std::size_t size) {
      ++received;
      Decoded<T> decoded = decode<T>(data, size);
      if (!decoded.value) {
        ++refused;
        last_error = std::move(decoded.error);
        return;
      }
      const std::pair<std::int64_t, std::int64_t> now(sequenceOf(*decoded.value), decoded.value->time_us);
      const bool newer =
          !newest || now.first > newest->first || (now.first < newest->first && now.second > newest->second);
      if (!newer) {
        ++dropped;
        return;
      }
      newest = now;
      value = std::move(decoded.value);
    }
  };

  std::shared_ptr<Box> box_;  // Shared with the bus's handler, which may outlive this object.
};

/// Keeps all messages of a channel that can be decoded, in the order of their arrival, until they are taken:
/// LatestMessage would lose an emergency stop behind what came after it.
template <typename T>
class MessageQueue {
 public:
  /// Throws InputError as Bus::subscribe() does. May end before or after the bus.
  MessageQueue(Bus& bus, const std::string& channel) : values_(std::make_shared<std::vector<T>>()) {
    bus.subscribe(channel, [values = values_](const std::uint8_t* data, std::size_t size) {
      Decoded<T> decoded = decode<T>(data, size);
      if (decoded.value) values->push_back(std::move(*decoded.value));
    });
  }
  MessageQueue(const MessageQueue&) = delete;
  MessageQueue& operator=(const MessageQueue&) = delete;

  /// What has come since the last call.
  std::vector<T> take() { return std::exchange(*values_, {}); }

 private:
  std::shared_ptr<std::vector<T>> values_;  // Shared with the bus's handler, which may outlive this object.
};

/// A message, and who sent it (Bus::sender()).
template <typename T>
struct Heard {
  T value;
  std::string sender;
};

/// The same as MessageQueue, with each message's sender.
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
  std::shared_ptr<std::vector<Heard<T>>> heard_;
};

}  // namespace angio::messaging
