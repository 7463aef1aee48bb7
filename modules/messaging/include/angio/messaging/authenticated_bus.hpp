// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/bus.hpp"

namespace angio::messaging {

/// The key that programs on one bus share: the bytes of a file, 32 to 4096 of them. Throws InputError that names the
/// file when it cannot be read, has another size, or others than its owner may read or write it.
std::vector<std::uint8_t> readKeyFile(const std::string& path);

/// Whether a channel's messages go in an envelope when there is a key: commands, requests, statuses and sessions, and
/// what else can move a machine (VIEW_REQUEST, REGISTRATION, CATHETER_TIP). Images and states do not.
bool isAuthenticated(const std::string& channel);

/// Whether bytes begin as an envelope does; by whom it is, nobody has looked at.
bool isEnvelope(const std::uint8_t* data, std::size_t size);

/// One line of warning when a bus reaches beyond this machine (ttl above 0) and there is no key; nothing otherwise.
std::optional<std::string> unprotectedWarning(const std::string& url, const std::string& key_path);

/// A bus on which only programs with the same key command each other. On the channels of isAuthenticated(), it sends
/// each message in an envelope, and hands out only those messages whose envelope is valid, without it; all other
/// channels are as they are. A recorder belongs outside of it: logs hold plain messages.
///
/// The envelope, numbers big-endian:
///
///   bytes 0-7    "ANGIOHM" and the version, 1;
///   bytes 8-15   session: drawn at random by each sender;
///   bytes 16-23  counter: microseconds since 1970, or one more than the sender's last one if that is more;
///   bytes 24-55  HMAC-SHA256, by the key, of: bytes 0-23, the channel's name, a NUL, the message;
///   bytes 56-    the message.
///
/// A receiver takes each counter of a session once, in any order among the last 256. It takes no counter from before it
/// began to listen, nor one more than 5 s from its own clock: the clocks of the hosts must agree to that. So no message
/// that was recorded, whenever, is taken again.
class AuthenticatedBus : public Bus {
 public:
  /// Hears why messages are refused, in one line; each cause once.
  using Tell = std::function<void(const std::string& line)>;

  /// The time [us] since 1970.
  using Clock = std::function<std::int64_t()>;

  static constexpr std::int64_t kMaxAge_us = 5'000'000;

  /// Throws std::invalid_argument when the key has less than 32 bytes.
  AuthenticatedBus(std::unique_ptr<Bus> bus, std::vector<std::uint8_t> key, Tell tell = {},
                   Clock clock = systemTime_us);
  ~AuthenticatedBus() override;
  AuthenticatedBus(const AuthenticatedBus&) = delete;
  AuthenticatedBus& operator=(const AuthenticatedBus&) = delete;

  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override;
  void subscribe(const std::string& channel, Handler handler) override;
  void subscribeAll(Listener listener) override;
  void overhear(const std::string& channel, Handler handler) override;
  std::string sender() const override { return bus_->sender(); }
  int handle(std::chrono::milliseconds timeout) override { return bus_->handle(timeout); }
  bool ended() const override { return bus_->ended(); }
  std::int64_t refused() const override { return bus_->refused() + unauthenticated(); }

  /// How many messages had no valid envelope so far, by cause: "no envelope", "another key", "replayed", ...
  const std::map<std::string, std::int64_t>& causes() const { return causes_; }

  /// How many they were together.
  std::int64_t unauthenticated() const;

  static std::int64_t systemTime_us();

 private:
  class Ear;

  void refuse(const std::string& channel, const char* cause, bool counts);
  std::vector<std::uint8_t> tagOf(const std::uint8_t* head, const std::string& channel, const std::uint8_t* data,
                                  std::size_t size) const;

  std::unique_ptr<Bus> bus_;
  const std::vector<std::uint8_t> key_;
  const Tell tell_;
  const Clock clock_;
  const std::int64_t began_us_;
  const std::uint64_t session_;
  std::int64_t counter_ = 0;
  std::map<std::string, std::int64_t> causes_;
  std::map<std::string, std::shared_ptr<Ear>> channels_;  // Of those that were subscribed to by name.
  std::vector<std::shared_ptr<Ear>> others_;
};

/// The bus of a program: as it is, or authenticated when there is a key file. `tell` hears lines for people. Throws as
/// readKeyFile() does.
std::unique_ptr<Bus> withKeyFile(std::unique_ptr<Bus> bus, const std::string& key_path, AuthenticatedBus::Tell tell);

}  // namespace angio::messaging
