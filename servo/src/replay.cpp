// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/replay.hpp"

#include <cstring>
#include <memory>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/messaging/codec.hpp"
#include "angio/messaging/logged_frames.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/servo/state_history.hpp"

namespace angio {
namespace {

// What a log holds, its images left where they are.
struct Contents {
  LoggedFrames frames;
  std::vector<ServoInput> inputs;
  std::vector<CArmCommand> commands;
  ByFrame<CArmCommand> answers;                                            // The first of each frame.
  ByFrame<RegistrationMessage> registrations;                              // The same.
  ByFrame<CatheterTip> tips;                                               // The same.
  std::vector<std::pair<std::int64_t, std::vector<std::uint8_t>>> states;  // Places and bytes.
  std::int64_t skipped_bytes = 0;
};

Contents readContents(LogReader& log) {
  Contents c;
  for (auto event = log.next(); event; event = log.next()) {
    const std::uint8_t* data = event->bytes.data();
    const std::size_t size = event->bytes.size();
    c.frames.enter(*event);
    if (event->channel == kServoInputChannel) {
      const auto input = decode<ServoInput>(data, size);
      if (input.value) c.inputs.push_back(*input.value);
    } else if (event->channel == kCArmCommandChannel) {
      const auto command = decode<CArmCommand>(data, size);
      if (!command.value) continue;
      c.commands.push_back(*command.value);
      c.answers.emplace(frameOf(*command.value), *command.value);
    } else if (event->channel == kRegistrationChannel) {
      const auto seen = decode<RegistrationMessage>(data, size);
      if (seen.value) c.registrations.emplace(frameOf(*seen.value), *seen.value);
    } else if (event->channel == kCatheterTipChannel) {
      const auto tip = decode<CatheterTip>(data, size);
      if (tip.value) c.tips.emplace(frameOf(*tip.value), *tip.value);
    } else if (event->channel == kCArmStateChannel) {
      c.states.emplace_back(event->position_bytes, event->bytes);
    }
  }
  c.skipped_bytes = log.skipped_bytes();
  return c;
}

// The inputs of a log that does not name them.
std::vector<ServoInput> guessedInputs(const Contents& c) {
  std::vector<LoggedFrames::Entry> frames;
  for (const CArmCommand& command : c.commands) {
    if (const auto place = c.frames.position_bytes(frameOf(command))) frames.push_back({frameOf(command), *place});
  }
  if (frames.empty()) frames = c.frames.all();
  const auto bus = openBus("memq://");
  const JointHistory joints(*bus, kCArmStateChannel);
  std::vector<ServoInput> inputs;
  auto state = c.states.begin();
  for (const auto& [name, place] : frames) {
    for (; state != c.states.end() && state->first < place; ++state) {
      bus->publish(kCArmStateChannel, state->second);
      bus->handle(std::chrono::milliseconds(0));
    }
    if (const auto at = joints.at(name.second)) inputs.push_back({name.second, name.first, *at});
  }
  return inputs;
}

// One way through the frames of a log.
class Pass {
 public:
  Pass(LogReader& log, const Contents& contents, const ServoLoopSettings& settings, const VesselTree& tree)
      : log_(log), contents_(contents), settings_(settings), tree_(tree) {
    summary.frames = static_cast<std::int64_t>(contents.frames.all().size());
    summary.commands = static_cast<std::int64_t>(contents.commands.size());
    summary.skipped_bytes = contents.skipped_bytes;
    summary.knew_inputs = !contents.inputs.empty();
  }

  void answer(const ServoInput& input, double part, const ReplayWatcher& watcher) {
    const std::string name = "frame " + std::to_string(input.frame_sequence);
    const auto place = contents_.frames.position_bytes(frameOf(input));
    if (!place) return summary.differs(name + " was answered, and is not in the log");
    const auto logged = of(frameOf(input), contents_.answers);
    if (!loop_ || (logged && logged->sequence == 1)) loop_ = std::make_unique<ServoLoop>(settings_, tree_);
    const XrayFrame frame = LoggedFrames::readAt(log_, *place);
    const ServoReport report = answerAsThen(frame, input);
    loop_->learn();
    ++summary.answered;
    summary.held += report.held.has_value();
    if (logged) summary.compare(name, difference(report.command, *logged));
    if (watcher) watcher({frame, report, logged, part});
  }

  ReplaySummary summary;

 private:
  ServoReport answerAsThen(const XrayFrame& frame, const ServoInput& input) {
    if (input.verdict == ServoVerdict::kRefused) return loop_->refuse(frame, "refused by the supervisor");
    ServoReport report = loop_->step(frame, input.state, seenOf(input));
    if (input.verdict == ServoVerdict::kTakenBack) {
      loop_->takeBack(report, report.held.value_or("taken back by the supervisor"));
    }
    return report;
  }

  // What other programs said of a frame.
  SeenElsewhere seenOf(const ServoInput& input) const {
    return {of(frameOf(input), contents_.registrations), of(frameOf(input), contents_.tips)};
  }

  LogReader& log_;
  const Contents& contents_;
  const ServoLoopSettings& settings_;
  const VesselTree& tree_;
  std::unique_ptr<ServoLoop> loop_;
};

}  // namespace

void ReplaySummary::differs(const std::string& how) {
  if (!first_difference) first_difference = how;
}

void ReplaySummary::compare(const std::string& frame, const std::optional<std::string>& difference) {
  ++compared;
  equal += !difference;
  if (difference) differs(frame + ": " + *difference);
}

void ReplaySummary::finish() {
  if (compared >= commands) return;
  differs(std::to_string(commands - compared) + " commands cannot be compared: what they answer is not in the log");
}

std::optional<std::string> difference(const std::string& field, std::int64_t replayed, std::int64_t logged) {
  if (replayed == logged) return std::nullopt;
  return field + " = " + std::to_string(replayed) + " replayed, " + std::to_string(logged) + " logged";
}

std::optional<std::string> difference(const std::string& field, double replayed, double logged) {
  if (std::memcmp(&replayed, &logged, sizeof(double)) == 0) return std::nullopt;
  return field + formatted(" = %.17g replayed, %.17g logged", replayed, logged);
}

std::optional<std::string> difference(const CArmCommand& replayed, const CArmCommand& logged) {
  if (auto d = differenceInName(replayed, logged)) return d;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const std::string field = "joint_velocity[" + std::to_string(i) + "]";
    if (auto d = difference(field, replayed.velocity[i], logged.velocity[i])) return d;
  }
  return std::nullopt;
}

ReplaySummary replay(const std::string& log_path, const ServoLoopSettings& settings, const VesselTree& tree,
                     const ReplayWatcher& watcher) {
  LogReader log(log_path);
  const Contents contents = readContents(log);
  const std::vector<ServoInput> inputs = contents.inputs.empty() ? guessedInputs(contents) : contents.inputs;
  Pass pass(log, contents, settings, tree);
  double done = 0;
  for (const ServoInput& input : inputs) pass.answer(input, ++done / static_cast<double>(inputs.size()), watcher);
  pass.summary.finish();
  if (pass.summary.answered == 0) {
    throw InputError(log_path, "", "",
                     "holds no X-ray frame with joints: needs " + std::string(kXrayFrameChannel) + " and " +
                         kCArmStateChannel + " or " + kServoInputChannel);
  }
  return pass.summary;
}

}  // namespace angio
