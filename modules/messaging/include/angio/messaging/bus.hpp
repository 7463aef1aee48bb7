// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

/// Carries bytes between programs by named channels. To be used from one thread.
class Bus {
 public:
  /// Is given the message's bytes; they are valid during the call only. A handler may publish, but must not call
  /// handle().
  using Handler = std::function<void(const std::uint8_t* data, std::size_t size)>;

  /// The same for whatever comes, with the name of its channel.
  using Listener = std::function<void(const std::string& channel, const std::uint8_t* data, std::size_t size)>;

  virtual ~Bus() = default;

  /// Sends bytes to every subscriber of the channel. Throws std::runtime_error when they cannot be sent: on UDP
  /// multicast, a channel has 1 to 63 characters and a message at most 48 MiB.
  virtual void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) = 0;

  /// Calls `handler` for each message on the channel of exactly this name, for as long as the bus lives. Throws
  /// InputError when the bus cannot receive.
  virtual void subscribe(const std::string& channel, Handler handler) = 0;

  /// Calls `listener` for each message on any channel, for as long as the bus lives. Throws as subscribe() does.
  virtual void subscribeAll(Listener listener) = 0;

  /// Calls `handler` for each message on the channel that was not published by this object, for as long as the bus
  /// lives. No recorder writes these down. Only buses that know who sent what have such messages: UDP multicast, and a
  /// party's side of a bus in simulated time (DisturbedBus); the others never call it.
  virtual void overhear(const std::string& /*channel*/, Handler /*handler*/) {}

  /// Who sent the message that is being handled, "127.0.0.1:40123"; empty outside a handler, and where the bus does not
  /// know. A program has one address for as long as its bus lives. On a network it can be forged.
  virtual std::string sender() const { return {}; }

  /// Waits up to `timeout` for a message, hands out all that wait, and returns how many there were; a signal ends the
  /// wait early. At most 1,000 messages a call, so that a fast sender cannot keep the caller for ever. A log (file://)
  /// gives one message a call, so that a reader who looks at its mailboxes between calls misses none.
  ///
  /// While nobody calls it, a bus on UDP multicast keeps the newest 30 messages of each channel that was subscribed to
  /// by name, the newest 100 of all others, and 64 MiB in all; older ones are dropped.
  ///
  /// When a handler throws, the first exception comes out here, after all handlers of its message have run; messages
  /// behind it wait for the next call. Throws std::runtime_error when receiving fails.
  virtual int handle(std::chrono::milliseconds timeout) = 0;

  /// Whether a log has been read to its end. Never on a live bus.
  virtual bool ended() const = 0;

  /// How many malformed messages or datagrams came so far; they are handed to nobody.
  virtual std::int64_t refused() const = 0;
};

/// Opens a bus:
///   "memq://"                       inside this process, private to the returned object;
///   "udpm://239.255.76.67:7667?ttl=0"  UDP multicast on this machine (ttl=1: on the local network). Unless the URL
///   says so itself,
///                                   its receive buffer is made large enough for 1024 x 1024 images of 16 bit;
///   "file://name.lcm?speed=0"       a recorded log, as fast as it is read (speed=1: as it was recorded);
///   "file://name.lcm?mode=w"        records what is published, and receives nothing.
/// Throws InputError that names the URL and the rule when it cannot be opened.
std::unique_ptr<Bus> openBus(const std::string& url);

/// The same for a program that talks with others: a bus that is private to one is refused.
std::unique_ptr<Bus> openSharedBus(const std::string& url);

/// Why large messages may be lost on a bus that has been opened: the system allows smaller receive buffers than a frame
/// of 1024 x 1024 pixels needs. Nothing when it allows enough, or does not say.
std::optional<std::string> receiveBufferWarning(const std::string& url);

}  // namespace angio::messaging
