// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/catheter_node.hpp"

#include "angio/messaging/channels.hpp"

namespace angio::lab {

SimulatedCatheterNode::SimulatedCatheterNode(Bus& bus, const VesselTree& tree, const CatheterSettings& settings,
                                             const TreeLocation& start, std::int64_t now_us)
    : bus_(bus), commands_(bus, kCatheterCommandChannel), catheter_(tree, settings, start, now_us) {}

void SimulatedCatheterNode::listen(std::int64_t now_us) {
  if (const auto command = commands_.take()) catheter_.obey(*command, now_us);
}

void SimulatedCatheterNode::report(std::int64_t now_us) {
  catheter_.advance(now_us);
  CatheterState state = catheter_.state();
  state.sequence = ++sequence_;
  publish(bus_, kCatheterStateChannel, state);
}

}  // namespace angio::lab
