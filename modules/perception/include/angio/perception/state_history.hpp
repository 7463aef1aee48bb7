// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "angio/messaging/bus.hpp"
#include "angio/perception/namespace.hpp"
#include "angio/types/any_message.hpp"

namespace angio::perception {

/// Where a machine was while a frame was exposed. A frame is read with the state of its own time: at 25 deg/s the
/// newest one is degrees away, and a tracker would take that for the patient. Of CArmState and of CatheterState.
template <typename State>
class StateHistory {
 public:
  /// Remembers the states on a channel, filled by Bus::handle(). Throws InputError as Bus::subscribe() does.
  StateHistory(Bus& bus, const std::string& channel);
  StateHistory(const StateHistory&) = delete;
  StateHistory& operator=(const StateHistory&) = delete;

  bool empty() const { return box_->states.empty(); }

  /// The state at a time [us]: linear between two states up to 100 ms apart, else the nearest one, whose own time says
  /// how far off it is. Nothing when no state has come yet.
  std::optional<State> at(std::int64_t time_us) const;

  /// The last one; nothing when no state has come yet.
  std::optional<State> newest() const { return empty() ? std::nullopt : std::optional(box_->states.back()); }

  /// Begins again, with whatever comes next: the machine's clock may have been set back.
  void forget() { box_->states.clear(); }

  std::int64_t refused() const { return box_->refused; }  ///< Messages that could not be decoded.

 private:
  struct Box {
    std::deque<State> states;  // By time, oldest first.
    std::int64_t refused = 0;
    void put(const std::uint8_t* data, std::size_t size);
  };
  std::shared_ptr<Box> box_;  // Shared with the bus's handler, which may outlive this object.
};

extern template class StateHistory<CArmState>;
extern template class StateHistory<CatheterState>;

using JointHistory = StateHistory<CArmState>;
using DriveHistory = StateHistory<CatheterState>;

}  // namespace angio::perception
