// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/bus.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// Whether one channel's messages come from two senders at a time, where there must be one. A sender that takes over
/// from one that has ended is no second one.
class SenderWatch {
 public:
  /// A message of a named sender has come. Returns "A and B" when two senders send in turns: the other one spoke at
  /// most 150 ms ago, or this one comes again within 2 s. Two that share an address, "both from A", are told apart by
  /// their numbers and times, which contradict each other three times in 1 s; what is late or comes twice contradicts
  /// nothing, nor does a number that stands still. A message without a sender says nothing.
  ///
  /// @param time_us  The message's own time, its sender's clock [us].
  /// @param now_us   The caller's clock [us].
  std::optional<std::string> hear(const std::string& sender, std::int64_t sequence, std::int64_t time_us,
                                  std::int64_t now_us);

 private:
  bool contradicts(std::int64_t sequence, std::int64_t time_us) const;

  std::map<std::string, std::int64_t> heard_us_;  // By sender: when it spoke last.
  std::string last_sender_;
  std::int64_t last_sequence_ = 0, last_time_us_ = 0;
  int repeats_ = 0;  // Of one number in a row, each with another time.
  std::vector<std::int64_t> contradicted_us_;
};

/// Hears on a loop's bus whether anybody else speaks where one program must: on its own command and status channels,
/// and as a second one on the channels of its machines and its X-ray. Its own messages, as they come round, do not
/// count.
class SecondSenders {
 public:
  enum class Kind { kCommands, kStatuses, kMachine };
  /// A channel that one sender at most may speak on.
  struct Watched {
    const char* channel;
    Kind kind;
    std::string what;  ///< "C-arm commands", "loops", "C-arms".
  };

  /// Borrows the bus. Throws InputError as Bus::subscribe() does.
  SecondSenders(Bus& bus, std::vector<Watched> watched);
  SecondSenders(const SecondSenders&) = delete;
  SecondSenders& operator=(const SecondSenders&) = delete;

  /// What was heard since the last call, in words with the senders' addresses and what to do: a second loop, if there
  /// is one, or the first of the others. "two C-arms on CARM_STATE: 10.0.0.1:4000 and 10.0.0.2:4000: stop one".
  /// @param now_us  The caller's clock [us].
  std::optional<std::string> take(std::int64_t now_us);

  /// Begins anew, with whatever comes next.
  void forget();

 private:
  struct Event {
    std::size_t watched;
    std::string sender;
    std::int64_t sequence, time_us;
  };

  std::vector<Watched> watched_;
  std::vector<SenderWatch> watches_;            // One for each watched channel.
  std::shared_ptr<std::vector<Event>> events_;  // Shared with the bus's handlers, which may outlive this object.
};

}  // namespace angio::servo
