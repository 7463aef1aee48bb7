// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/perception_node.hpp"

#include "angio/messaging/channels.hpp"

namespace angio {

PerceptionNode::PerceptionNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree)
    : bus_(bus),
      frames_(bus, kXrayFrameChannel),
      joints_(bus, kCArmStateChannel),
      perception_(settings.perceptionForTask(), settings.carm, settings.T_dsa_cb, tree),
      supervisor_(settings.supervisor, settings.limits, settings.target_model.value_or(tree.centroid()),
                  targetNeed(settings.task)) {}

std::optional<PerceptionReport> PerceptionNode::look() {
  if (joints_.empty()) return std::nullopt;
  const auto frame = frames_.take();
  if (!frame) return std::nullopt;
  const CArmState state = *joints_.at(frame->time_us);
  PerceptionReport report;
  report.doubted = supervisor_.objection(*frame, state);
  if (!report.doubted) {
    report.sight = perception_.look(*frame, state);
    const Sight& sight = report.sight;
    report.doubted =
        supervisor_.objection(sight.registration, perception_.calibrated_T_camera_model(state.joints),
                              sight.tracked ? std::optional(sight.predicted.T_camera_model) : std::nullopt);
    if (report.doubted) {
      perception_.doubt();
    } else {
      perception_.trust(sight, state);
    }
  }
  report.message =
      registrationMessage(report.sight.registration, report.sight.model_id, frame->time_us, frame->sequence);
  publish(bus_, kRegistrationChannel, report.message);
  perception_.learn();
  return report;
}

}  // namespace angio
