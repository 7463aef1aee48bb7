// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/replay.hpp"

#include <cstring>
#include <map>
#include <memory>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/messaging/codec.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/servo/joint_history.hpp"

namespace angio {
namespace {

// A frame's number alone does not name it: a sender that starts again counts from one.
using FrameKey = std::pair<std::int64_t, std::int64_t>;  // Sequence and time [us].

// What a log holds, its images left where they are.
struct Contents {
  std::vector<std::pair<FrameKey, std::int64_t>> frames;  // In the log's order, with their places in the file.
  std::map<FrameKey, std::int64_t> place;                 // The same by name.
  std::vector<ServoInput> inputs;
  std::vector<CArmCommand> commands;
  std::map<FrameKey, RegistrationMessage> registrations;  // The first of each frame.
  std::map<FrameKey, CatheterTip> tips;
  std::vector<std::pair<std::int64_t, std::vector<std::uint8_t>>> states;  // Places and bytes.
  std::int64_t skipped_bytes = 0;
};

Contents readContents(LogReader& log) {
  Contents c;
  for (auto event = log.next(); event; event = log.next()) {
    const std::uint8_t* data = event->bytes.data();
    const std::size_t size = event->bytes.size();
    if (event->channel == kXrayFrameChannel) {
      const auto frame = decode<XrayFrame>(data, size);
      if (!frame.value) continue;
      const FrameKey key(frame.value->sequence, frame.value->time_us);
      if (c.place.emplace(key, event->position_bytes).second) c.frames.emplace_back(key, event->position_bytes);
    } else if (event->channel == kServoInputChannel) {
      const auto input = decode<ServoInput>(data, size);
      if (input.value) c.inputs.push_back(*input.value);
    } else if (event->channel == kCArmCommandChannel) {
      const auto command = decode<CArmCommand>(data, size);
      if (command.value) c.commands.push_back(*command.value);
    } else if (event->channel == kRegistrationChannel) {
      const auto seen = decode<RegistrationMessage>(data, size);
      if (seen.value) c.registrations.emplace(FrameKey(seen.value->frame_sequence, seen.value->time_us), *seen.value);
    } else if (event->channel == kCatheterTipChannel) {
      const auto tip = decode<CatheterTip>(data, size);
      if (tip.value) c.tips.emplace(FrameKey(tip.value->frame_sequence, tip.value->time_us), *tip.value);
    } else if (event->channel == kCArmStateChannel) {
      c.states.emplace_back(event->position_bytes, event->bytes);
    }
  }
  c.skipped_bytes = log.skipped_bytes();
  return c;
}

// The inputs of a log that does not name them.
std::vector<ServoInput> guessedInputs(const Contents& c) {
  std::vector<std::pair<FrameKey, std::int64_t>> frames;
  for (const CArmCommand& command : c.commands) {
    const auto found = c.place.find({command.frame_sequence, command.time_us});
    if (found != c.place.end()) frames.emplace_back(found->first, found->second);
  }
  if (frames.empty()) frames = c.frames;
  const auto bus = openBus("memq://");
  const JointHistory joints(*bus, kCArmStateChannel);
  std::vector<ServoInput> inputs;
  auto state = c.states.begin();
  for (const auto& [key, place] : frames) {
    for (; state != c.states.end() && state->first < place; ++state) {
      bus->publish(kCArmStateChannel, state->second);
      bus->handle(std::chrono::milliseconds(0));
    }
    if (const auto at = joints.at(key.second)) inputs.push_back({key.second, key.first, *at});
  }
  return inputs;
}

XrayFrame frameAt(LogReader& log, std::int64_t place) {
  log.seek(place);
  const auto event = log.next();
  auto frame = event ? decode<XrayFrame>(event->bytes.data(), event->bytes.size()) : Decoded<XrayFrame>();
  if (!frame.value) throw std::runtime_error("the log has changed while it was read");
  return std::move(*frame.value);
}

// The commands of a log by the frames they answer.
class LoggedCommands {
 public:
  explicit LoggedCommands(const std::vector<CArmCommand>& commands) {
    for (const CArmCommand& c : commands) by_frame_.emplace(FrameKey(c.frame_sequence, c.time_us), c);
  }
  std::optional<CArmCommand> answering(const ServoInput& input) const {
    const auto found = by_frame_.find({input.frame_sequence, input.time_us});
    return found == by_frame_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  std::map<FrameKey, CArmCommand> by_frame_;
};

// One way through the frames of a log.
class Pass {
 public:
  Pass(LogReader& log, const Contents& contents, const ServoLoopSettings& settings, const VesselTree& tree)
      : log_(log), contents_(contents), commands_(contents.commands), settings_(settings), tree_(tree) {
    summary.frames = static_cast<std::int64_t>(contents.frames.size());
    summary.commands = static_cast<std::int64_t>(contents.commands.size());
    summary.skipped_bytes = contents.skipped_bytes;
    summary.knew_inputs = !contents.inputs.empty();
  }

  void answer(const ServoInput& input, double part, const ReplayWatcher& watcher) {
    const std::string name = "frame " + std::to_string(input.frame_sequence);
    const auto place = contents_.place.find({input.frame_sequence, input.time_us});
    if (place == contents_.place.end()) return differs(name + " was answered, and is not in the log");
    const auto logged = commands_.answering(input);
    if (!loop_ || (logged && logged->sequence == 1)) loop_ = std::make_unique<ServoLoop>(settings_, tree_);
    const XrayFrame frame = frameAt(log_, place->second);
    const ServoReport report = answerAsThen(frame, input);
    loop_->learn();
    ++summary.answered;
    summary.held += report.held.has_value();
    if (logged) {
      ++summary.compared;
      const auto how = difference(report.command, *logged);
      summary.equal += !how;
      if (how) differs(name + ": " + *how);
    }
    if (watcher) watcher({frame, report, logged, part});
  }

  void differs(const std::string& how) {
    if (!summary.first_difference) summary.first_difference = how;
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
    const FrameKey key(input.frame_sequence, input.time_us);
    SeenElsewhere seen;
    if (const auto found = contents_.registrations.find(key); found != contents_.registrations.end()) {
      seen.registration = found->second;
    }
    if (const auto found = contents_.tips.find(key); found != contents_.tips.end()) seen.tip = found->second;
    return seen;
  }

  LogReader& log_;
  const Contents& contents_;
  LoggedCommands commands_;
  const ServoLoopSettings& settings_;
  const VesselTree& tree_;
  std::unique_ptr<ServoLoop> loop_;
};

}  // namespace

std::optional<std::string> difference(const CArmCommand& replayed, const CArmCommand& logged) {
  const auto number = [](const char* field, std::int64_t a, std::int64_t b) -> std::optional<std::string> {
    if (a == b) return std::nullopt;
    return std::string(field) + " = " + std::to_string(a) + " replayed, " + std::to_string(b) + " logged";
  };
  if (auto d = number("utime", replayed.time_us, logged.time_us)) return d;
  if (auto d = number("frame_sequence", replayed.frame_sequence, logged.frame_sequence)) return d;
  if (auto d = number("sequence", replayed.sequence, logged.sequence)) return d;
  if (auto d = number("valid_for_us", replayed.valid_for_us, logged.valid_for_us)) return d;
  for (int i = 0; i < kCArmJointCount; ++i) {
    // By bits: -0 is another number than 0 here.
    if (std::memcmp(&replayed.velocity[i], &logged.velocity[i], sizeof(double)) != 0) {
      return formatted("joint_velocity[%d] = %.17g replayed, %.17g logged", i, replayed.velocity[i],
                       logged.velocity[i]);
    }
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
  const ReplaySummary& found = pass.summary;
  if (found.compared < found.commands) {
    pass.differs(std::to_string(found.commands - found.compared) +
                 " commands cannot be compared: what they answer is not in the log");
  }
  if (found.answered == 0) {
    throw InputError(log_path, "", "",
                     "holds no X-ray frame with joints: needs " + std::string(kXrayFrameChannel) + " and " +
                         kCArmStateChannel + " or " + kServoInputChannel);
  }
  return found;
}

}  // namespace angio
