// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/messaging/logged_frames.hpp"
#include "angio/servo/supervised_node.hpp"

namespace angio::servo {

/// What a replay found.
struct ReplaySummary {
  std::int64_t frames = 0;    ///< X-ray frames in the log that could be decoded, whether they were answered or not.
  std::int64_t answered = 0;  ///< Those that the loop answered again.
  std::int64_t held = 0;      ///< Among them.
  std::int64_t commands = 0;  ///< In the log.
  std::int64_t compared = 0;  ///< Commands that both have.
  std::int64_t equal = 0;     ///< Among them, bit for bit.
  bool knew_inputs = false;   ///< Whether the log says which joints went with which frame.
  std::int64_t skipped_bytes = 0;  ///< Of the file, that were no messages.
  bool whole = true;               ///< Whether the file has its end.
  /// What first went another way than in the log: frame, field and both values, or what the log lacks.
  std::optional<std::string> first_difference;

  /// Counts one command of both, and how they differ, if they do.
  void compare(const std::string& frame, const std::optional<std::string>& difference);

  /// Notes what went another way, if nothing did before.
  void differs(const std::string& how);

  /// After all frames: notes logged commands that were left over.
  void finish();
};

/// How a field differs, in words with both values; nothing when all bits are equal: -0 is another number than 0 here.
std::optional<std::string> difference(const std::string& field, std::int64_t replayed, std::int64_t logged);
std::optional<std::string> difference(const std::string& field, double replayed, double logged);

/// The first field in which two commands differ.
std::optional<std::string> difference(const CArmCommand& replayed, const CArmCommand& logged);
std::optional<std::string> difference(const CatheterCommand& replayed, const CatheterCommand& logged);

/// One frame of a log as it was answered again.
template <typename Loop>
struct ReplayedFrame {
  const XrayFrame& frame;                        ///< Borrowed for the call.
  const typename Loop::Report& report;           ///< What the loop makes of it now.
  std::optional<typename Loop::Command> logged;  ///< What was commanded then, when the log holds it.
  double part = 0;                               ///< How much of the replay is done, 0 to 1.
};
template <typename Loop>
using ReplayWatcher = std::function<void(const ReplayedFrame<Loop>&)>;

/// What a log says of one machine's frames, the images left where they are.
template <typename Loop>
struct LoggedRun {
  using Traits = NodeTraits<Loop>;
  LoggedFrames frames;
  std::vector<typename Loop::Input> inputs;
  std::vector<typename Loop::Command> commands;
  ByFrame<typename Loop::Command> answers;     // The first of each frame.
  ByFrame<RegistrationMessage> registrations;  // The same.
  ByFrame<CatheterTip> tips;                   // The same.
  std::vector<LogEvent> states;                // Of the machine, in their order.
  std::int64_t skipped_bytes = 0;
  bool knew_inputs = true;  // Whether the log says which states went with which frame.

  explicit LoggedRun(LogReader& log) {
    for (auto event = log.next(); event; event = log.next()) enter(*event);
    skipped_bytes = log.skipped_bytes();
    if (inputs.empty()) guessInputs();
  }

 private:
  template <typename Message, typename Keep>
  static bool keep(const LogEvent& event, const char* channel, const Keep& one) {
    if (event.channel != channel) return false;
    const auto decoded = decode<Message>(event.bytes.data(), event.bytes.size());
    if (decoded.value) one(*decoded.value);
    return true;
  }

  void enter(const LogEvent& event) {
    frames.enter(event);
    const bool kept =
        keep<typename Loop::Input>(event, Traits::kInputChannel, [&](const auto& input) { inputs.push_back(input); }) ||
        keep<typename Loop::Command>(event, Traits::kCommandChannel,
                                     [&](const auto& command) {
                                       commands.push_back(command);
                                       answers.emplace(frameOf(command), command);
                                     }) ||
        keep<RegistrationMessage>(event, kRegistrationChannel,
                                  [&](const auto& seen) { registrations.emplace(frameOf(seen), seen); }) ||
        keep<CatheterTip>(event, kCatheterTipChannel, [&](const auto& tip) { tips.emplace(frameOf(tip), tip); });
    if (kept) return;
    for (const char* channel : Traits::kStateChannels) {
      if (event.channel == channel) states.push_back(event);
    }
  }

  // The inputs of a log that does not name them: the frames that commands name, or all, with what had been heard.
  void guessInputs() {
    knew_inputs = false;
    std::vector<LoggedFrames::Entry> answered;
    for (const auto& command : commands) {
      if (const auto place = frames.position_bytes(frameOf(command))) answered.push_back({frameOf(command), *place});
    }
    if (answered.empty()) answered = frames.all();
    const auto bus = openBus("memq://");
    const typename Traits::States heard(*bus);
    auto state = states.begin();
    for (const auto& [name, place] : answered) {
      for (; state != states.end() && state->position_bytes < place; ++state) {
        bus->publish(state->channel, state->bytes);
        bus->handle(std::chrono::milliseconds(0));
      }
      if (const auto input = heard.at(name.second, name.first)) inputs.push_back(*input);
    }
  }
};

/// Sends a log (of lcm-logger, or of a RecordingBus) through a loop again, which is made of `setup`.
///
/// Frames and states are those that the log's inputs (SERVO_INPUT, CATHETER_INPUT) name, in their order, whatever else
/// was on the bus: the commands are those of the live loop, bit for bit, when its settings, tree and calibration are
/// given. A command's sequence that begins again is a loop that was started again. A log without inputs gives the
/// frames that its commands name, or all frames when it has no commands, with the states that had been heard before
/// each frame.
///
/// Throws InputError when the log cannot be read or holds no frame that can be answered, and as the loop does.
template <typename Loop, typename... Setup>
ReplaySummary replay(const std::string& log_path, const ReplayWatcher<Loop>& watcher, const Setup&... setup) {
  LogReader log(log_path);
  const LoggedRun<Loop> run(log);
  ReplaySummary summary;
  summary.frames = static_cast<std::int64_t>(run.frames.all().size());
  summary.commands = static_cast<std::int64_t>(run.commands.size());
  summary.skipped_bytes = run.skipped_bytes;
  summary.whole = log.whole();
  summary.knew_inputs = run.knew_inputs;
  std::optional<Loop> loop;
  double done = 0;
  for (const auto& input : run.inputs) {
    const double part = ++done / static_cast<double>(run.inputs.size());
    const std::string name = "frame " + std::to_string(input.frame_sequence);
    const auto place = run.frames.position_bytes(frameOf(input));
    if (!place) {
      summary.differs(name + " was answered, and is not in the log");
      continue;
    }
    const auto logged = of(frameOf(input), run.answers);
    if (!loop || (logged && logged->sequence == 1)) loop.emplace(setup...);
    const XrayFrame frame = LoggedFrames::readAt(log, *place);
    const ExternalEstimates external{of(frameOf(input), run.registrations), of(frameOf(input), run.tips)};
    typename Loop::Report report = input.verdict == ServoVerdict::kRefused
                                       ? loop->refuse(frame, "refused by the supervisor")
                                       : loop->propose(frame, input, external);
    if (input.verdict == ServoVerdict::kTakenBack) {
      Loop::withhold(report, report.hold_reason.value_or("withheld by the supervisor"));
    }
    loop->commit(report.command);
    loop->learn();
    ++summary.answered;
    summary.held += report.hold_reason.has_value();
    if (logged) summary.compare(name, difference(report.command, *logged));
    if (watcher) watcher({frame, report, logged, part});
  }
  summary.finish();
  if (summary.answered == 0) {
    throw InputError(log_path, "", "",
                     "holds no X-ray frame that can be answered: needs " + std::string(kXrayFrameChannel) + " and " +
                         NodeTraits<Loop>::kStateChannels[0] + " or " + NodeTraits<Loop>::kInputChannel);
  }
  return summary;
}

}  // namespace angio::servo
