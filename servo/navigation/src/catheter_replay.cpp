// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_replay.hpp"

#include <memory>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/messaging/logged_frames.hpp"

namespace angio {
namespace {

// What a log holds, its images left where they are.
struct Contents {
  LoggedFrames frames;
  std::vector<CatheterInput> inputs;
  ByFrame<CatheterCommand> answers;  // The first of each frame.
  ReplaySummary summary;             // As far as it is known by then.
};

Contents readContents(LogReader& log) {
  Contents c;
  for (auto event = log.next(); event; event = log.next()) {
    c.frames.enter(*event);
    if (event->channel == kCatheterInputChannel) {
      const auto input = decode<CatheterInput>(event->bytes.data(), event->bytes.size());
      if (input.value) c.inputs.push_back(*input.value);
    } else if (event->channel == kCatheterCommandChannel) {
      const auto command = decode<CatheterCommand>(event->bytes.data(), event->bytes.size());
      if (!command.value) continue;
      ++c.summary.commands;
      c.answers.emplace(frameOf(*command.value), *command.value);
    }
  }
  c.summary.frames = static_cast<std::int64_t>(c.frames.all().size());
  c.summary.skipped_bytes = log.skipped_bytes();
  c.summary.knew_inputs = true;
  return c;
}

CatheterGuideReport answerAsThen(CatheterGuide& guide, const XrayFrame& frame, const CatheterInput& input) {
  if (input.verdict == ServoVerdict::kRefused) return guide.refuse(frame, "refused by the supervisor");
  CatheterGuideReport report = guide.step(frame, input.arm, input.drive);
  if (input.verdict == ServoVerdict::kTakenBack) CatheterGuide::takeBack(report, "taken back by the supervisor");
  return report;
}

}  // namespace

std::optional<std::string> difference(const CatheterCommand& replayed, const CatheterCommand& logged) {
  if (auto d = differenceInName(replayed, logged)) return d;
  if (auto d = difference("insertion_speed", replayed.insertion_speed_mps, logged.insertion_speed_mps)) return d;
  if (auto d = difference("roll_speed", replayed.roll_speed_radps, logged.roll_speed_radps)) return d;
  return difference("bend_speed", replayed.bend_speed_radps, logged.bend_speed_radps);
}

ReplaySummary replayCatheter(const std::string& log_path, const CatheterStage& stage, const VesselTree& tree,
                             const TreePlace& start, const TreePlace& target, const CatheterGuideSettings& settings,
                             const CatheterReplayWatcher& watcher) {
  LogReader log(log_path);
  Contents contents = readContents(log);
  ReplaySummary& summary = contents.summary;
  std::unique_ptr<CatheterGuide> guide;
  double done = 0;
  for (const CatheterInput& input : contents.inputs) {
    const double part = ++done / static_cast<double>(contents.inputs.size());
    const std::string name = "frame " + std::to_string(input.frame_sequence);
    const auto place = contents.frames.position_bytes(frameOf(input));
    if (!place) {
      summary.differs(name + " was answered, and is not in the log");
      continue;
    }
    const auto logged = of(frameOf(input), contents.answers);
    if (!guide || (logged && logged->sequence == 1)) {
      guide = std::make_unique<CatheterGuide>(stage, tree, start, target, settings);
    }
    const CatheterGuideReport report = answerAsThen(*guide, LoggedFrames::readAt(log, *place), input);
    ++summary.answered;
    summary.held += report.held.has_value();
    if (logged) summary.compare(name, difference(report.command, *logged));
    if (watcher) watcher({report, logged, part});
  }
  summary.finish();
  if (summary.answered == 0) {
    throw InputError(log_path, "", "",
                     "holds no X-ray frame that a catheter's loop has answered: needs " +
                         std::string(kXrayFrameChannel) + " and " + kCatheterInputChannel);
  }
  return summary;
}

}  // namespace angio
