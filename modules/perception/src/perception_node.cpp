// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/perception_node.hpp"

#include <utility>

#include "angio/types/channels.hpp"

namespace angio::perception {

PerceptionNode::PerceptionNode(Bus& bus, const GatedPerceptionSettings& settings, const VesselTree& tree)
    : bus_(bus), frames_(bus, kXrayFrameChannel), joints_(bus, kCArmStateChannel), perception_(settings, tree) {}

std::optional<PerceptionReport> PerceptionNode::observe() {
  if (joints_.empty()) return std::nullopt;
  const auto frame = frames_.take();
  if (!frame) return std::nullopt;
  const CArmState state = *joints_.at(frame->time_us);
  PerceptionReport report;
  report.frame_sequence = frame->sequence;
  report.rejection = perception_.rejection(*frame, state);
  if (report.rejection) return report;
  GatedObservation gated = perception_.observe(*frame, state);
  report.observation = std::move(gated.observation);
  report.rejection = std::move(gated.rejection);
  report.message = registrationMessage(report.observation.registration, report.observation.model_id, frame->time_us,
                                       frame->sequence);
  publish(bus_, kRegistrationChannel, *report.message);
  perception_.learn();
  return report;
}

}  // namespace angio::perception
