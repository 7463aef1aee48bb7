// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/machine_check/machine_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/base/formatted.hpp"
#include "machine_check_parts.hpp"

namespace angio::machine_check {
namespace {

constexpr std::int64_t kLongValid_us = 1'000'000;  // What a machine obeys at most.
constexpr double kSettle_s = 0.7;                  // From a command to stand still until the image is looked at.
constexpr double kMaxLook_s = 2;                   // That a look may take until its frames have come.
constexpr double kAtRest = 0.1;                    // Share of the check's speed below which a joint stands ...
constexpr double kRestWindow_s = 0.1;              // ... over so long.

std::vector<Step> planOf(const MachineCheckSettings& settings) {
  using Kind = Step::Kind;
  std::vector<Step> plan = {{Kind::kWatch}, {Kind::kLook}};
  if (settings.move) {
    for (int joint = 0; joint < kCArmJointCount; ++joint) {
      for (const Step& step : {Step{Kind::kMove, joint, 1}, Step{Kind::kRest, joint}, Step{Kind::kLook, joint},
                               Step{Kind::kMove, joint, -1}, Step{Kind::kRest}}) {
        plan.push_back(step);
      }
      plan.push_back({Kind::kLook});
    }
    plan.insert(plan.end(), {{Kind::kSilence, 0, 1}, {Kind::kStop, 0, -1}, {Kind::kNan}});
  }
  plan.push_back({Kind::kEnd});
  return plan;
}

}  // namespace

void MachineCheckSettings::visit(SettingsVisitor& v) {
  v.number("watch_s", watch_s, 0.5, 600, "How long it only watches at first");
  v.number("angle_deg", angle_deg, 0.1, 10, "How far each angle is moved out and back");
  v.number("table_mm", table_mm, 0.5, 50, "How far the table is moved out and back along each axis");
  v.number("angle_speed_deg_per_s", angle_speed_deg_per_s, 0.1, 10, "Speed of the angles");
  v.number("table_speed_mm_per_s", table_speed_mm_per_s, 0.5, 50, "Speed of the table");
}

MachineCheck::Parts::Parts(const MachineCheckSettings& s, const VesselTree& t)
    : settings(s), image(s, t), plan(planOf(s)) {}

MachineCheck::MachineCheck(const MachineCheckSettings& settings, const VesselTree& tree) {
  checkSettings("machine check", settings);
  settings.carm.check();
  parts_ = std::make_unique<Parts>(settings, tree);
}
MachineCheck::MachineCheck(MachineCheck&&) noexcept = default;
MachineCheck::~MachineCheck() = default;

void MachineCheck::Parts::next(std::int64_t now_us) {
  if (at + 1 < plan.size()) ++at;
  began_us = now_us;
  image.begin();
  rest_after_s.reset();
  if (history.newest()) start = history.newest()->joints;
  integrated.setZero();
  commanded_us = 0;
  seen_moving = false;
}

void MachineCheck::Parts::abort(const std::string& why, std::int64_t now_us) {
  if (aborted) return;
  aborted = true;
  found.push_back({"moves as asked", CheckVerdict::kFail, why, "no further than twice what was asked, no other joint"});
  at = plan.size() - 1;
  began_us = now_us;
}

// By positions: a velocity may be reported wrongly.
bool MachineCheck::Parts::stands() const {
  const auto& entries = history.entries();
  if (entries.empty()) return true;
  const CArmState& newest = entries.back().state;
  for (auto entry = entries.rbegin(); entry != entries.rend(); ++entry) {
    const double apart_s = 1e-6 * static_cast<double>(entries.back().now_us - entry->now_us);
    if (apart_s < kRestWindow_s) continue;
    for (int i = 0; i < kCArmJointCount; ++i) {
      if (std::abs(newest.joints[i] - entry->state.joints[i]) > kAtRest * speed(i) * apart_s) return false;
    }
    return true;
  }
  return false;
}

void MachineCheck::see(const CArmState& state, std::int64_t now_us) {
  Parts& p = *parts_;
  if (!p.began_us) p.began_us = now_us;
  p.states.see(state.time_us, state.sequence, now_us);
  const CArmLimits& limits = p.settings.limits;
  for (int i = 0; i < kCArmJointCount && !p.implausible; ++i) {
    const double margin = isAngle(i) ? degToRad(0.5) : 2e-3;
    if (!std::isfinite(state.joints[i]) || !std::isfinite(state.velocity[i])) {
      p.implausible = std::string(kJointNames[i]) + " is no finite number";
    } else if (state.joints[i] < limits.lower[i] - margin || state.joints[i] > limits.upper[i] + margin) {
      p.implausible =
          std::string(kJointNames[i]) + " at " + inUnits(i, state.joints[i]) + ", beyond its range: in wrong units?";
    }
  }
  if (!state.joints.allFinite() || !state.velocity.allFinite()) return;
  if (const auto& last = p.history.newest()) {
    p.integrated += 0.5e-6 * static_cast<double>(state.time_us - last->time_us) * (last->velocity + state.velocity);
  }
  p.history.see(state, now_us);
  p.watchMotion(state, now_us);
}

// Latency, and whether the machine goes where it was not sent.
void MachineCheck::Parts::watchMotion(const CArmState& state, std::int64_t now_us) {
  using Kind = Step::Kind;
  const Kind kind = step().kind;
  const bool moving = kind == Kind::kMove || kind == Kind::kSilence || kind == Kind::kStop;
  if (moving && commanded_us > 0 && !seen_moving) {
    seen_moving = std::abs(state.joints[step().joint] - start[step().joint]) > 0.02 * goal(step().joint);
    const double after_s = 1e-6 * static_cast<double>(now_us - commanded_us);
    if (seen_moving) latency_s = std::max(latency_s.value_or(0), after_s);
  }
  if (kind == Kind::kWatch || kind == Kind::kEnd) return;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double moved = std::abs(state.joints[i] - start[i]);
    const double allowed = moving && i == step().joint ? 2 * goal(i) : 0.5 * goal(i) + (moving ? 0 : goal(i));
    if (moved > allowed) {
      abort(std::string(kJointNames[i]) + " moved by " + inUnits(i, state.joints[i] - start[i]) +
                (moving ? std::string(" when ") + inUnits(step().joint, step().sign * goal(step().joint)) + " of " +
                              kJointNames[step().joint] + " were asked"
                        : " when it was to stand"),
            now_us);
      return;
    }
  }
}

void MachineCheck::see(const XrayFrame& frame, std::int64_t now_us) {
  Parts& p = *parts_;
  if (!p.began_us) p.began_us = now_us;
  p.frames.see(frame.time_us, frame.sequence, now_us);
  if (const auto& state = p.history.newest()) {
    const double age_s = 1e-6 * static_cast<double>(state->time_us - frame.time_us);
    p.sum_age_s += age_s;
    p.oldest_frame_s = std::max(p.oldest_frame_s, std::abs(age_s));
  }
  p.newest_frame = XrayFrame{frame.time_us, frame.sequence, {}, frame.camera};
  if (looks() && p.history.newest()) p.image.observe(frame, p.history.at(frame.time_us));
}

bool MachineCheck::looks() const { return parts_->step().kind == Step::Kind::kLook && !parts_->image.complete(); }

bool MachineCheck::finished() const { return parts_->step().kind == Step::Kind::kEnd && parts_->stands(); }

CArmCommand MachineCheck::Parts::commandOf(const CArmJoints& velocity, std::int64_t valid_us) {
  CArmCommand command;
  // By the machine's own clock.
  const std::int64_t frame_us = newest_frame ? newest_frame->time_us : 0;
  const std::int64_t state_us = history.newest() ? history.newest()->time_us : 0;
  command.time_us = std::max(frame_us, state_us);
  command.frame_sequence = newest_frame ? newest_frame->sequence : 0;
  command.sequence = ++sequence;
  command.valid_for_us = valid_us;
  command.velocity = velocity;
  return command;
}

// A motion of one joint, out or back, as long as it should take and as far as it should go.
std::optional<CArmCommand> MachineCheck::Parts::move(std::int64_t now_us) {
  const int joint = step().joint;
  if (!(since_s(now_us) < goal(joint) / speed(joint))) return std::nullopt;
  if (commanded_us == 0) commanded_us = now_us;
  CArmJoints velocity = CArmJoints::Zero();
  velocity[joint] = step().sign * speed(joint);
  return commandOf(velocity);
}

// How far the encoder went of what was commanded, and whether the reported velocities explain it.
void MachineCheck::Parts::checkEncoder(int joint) {
  const double moved = history.newest() ? history.newest()->joints[joint] - start[joint] : 0;
  const double share = moved / goal(joint);
  if (std::abs(share) > 0.3) {
    const double explained = integrated[joint] / moved;
    if (!velocity_share || std::abs(explained - 1) > std::abs(*velocity_share - 1)) velocity_share = explained;
  }
  found.push_back(verdictRow(std::string(kJointNames[joint]) + " by its encoder", asExpected(share),
                             inUnits(joint, moved) + ", " + wordsOf({share, 0}),
                             "moves by what was commanded, 0.75 to 1.3 times"));
}

// When the primary angle comes to rest, `still_s` after it was told to or was told nothing more. Whether the row has
// been written: a little after it should have.
bool MachineCheck::Parts::restSeen(const std::string& name, double still_s, double allowed_s,
                                   const std::string& asked) {
  if (!rest_after_s && still_s > 0.05 && stands()) rest_after_s = still_s;
  if (still_s < allowed_s + 0.3) return false;
  if (!history.newest() || !(std::abs(history.newest()->joints[0] - start[0]) > 0.1 * goal(0))) {
    found.push_back({name, CheckVerdict::kNotSeen, "it did not move", asked});
  } else {
    found.push_back(verdictRow(name, rest_after_s && *rest_after_s <= allowed_s,
                               rest_after_s ? formatted("at rest after %.2f s", *rest_after_s) : "still moving",
                               asked));
  }
  return true;
}

std::optional<CArmCommand> MachineCheck::command(std::int64_t now_us) {
  using Kind = Step::Kind;
  Parts& p = *parts_;
  if (!p.began_us) p.began_us = now_us;
  const Step step = p.step();
  const double passed_s = p.since_s(now_us), half_s = 0.5 * p.goal(0) / p.speed(0);
  const CArmJoints rest = CArmJoints::Zero();
  switch (step.kind) {
    case Kind::kWatch:
      if (passed_s < p.settings.watch_s) return std::nullopt;
      if (p.implausible) {
        p.abort("nothing was moved: " + *p.implausible, now_us);
      } else if (p.settings.move && (p.states.count() < 2 || p.frames.count() < 1)) {
        p.abort("nothing was moved: no states or no frames come", now_us);
      } else {
        p.next(now_us);
      }
      return std::nullopt;
    case Kind::kLook:
      if (p.image.complete() || passed_s > kMaxLook_s) {
        if (step.joint >= 0) {
          p.found.push_back(p.image.motionRow(step.joint));
        } else {
          p.image.keep();
        }
        p.next(now_us);
      }
      return p.settings.move && p.sequence > 0 ? std::optional(p.commandOf(rest)) : std::nullopt;
    case Kind::kMove: {
      if (auto command = p.move(now_us)) return command;
      // How far it went is seen when it stands.
      const CArmJoints from = p.start, integrated = p.integrated;
      p.next(now_us);
      p.start = from;
      p.integrated = integrated;
      return p.commandOf(rest);
    }
    case Kind::kRest:
      if (passed_s < kSettle_s) return p.commandOf(rest);
      if (step.joint >= 0) p.checkEncoder(step.joint);  // After the way out.
      break;
    case Kind::kSilence: {
      // Half of a motion, then nothing more is said.
      if (passed_s < half_s) return p.move(now_us);
      const double braking_s = p.speed(0) / p.settings.limits.acceleration[0] + p.speed(0) / p.settings.limits.jerk[0];
      const double allowed_s = 1e-6 * kUsualValid_us + kMaxLatency_s + braking_s;
      const std::string asked =
          formatted("at rest %.2f s after the last command, valid for %.1f s", allowed_s, 1e-6 * kUsualValid_us);
      if (!p.restSeen("watchdog", passed_s - half_s, allowed_s, asked)) return std::nullopt;
      break;
    }
    case Kind::kStop: {
      if (passed_s < kSettle_s) {  // At rest first, whatever the watchdog does.
        p.start = p.history.newest() ? p.history.newest()->joints : p.start;
        return p.commandOf(rest);
      }
      CArmJoints velocity = rest;
      velocity[0] = -p.speed(0);
      const double since_s = passed_s - kSettle_s;
      // Valid for so long that no watchdog stops it in time.
      if (since_s < half_s) return p.commandOf(velocity, kLongValid_us);
      const double allowed_s = kMaxLatency_s + p.speed(0) / p.settings.limits.acceleration[0] + 0.1;
      const std::string asked = formatted("at rest %.2f s after a command to stand still", allowed_s);
      if (!p.restSeen("stop", since_s - half_s, allowed_s, asked)) return p.commandOf(rest);
      break;
    }
    case Kind::kNan: {
      CArmJoints broken = rest;
      broken[0] = std::numeric_limits<double>::quiet_NaN();
      if (passed_s < 0.2) return p.commandOf(broken);
      if (passed_s < 0.2 + kMaxLatency_s) return std::nullopt;
      const auto& state = p.history.newest();
      const double moved = state ? (state->joints - p.start).cwiseAbs().maxCoeff() : 0;
      p.found.push_back(verdictRow("NaN", p.stands() && moved < 0.05 * p.goal(0), formatted("moved by %.4f rad", moved),
                                   "a command that is no finite number moves nothing"));
      break;
    }
    case Kind::kEnd:
      // A machine that was moved is told to stand until it does, and a little longer.
      return p.sequence > 0 && (!p.stands() || passed_s < 0.3) ? std::optional(p.commandOf(rest)) : std::nullopt;
  }
  p.next(now_us);
  return p.commandOf(rest);
}

std::string MachineCheck::doing() const {
  const Step& step = parts_->step();
  static constexpr const char* kWords[] = {
      "watches",  "looks at the image",      "moves ",      "waits until it stands", "falls silent while it moves",
      "stops it", "sends what is no number", "has finished"};
  return kWords[static_cast<int>(step.kind)] +
         std::string(step.kind == Step::Kind::kMove ? kJointNames[step.joint] : "");
}

}  // namespace angio::machine_check
