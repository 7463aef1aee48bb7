// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/stopwatch.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/servo/frame_mailbox.hpp"
#include "angio/servo/heard_channels.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/safety_supervisor.hpp"
#include "angio/servo/second_senders.hpp"
#include "angio/types/channels.hpp"

namespace angio::servo {

/// What SupervisedNode needs to know of a loop's machine; specialised beside each loop (servo_node.hpp,
/// catheter_node.hpp):
///
///   Monitor                      compares the machine's motion with its commands
///   kMachine                     whose operator is obeyed
///   kCommandChannel, kInputChannel, kStatusChannel, kSessionChannel
///   kStateChannels, kStateSenders   the machines that are heard, and what several of them are called
///   kCommands                    what commands are called
///   States                       hears the machine's states: States(bus), hear(supervisor, now_us),
///                                at(time_us, frame_sequence) -> optional<Input>, forget(), refused(),
///                                records() of the channels, the C-arm's first
///   safety(loop)                 the machine's SafetySupervisor<Monitor>
///   arm(input)                   the C-arm's joints at the exposure
///   publish(bus, loop, report, state)  what the loop says beside its command and its status
///   status(report)               the status, without the supervisor's part
template <typename Loop>
struct NodeTraits;

/// A loop on a bus under its supervisor: hears frames, states and requests, supervises, publishes the command and what
/// else the loop says. Stands still until an operator has armed and started it; when it is armed it announces a session
/// to its machine. Another program that sends its commands or its statuses, or two machines that send where one should,
/// are a fault from its next answer() on. It says its status with each answer, with each change of state, and once a
/// second while no frame can be answered; the status' reason says then what was heard of whom.
///
/// A loop has the types Input, Command and Report, and
///
///   externalInputs()                    what other programs have to say of each frame
///   propose(frame, input, external)     -> Report with a command that counts as sent only when committed
///   refuse(frame, why)                  -> Report of a frame that must not be looked at
///   withhold(report, why)               makes the proposal one to stand still
///   commit(command)                     what was sent, once per propose() or refuse()
///   learn()                             what need not be done before the command is out
///   carm()                              the geometry of the C-arm that holds the camera
///
/// It knows neither clock nor bus, so that replay() gives the same commands, bit for bit.
template <typename Loop>
class SupervisedNode {
 public:
  using Traits = NodeTraits<Loop>;
  using Report = typename Loop::Report;

  /// Borrows the bus, which must outlive it; `setup` is what the loop is made of. Throws InputError as the loop does.
  template <typename... Setup>
  explicit SupervisedNode(Bus& bus, const Setup&... setup)
      : bus_(bus),
        loop_(setup...),
        frames_(bus, loop_.externalInputs()),
        states_(bus),
        requests_(bus, Traits::kMachine),
        second_senders_(bus, watched()),
        safety_(Traits::safety(loop_)) {}

  /// Hears what has come, and answers the newest frame that waits; nothing comes back when none does. To be called
  /// whenever the bus was handled, and at least as often as frames should come.
  ///
  /// @param now_us  The caller's own clock [us].
  std::optional<Report> answer(std::int64_t now_us) {
    hear(now_us);
    auto next = states_.heard() ? frames_.take() : std::nullopt;
    if (next) frame_us_ = now_us;
    trouble_ = troubleAt(now_us);
    if (!next) {
      if (safety_.states().transitions() != said_transitions_ || passed_us(said_us_, now_us) >= kSilence_us) {
        say(last_status_, now_us);
      }
      return std::nullopt;
    }
    Report report = answerOf(*next, now_us);
    safety_.commanded(report.command);
    publish(bus_, Traits::kCommandChannel, report.command);
    session_.command_sequence = report.command.sequence;
    Traits::publish(bus_, loop_, report, safety_.states().state());
    say(Traits::status(report), now_us);
    const Stopwatch learning;
    loop_.learn();  // With the command on its way.
    report.learning_s = learning.seconds();
    return report;
  }

  /// What a user has to mend, by what was heard of whom: a second sender, or why no frame has been answered for 1 s.
  /// Nothing when there is neither.
  const std::optional<std::string>& trouble() const { return trouble_; }

  /// Frames and states that could not be decoded.
  std::int64_t refused() const { return frames_.refused() + states_.refused(); }

  const SafetySupervisor<typename Traits::Monitor>& safety() const { return safety_; }
  const ServoStateMachine& states() const { return safety_.states(); }
  const Loop& loop() const { return loop_; }

 private:
  static std::vector<SecondSenders::Watched> watched() {
    using Kind = SecondSenders::Kind;
    std::vector<SecondSenders::Watched> all = {{Traits::kCommandChannel, Kind::kCommands, Traits::kCommands},
                                               {Traits::kStatusChannel, Kind::kStatuses, "loops"},
                                               {kXrayFrameChannel, Kind::kMachine, "X-rays"}};
    const char* const* senders = Traits::kStateSenders;
    for (const char* channel : Traits::kStateChannels) {
      all.push_back({channel, Kind::kMachine, *senders++});
    }
    return all;
  }

  // So long without an answer, a status is said, and why.
  static constexpr double kSilence_us = 1e6;
  // So long a second sender explains what is wrong.
  static constexpr double kRecent_us = 2e6;

  static double passed_us(std::int64_t from_us, std::int64_t to_us) {
    return static_cast<double>(to_us) - static_cast<double>(from_us);
  }

  std::string silence() const {
    return silenceOf(frames_.record(), states_.records(), states_.heard(), frames_.awaited());
  }

  std::optional<std::string> troubleAt(std::int64_t now_us) const {
    if (second_) return second_;
    return passed_us(*frame_us_, now_us) >= kSilence_us ? std::optional(silence()) : std::nullopt;
  }

  void hear(std::int64_t now_us) {
    if (!frame_us_) frame_us_ = said_us_ = now_us;  // Frames, and statuses, are due from the first call on.
    // Before the states: two machines' clocks would else be called one clock that jumps.
    if (auto second = second_senders_.take(now_us)) {
      safety_.secondSender(*second, now_us);
      second_ = std::move(*second);
      second_us_ = now_us;
    } else if (second_ && passed_us(second_us_, now_us) > kRecent_us) {
      second_.reset();
    }
    states_.hear(safety_, now_us);
    for (const ServoRequest& request : requests_.take()) {
      const ServoState before = states().state();
      const bool refused = safety_.request(request, now_us).has_value();
      if (!refused && request.request == ServoRequestKind::kReset) {
        states_.forget();
        second_senders_.forget();
        second_.reset();
      }
      if (before != ServoState::kArmed && states().state() == ServoState::kArmed) announce(now_us);
    }
    safety_.wait(now_us, [this] { return silence(); });
  }

  // Named by the time: programs that announce at the same microsecond are a fault anyway.
  void announce(std::int64_t now_us) {
    session_.time_us = session_.session = now_us;
    ++session_.sequence;
    publish(bus_, Traits::kSessionChannel, session_);
  }

  // Proposes, asks for permission, and commits to what is sent. Says what a replay needs to know.
  Report answerOf(const FrameWithEstimates& next, std::int64_t now_us) {
    typename Loop::Input input = *states_.at(next.frame.time_us, next.frame.sequence);
    const auto refused = safety_.begin(next.frame, now_us, next.sender);
    Report report = refused ? loop_.refuse(next.frame, *refused) : loop_.propose(next.frame, input, next.external);
    if (report.hold_reason) report.hold_reason = explained(*report.hold_reason);
    if (refused) {
      input.verdict = ServoVerdict::kRefused;
    } else {
      classify(report, Traits::arm(input), now_us);
      const bool permitted = safety_.permits(report.command);
      input.verdict = permitted ? ServoVerdict::kPermitted : ServoVerdict::kTakenBack;
      if (!permitted) Loop::withhold(report, report.hold_reason.value_or(safety_.states().reason()));
    }
    loop_.commit(report.command);
    publish(bus_, Traits::kInputChannel, input);
    return report;
  }

  // What makes a frame doubtful may be a consequence of two senders, or of states that cannot be decoded.
  std::string explained(const std::string& hold_reason) const {
    if (second_) return *second_;
    constexpr std::int64_t kBroken = 3;  // In a row: less is a network's.
    for (const ChannelRecord& states : states_.records()) {
      if (states.refused_in_a_row >= kBroken) return *undecodable(states) + "; " + hold_reason;
    }
    return hold_reason;
  }

  void classify(const Report& report, const CArmState& arm, std::int64_t now_us) {
    if (!report.hold_reason) {
      const Pose T_patient_camera = loop_.carm().T_camera_patient(arm.joints).inverse();
      safety_.accept(T_patient_camera * report.patient->T_camera_model, T_patient_camera.linear().col(2), now_us);
    } else {
      using RejectionKind = FrameSupervisor::RejectionKind;
      safety_.reject(report.contradicts ? RejectionKind::kContradiction : RejectionKind::kUnseen, *report.hold_reason,
                     now_us);
    }
  }

  void say(ServoStatus status, std::int64_t now_us) {
    // What the loop says while it servoes is no reason for a state.
    const std::string unused = status.state == ServoState::kServo ? status.reason : "";
    safety_.describe(status);
    if (status.state == ServoState::kServo && status.reason.empty()) status.reason = unused;
    const bool waits = status.state == ServoState::kIdle || status.state == ServoState::kArmed;
    if (waits && trouble_) status.reason += "; " + *trouble_;
    publish(bus_, Traits::kStatusChannel, status);
    said_transitions_ = status.transitions;
    said_us_ = now_us;
    last_status_ = std::move(status);
  }

  Bus& bus_;
  Loop loop_;
  FrameMailbox frames_;
  typename Traits::States states_;
  HeardRequests requests_;
  SecondSenders second_senders_;
  SafetySupervisor<typename Traits::Monitor> safety_;
  std::int64_t said_transitions_ = 0, said_us_ = 0;
  std::optional<std::int64_t> frame_us_;         // When the last frame was answered, or the first call.
  std::optional<std::string> trouble_, second_;  // Of a second sender: the last finding, while it is recent.
  std::int64_t second_us_ = 0;
  ServoStatus last_status_;
  ServoSession session_;  // The last one that was announced.
};

}  // namespace angio::servo
