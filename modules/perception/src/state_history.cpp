// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/state_history.hpp"

#include <algorithm>

#include "angio/messaging/codec.hpp"

namespace angio::perception {
namespace {

constexpr std::size_t kMaxStates = 256;
constexpr double kMaxGap_us = 100e3;

// Of two times in their order, exact where doubles of the times themselves would be equal, and where their difference
// does not fit an int64.
double between_us(std::int64_t from, std::int64_t to) {
  return static_cast<double>(static_cast<std::uint64_t>(to) - static_cast<std::uint64_t>(from));
}

// What a state says beside its time and number, so far from one to the other.
CArmState between(const CArmState& a, const CArmState& b, double weight) {
  CArmState state = b;
  state.joints = (1 - weight) * a.joints + weight * b.joints;
  state.velocity = (1 - weight) * a.velocity + weight * b.velocity;
  return state;
}

CatheterState between(const CatheterState& a, const CatheterState& b, double weight) {
  CatheterState state = b;
  for (const auto number : {&CatheterState::insertion_m, &CatheterState::roll_rad, &CatheterState::bend_rad,
                            &CatheterState::insertion_speed_m_per_s, &CatheterState::roll_speed_rad_per_s,
                            &CatheterState::bend_speed_rad_per_s, &CatheterState::insertion_force_n}) {
    state.*number = (1 - weight) * a.*number + weight * b.*number;
  }
  return state;
}

}  // namespace

template <typename State>
StateHistory<State>::StateHistory(Bus& bus, const std::string& channel) : box_(std::make_shared<Box>()) {
  bus.subscribe(channel, [box = box_](const std::uint8_t* data, std::size_t size) { box->put(data, size); });
}

template <typename State>
void StateHistory<State>::Box::put(const std::uint8_t* data, std::size_t size) {
  const auto decoded = decode<State>(data, size);
  if (!decoded.value) {
    ++refused;
    return;
  }
  // A duplicate or late one has nothing to add to a history that is dense.
  if (!states.empty() && decoded.value->time_us <= states.back().time_us) return;
  states.push_back(*decoded.value);
  if (states.size() > kMaxStates) states.pop_front();
}

template <typename State>
std::optional<State> StateHistory<State>::at(std::int64_t time_us) const {
  const auto& states = box_->states;
  if (states.empty()) return std::nullopt;
  const auto after = std::lower_bound(states.begin(), states.end(), time_us,
                                      [](const State& s, std::int64_t t) { return s.time_us < t; });
  if (after == states.begin()) return states.front();
  if (after == states.end()) return states.back();
  const State &a = *std::prev(after), &b = *after;
  const double gap_us = between_us(a.time_us, b.time_us), weight = between_us(a.time_us, time_us) / gap_us;
  if (gap_us > kMaxGap_us) return weight < 0.5 ? a : b;
  State state = between(a, b, weight);
  state.time_us = time_us;
  return state;
}

template class StateHistory<CArmState>;
template class StateHistory<CatheterState>;

}  // namespace angio::perception
