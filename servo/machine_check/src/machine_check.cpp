// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/machine_check/machine_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/base/formatted.hpp"
#include "angio/perception/frame_geometry.hpp"
#include "angio/types/channels.hpp"
#include "angio/types/time_stamp.hpp"
#include "image_check.hpp"
#include "observed_machine.hpp"

namespace angio::machine_check {
namespace {

constexpr std::int64_t kValid_us = 200'000;        // Of commands; what a loop usually sends.
constexpr std::int64_t kLongValid_us = 1'000'000;  // What a machine obeys at most.
constexpr double kSettle_s = 0.7;                  // From a command to stand still until the image is looked at.
constexpr double kMaxLook_s = 2;                   // That a look may take until its frames have come.
constexpr double kMaxLatency_s = 0.3;   // From a command to motion: what the loop's own settings can make up for.
constexpr double kMaxFrameAge_s = 0.3;  // What the supervisor lets pass.
constexpr double kAtRest = 0.1;         // Share of the check's speed below which a joint stands ...
constexpr double kRestWindow_s = 0.1;   // ... over so long.

// What is done, one after the other.
struct Step {
  enum class Kind { kWatch, kLook, kMove, kRest, kSilence, kStop, kNan, kEnd } kind = Kind::kEnd;
  int joint = -1;
  int sign = 1;
};

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

struct MachineCheck::Parts {
  Parts(const MachineCheckSettings& s, const VesselTree& t) : settings(s), image(s, t), plan(planOf(s)) {}

  double goal(int joint) const { return isAngle(joint) ? degToRad(settings.angle_deg) : 1e-3 * settings.table_mm; }
  double speed(int joint) const {
    const double asked =
        isAngle(joint) ? degToRad(settings.angle_speed_deg_per_s) : 1e-3 * settings.table_speed_mm_per_s;
    return std::min(asked, settings.limits.velocity[joint]);
  }
  const Step& step() const { return plan[at]; }
  double since_s(std::int64_t now_us) const { return 1e-6 * static_cast<double>(now_us - *began_us); }
  void next(std::int64_t now_us);
  void abort(const std::string& why, std::int64_t now_us);
  bool stands() const;
  bool restSeen(const std::string& name, double still_s, double allowed_s, const std::string& asked);
  void checkEncoder(int joint);
  void watchMotion(const CArmState& state, std::int64_t now_us);
  CArmCommand commandOf(const CArmJoints& velocity, std::int64_t valid_us = kValid_us);
  std::optional<CArmCommand> move(std::int64_t now_us);
  void checkStates(std::vector<CheckRow>& rows) const;
  void checkFrames(std::vector<CheckRow>& rows) const;

  MachineCheckSettings settings;
  ImageCheck image;
  std::vector<Step> plan;
  std::size_t at = 0;
  std::optional<std::int64_t> began_us;  // Of the step.

  ObservedChannel states, frames;
  ObservedStates history;
  std::optional<std::string> implausible;
  std::optional<XrayFrame> newest_frame;  // Without its image.
  double oldest_frame_s = 0;
  double sum_age_s = 0;

  std::int64_t sequence = 0;
  CArmJoints start = CArmJoints::Zero();       // Of a motion.
  std::int64_t commanded_us = 0;               // When its first command was given, ours.
  bool seen_moving = false;                    // Since then.
  std::optional<double> latency_s;             // The largest.
  CArmJoints integrated = CArmJoints::Zero();  // Of the velocities that were reported since the step began.
  std::optional<double> velocity_share;        // Of a motion that they explain, the worst.
  std::optional<double> rest_after_s;
  std::vector<CheckRow> found;
  bool aborted = false;
};

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
      const double allowed_s = 1e-6 * kValid_us + kMaxLatency_s + braking_s;
      const std::string asked =
          formatted("at rest %.2f s after the last command, valid for %.1f s", allowed_s, 1e-6 * kValid_us);
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

void MachineCheck::Parts::checkStates(std::vector<CheckRow>& rows) const {
  const char* name = kCArmStateChannel;
  rows.insert(rows.end(), {states.rateRow(name, 50, 200), states.sequenceRow(name), states.clockRow(name)});
  const std::string asked = "radians and metres, within the limits";
  if (states.count() == 0) {
    rows.push_back({"joints", CheckVerdict::kNotSeen, "no state came", asked});
  } else if (implausible) {
    rows.push_back({"joints", CheckVerdict::kFail, *implausible, asked});
  } else {
    std::string measured;
    for (int i = 0; i < kCArmJointCount; ++i) {
      measured += (i ? ", " : "") + inUnits(i, history.newest()->joints[i]);
    }
    rows.push_back({"joints", CheckVerdict::kPass, measured, asked});
  }
}

void MachineCheck::Parts::checkFrames(std::vector<CheckRow>& rows) const {
  const char* name = kXrayFrameChannel;
  rows.insert(rows.end(), {frames.rateRow(name, 3, 60), frames.sequenceRow(name), frames.clockRow(name)});
  const std::string late = "of the states' clock, and 300 ms late at most";
  const std::string focal = "fx is distance / spacing, and all is the calibration's, within 1 %";
  if (!newest_frame) {
    rows.push_back({"frame age", CheckVerdict::kNotSeen, "no frame came", late});
    rows.push_back({"frame geometry", CheckVerdict::kNotSeen, "no frame came", focal});
    return;
  }
  if (states.count() == 0) {
    rows.push_back({"frame age", CheckVerdict::kNotSeen, "no state came", late});
  } else {
    const auto far = differentEpochs({kXrayFrameChannel, "", newest_frame->time_us},
                                     {kCArmStateChannel, "", history.newest()->time_us});
    const std::string ages = formatted("%.0f ms behind the newest state, %.0f ms at most",
                                       1e3 * sum_age_s / static_cast<double>(frames.count()), 1e3 * oldest_frame_s);
    rows.push_back(verdictRow("frame age", oldest_frame_s <= kMaxFrameAge_s, far.value_or(ages), late));
  }
  const auto wrong = contradiction(newest_frame->camera, settings.carm);
  const XrayCamera::Parameters& k = newest_frame->camera.parameters();
  rows.push_back(verdictRow("frame geometry", !wrong,
                            wrong.value_or(formatted("%d x %d px, fx %.1f px", k.width_px, k.height_px, k.fx_px)),
                            focal));
}

std::vector<CheckRow> MachineCheck::rows() const {
  const Parts& p = *parts_;
  std::vector<CheckRow> rows;
  p.checkStates(rows);
  p.checkFrames(rows);
  rows.push_back(p.image.orientationRow());
  if (!p.settings.move) {
    rows.push_back({"motion", CheckVerdict::kNotSeen, "it was not to be moved", "--move"});
    return rows;
  }
  rows.insert(rows.end(), p.found.begin(), p.found.end());
  const auto add = [&](CheckRow row, bool moved) {
    if (!moved) row.verdict = CheckVerdict::kNotSeen, row.measured = "it did not move";
    rows.push_back(row);
  };
  const double share = p.velocity_share.value_or(0), latency_s = p.latency_s.value_or(0);
  add(verdictRow("velocities", asExpected(share), formatted("%.2f of the motion, of the worst joint", share),
                 "joint_velocity is what joint_position changes by, 0.75 to 1.3 times"),
      p.velocity_share.has_value());
  add(verdictRow("latency", latency_s <= kMaxLatency_s, formatted("%.0f ms", 1e3 * latency_s),
                 formatted("%.0f ms at most from a command to motion", 1e3 * kMaxLatency_s)),
      p.latency_s.has_value());
  return rows;
}

bool passed(const std::vector<CheckRow>& rows) {
  return std::none_of(rows.begin(), rows.end(), [](const CheckRow& r) { return r.verdict == CheckVerdict::kFail; });
}

std::string table(const std::vector<CheckRow>& rows) {
  static constexpr const char* kVerdicts[] = {"pass", "FAIL", "not seen"};
  std::string text;
  for (const CheckRow& r : rows) {
    text += formatted("%-8s  %-24s  ", kVerdicts[static_cast<int>(r.verdict)], r.name.c_str()) + r.measured;
    if (r.verdict == CheckVerdict::kFail) text += "  (asked: " + r.asked + ")";
    text += "\n";
  }
  return text;
}

}  // namespace angio::machine_check
