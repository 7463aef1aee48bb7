// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/machine_check/machine_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/perception/frame_geometry.hpp"
#include "angio/perception/image_reading.hpp"
#include "angio/perception/perception.hpp"
#include "observed_machine.hpp"

namespace angio::machine_check {
namespace {

constexpr std::int64_t kValid_us = 200'000;        // Of commands; what a loop usually sends.
constexpr std::int64_t kLongValid_us = 1'000'000;  // What a machine obeys at most.
constexpr double kSettle_s = 0.7;                  // From a command to stand still until the image is looked at.
constexpr int kLooks = 3;                          // Frames of a look.
constexpr double kMaxLook_s = 2;                   // That a look may take until its frames have come.
constexpr double kMaxLatency_s = 0.3;   // From a command to motion: what the loop's own settings can make up for.
constexpr double kMaxFrameAge_s = 0.3;  // What the supervisor lets pass.
constexpr double kAtRest = 0.1;         // Share of the check's speed below which a joint stands ...
constexpr double kRestWindow_s = 0.1;   // ... over so long.
// Of an image's motion: a fit of 0.1 px beside motions of 1.5 px and more, and patients who are not quite still.
constexpr double kMinShare = 0.75, kMaxShare = 1.3, kMaxRest = 0.35;
constexpr double kMinMotion_px = 0.5;  // What moves the image by less shows nothing.

constexpr std::array<const char*, kCArmJointCount> kNames = {"primary", "secondary", "table x", "table y", "table z"};

bool isAngle(int joint) { return joint < 2; }

std::string inUnits(int joint, double value) {
  return isAngle(joint) ? formatted("%.2f deg", radToDeg(value)) : formatted("%.2f mm", 1e3 * value);
}

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

// What the X-ray showed while the machine stood.
struct Look {
  int frames = 0, converged = 0;
  std::string status;
  CArmJoints joints = CArmJoints::Zero();
  Pose T_camera_model = Pose::Identity();  // Of the last converged frame.
  Eigen::Matrix2Xd points_px;              // Mean over the converged frames, all points of the tree.
};

}  // namespace

void MachineCheckSettings::visit(SettingsVisitor& v) {
  v.number("watch_s", watch_s, 0.5, 600);
  v.number("angle_deg", angle_deg, 0.1, 10);
  v.number("table_mm", table_mm, 0.5, 50);
  v.number("angle_speed_deg_per_s", angle_speed_deg_per_s, 0.1, 10);
  v.number("table_speed_mm_per_s", table_speed_mm_per_s, 0.5, 50);
}

struct MachineCheck::Parts {
  Parts(const MachineCheckSettings& s, const VesselTree& t)
      : settings(s), tree(t), perception(wide(), s.carm, s.T_dsa_cb, t), plan(planOf(s)) {}

  // Joints of a wrong sign put the tree somewhere else: it is looked for further off than a loop looks.
  static PerceptionSettings wide() {
    PerceptionSettings settings;
    settings.tracker.calibration_rotation_std_deg = 4;
    settings.tracker.calibration_translation_std_mm = 15;
    return settings;
  }

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
  void look(const XrayFrame& frame);
  void nameReading(const XrayFrame& frame, const Observation& observation, const CArmState& state);
  void judgeMotion(int joint);
  void watchMotion(const CArmState& state, std::int64_t now_us);
  CArmCommand commandOf(const CArmJoints& velocity, std::int64_t valid_us = kValid_us);
  std::optional<CArmCommand> move(std::int64_t now_us);
  void add(const std::string& name, bool good, std::string measured, std::string asked) {
    found.push_back({name, good ? CheckVerdict::kPass : CheckVerdict::kFail, std::move(measured), std::move(asked)});
  }
  void judgeStates(std::vector<CheckRow>& rows) const;
  void judgeFrames(std::vector<CheckRow>& rows) const;

  MachineCheckSettings settings;
  VesselTree tree;
  Perception perception;
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
  double worst_velocity = 1;                   // Share of the motion that they explain, the worst.
  bool velocities_seen = false;
  std::optional<Look> before, now_look;
  std::optional<double> rest_after_s;
  std::vector<CheckRow> found;
  std::optional<CheckRow> orientation;
  std::optional<std::string> aborted;
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
  now_look.reset();
  rest_after_s.reset();
  if (history.newest()) start = history.newest()->joints;
  integrated.setZero();
  commanded_us = 0;
  seen_moving = false;
}

void MachineCheck::Parts::abort(const std::string& why, std::int64_t now_us) {
  if (aborted) return;
  aborted = why;
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
      p.implausible = std::string(kNames[static_cast<std::size_t>(i)]) + " is no finite number";
    } else if (state.joints[i] < limits.lower[i] - margin || state.joints[i] > limits.upper[i] + margin) {
      p.implausible = std::string(kNames[static_cast<std::size_t>(i)]) + " at " + inUnits(i, state.joints[i]) +
                      ", beyond its range: in wrong units?";
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
      abort(std::string(kNames[static_cast<std::size_t>(i)]) + " moved by " + inUnits(i, state.joints[i] - start[i]) +
                (moving ? std::string(" when ") + inUnits(step().joint, step().sign * goal(step().joint)) + " of " +
                              kNames[static_cast<std::size_t>(step().joint)] + " were asked"
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
  if (looks() && p.history.newest()) p.look(frame);
}

bool MachineCheck::looks() const {
  return parts_->step().kind == Step::Kind::kLook && (!parts_->now_look || parts_->now_look->frames < kLooks);
}

void MachineCheck::Parts::look(const XrayFrame& frame) {
  if (!now_look) now_look.emplace();
  const CArmState state = history.at(frame.time_us);
  const Observation observation = perception.observe(frame, state);
  ++now_look->frames;
  now_look->joints = state.joints;
  now_look->status = statusName(observation.registration.status);
  if (!observation.registration.reason.empty()) now_look->status += ", " + observation.registration.reason;
  if (observation.registration.status == RegistrationStatus::kConverged) {
    const Pose& T = observation.registration.T_camera_model;
    Eigen::Matrix2Xd px(2, tree.size());
    for (int i = 0; i < tree.size(); ++i) {
      const auto seen = frame.camera.project(T * tree.points().col(i));
      if (!seen) return;
      px.col(i) = *seen;
    }
    const int n = ++now_look->converged;
    if (n == 1) now_look->points_px = Eigen::Matrix2Xd::Zero(2, tree.size());
    now_look->points_px += (px - now_look->points_px) / n;
    now_look->T_camera_model = T;
  }
  const bool first = !orientation && now_look->frames == kLooks;
  if (first) nameReading(frame, observation, state);
}

void MachineCheck::Parts::nameReading(const XrayFrame& frame, const Observation& observation, const CArmState& state) {
  const std::string name = "image orientation", asked = "as seen from the source, x right, y down (xray_frame_t)";
  if (now_look->converged > 0) {
    orientation = {name, CheckVerdict::kPass, formatted("%d of %d frames register", now_look->converged, kLooks),
                   asked};
    return;
  }
  const CameraPlace place = perception.placeOf(state);
  for (const ImageReading reading : otherReadings(frame.camera)) {
    const Centerline2d read = readAs(reading, observation.centerline, frame.camera);
    const Observation again = perception.observe({XrayView{read, frame.camera}}, place);
    if (again.registration.status != RegistrationStatus::kConverged) continue;
    orientation = {name, CheckVerdict::kFail, std::string("the image matches when ") + nameOf(reading), asked};
    return;
  }
  orientation = {name, CheckVerdict::kNotSeen,
                 "no registration: " + now_look->status + "; the tree, the calibration or the joints may be wrong",
                 asked};
}

// By two looks and the encoders between them.
void MachineCheck::Parts::judgeMotion(int joint) {
  const std::string name = std::string(kNames[static_cast<std::size_t>(joint)]) + " by the X-ray";
  const std::string asked = "the image moves as the joint's sign, unit and axis say";
  const auto notSeen = [&](const std::string& why) { found.push_back({name, CheckVerdict::kNotSeen, why, asked}); };
  if (!before || before->converged == 0) return notSeen("no registration before it moved");
  if (now_look->converged == 0) return notSeen("no registration after it moved: " + now_look->status);
  const CArmGeometry& carm = settings.carm;
  const Pose expected = carm.T_camera_patient(now_look->joints) * carm.T_camera_patient(before->joints).inverse() *
                        before->T_camera_model;
  Eigen::Matrix2Xd moved(2, tree.size());
  for (int i = 0; i < tree.size(); ++i) {
    const auto from = newest_frame->camera.project(before->T_camera_model * tree.points().col(i));
    const auto to = newest_frame->camera.project(expected * tree.points().col(i));
    if (!from || !to) return notSeen("the tree is not in front of the source");
    moved.col(i) = *to - *from;
  }
  const double rms_px = std::sqrt(moved.squaredNorm() / tree.size());
  if (!(rms_px >= kMinMotion_px)) {
    return notSeen("the encoder moved by " + inUnits(joint, now_look->joints[joint] - before->joints[joint]) +
                   formatted(", which is %.2f px", rms_px));
  }
  const MotionShare share = shareOf(now_look->points_px - before->points_px, moved);
  add(name, share.share >= kMinShare && share.share <= kMaxShare && share.rest <= kMaxRest,
      wordsOf(share) + formatted(" (%.1f px)", rms_px), asked);
}

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
  const double duration_s = goal(joint) / speed(joint);
  CArmJoints velocity = CArmJoints::Zero();
  velocity[joint] = step().sign * speed(joint);
  if (since_s(now_us) < duration_s) {
    if (commanded_us == 0) commanded_us = now_us;
    return commandOf(velocity);
  }
  return std::nullopt;
}

std::optional<CArmCommand> MachineCheck::command(std::int64_t now_us) {
  using Kind = Step::Kind;
  Parts& p = *parts_;
  if (!p.began_us) p.began_us = now_us;
  const Step step = p.step();
  const double passed_s = p.since_s(now_us);
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
    case Kind::kLook: {
      const bool done = (p.now_look && p.now_look->frames >= kLooks) || passed_s > kMaxLook_s;
      if (done) {
        if (!p.now_look) p.now_look.emplace();
        if (step.joint >= 0) p.judgeMotion(step.joint);
        if (step.joint < 0) p.before = p.now_look;
        p.next(now_us);
      }
      return p.settings.move && p.sequence > 0 ? std::optional(p.commandOf(rest)) : std::nullopt;
    }
    case Kind::kMove: {
      if (auto command = p.move(now_us)) return command;
      // How far it went is seen when it stands.
      const CArmJoints from = p.start, integrated = p.integrated;
      p.next(now_us);
      p.start = from;
      p.integrated = integrated;
      return p.commandOf(rest);
    }
    case Kind::kRest: {
      if (passed_s < kSettle_s) return p.commandOf(rest);
      if (step.joint >= 0) {  // After the way out.
        const std::string name = std::string(kNames[static_cast<std::size_t>(step.joint)]) + " by its encoder";
        const std::string asked = "moves by what was commanded, 0.75 to 1.3 times";
        const double moved = p.history.newest() ? p.history.newest()->joints[step.joint] - p.start[step.joint] : 0;
        const double share = moved / p.goal(step.joint);
        const MotionShare motion{share, 0};
        if (std::abs(share) > 0.3) {
          p.velocities_seen = true;
          const double explained = p.integrated[step.joint] / moved;
          if (std::abs(explained - 1) > std::abs(p.worst_velocity - 1)) p.worst_velocity = explained;
        }
        p.add(name, share >= kMinShare && share <= kMaxShare, inUnits(step.joint, moved) + ", " + wordsOf(motion),
              asked);
      }
      p.next(now_us);
      return p.commandOf(rest);
    }
    case Kind::kSilence: {
      // Half of a motion, then nothing more is said.
      if (passed_s < 0.5 * p.goal(0) / p.speed(0)) return p.move(now_us);
      const double silent_s = passed_s - 0.5 * p.goal(0) / p.speed(0);
      const double braking_s = p.speed(0) / p.settings.limits.acceleration[0] + p.speed(0) / p.settings.limits.jerk[0];
      const double allowed_s = 1e-6 * kValid_us + kMaxLatency_s + braking_s;
      if (!p.rest_after_s && silent_s > 0.05 && p.stands()) p.rest_after_s = silent_s;
      if (silent_s < allowed_s + 0.3) return std::nullopt;
      const bool moved = p.history.newest() && std::abs(p.history.newest()->joints[0] - p.start[0]) > 0.1 * p.goal(0);
      const std::string asked =
          formatted("at rest %.2f s after the last command, valid for %.1f s", allowed_s, 1e-6 * kValid_us);
      if (!moved) {
        p.found.push_back({"watchdog", CheckVerdict::kNotSeen, "it did not move", asked});
      } else {
        p.add("watchdog", p.rest_after_s && *p.rest_after_s <= allowed_s,
              p.rest_after_s ? formatted("at rest after %.2f s", *p.rest_after_s)
                             : "still moving: silence must mean stop",
              asked);
      }
      p.next(now_us);
      return p.commandOf(rest);
    }
    case Kind::kStop: {
      if (passed_s < kSettle_s) {  // At rest first, whatever the watchdog does.
        p.start = p.history.newest() ? p.history.newest()->joints : p.start;
        return p.commandOf(rest);
      }
      CArmJoints velocity = rest;
      velocity[0] = -p.speed(0);
      const double moving_s = 0.5 * p.goal(0) / p.speed(0), since_s = passed_s - kSettle_s;
      // Valid for so long that no watchdog stops it in time.
      if (since_s < moving_s) return p.commandOf(velocity, kLongValid_us);
      const double stopped_s = since_s - moving_s;
      const double allowed_s = kMaxLatency_s + p.speed(0) / p.settings.limits.acceleration[0] + 0.1;
      if (!p.rest_after_s && stopped_s > 0.02 && p.stands()) p.rest_after_s = stopped_s;
      if (stopped_s < allowed_s + 0.3) return p.commandOf(rest);
      const std::string asked = formatted("at rest %.2f s after a command to stand still", allowed_s);
      const bool moved = p.history.newest() && std::abs(p.history.newest()->joints[0] - p.start[0]) > 0.1 * p.goal(0);
      if (!moved) {
        p.found.push_back({"stop", CheckVerdict::kNotSeen, "it did not move", asked});
      } else {
        p.add("stop", p.rest_after_s && *p.rest_after_s <= allowed_s,
              p.rest_after_s ? formatted("at rest after %.2f s", *p.rest_after_s) : "still moving", asked);
      }
      p.next(now_us);
      return p.commandOf(rest);
    }
    case Kind::kNan: {
      CArmJoints broken = rest;
      broken[0] = std::numeric_limits<double>::quiet_NaN();
      if (passed_s < 0.2) return p.commandOf(broken);
      if (passed_s < 0.2 + kMaxLatency_s) return std::nullopt;
      const auto& state = p.history.newest();
      const double moved = state ? (state->joints - p.start).cwiseAbs().maxCoeff() : 0;
      p.add("NaN", p.stands() && moved < 0.05 * p.goal(0), formatted("moved by %.4f rad", moved),
            "a command that is no finite number moves nothing");
      p.next(now_us);
      return p.commandOf(rest);
    }
    case Kind::kEnd:
      // A machine that was moved is told to stand until it does, and a little longer.
      return p.sequence > 0 && (!p.stands() || passed_s < 0.3) ? std::optional(p.commandOf(rest)) : std::nullopt;
  }
  return std::nullopt;
}

std::string MachineCheck::doing() const {
  const Step& step = parts_->step();
  const auto joint = [&] { return std::string(kNames[static_cast<std::size_t>(step.joint)]); };
  switch (step.kind) {
    case Step::Kind::kWatch:
      return "watches";
    case Step::Kind::kLook:
      return "looks at the image";
    case Step::Kind::kMove:
      return "moves " + joint();
    case Step::Kind::kRest:
      return "waits until it stands";
    case Step::Kind::kSilence:
      return "falls silent while it moves";
    case Step::Kind::kStop:
      return "stops it";
    case Step::Kind::kNan:
      return "sends what is no number";
    case Step::Kind::kEnd:
      return "has finished";
  }
  return "";
}

void MachineCheck::Parts::judgeStates(std::vector<CheckRow>& rows) const {
  rows.push_back(states.rateRow("CARM_STATE", 50, 200));
  rows.push_back(states.sequenceRow("CARM_STATE"));
  rows.push_back(states.clockRow("CARM_STATE"));
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

void MachineCheck::Parts::judgeFrames(std::vector<CheckRow>& rows) const {
  rows.push_back(frames.rateRow("XRAY_FRAME", 3, 60));
  rows.push_back(frames.sequenceRow("XRAY_FRAME"));
  rows.push_back(frames.clockRow("XRAY_FRAME"));
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
    rows.push_back({"frame age", oldest_frame_s <= kMaxFrameAge_s ? CheckVerdict::kPass : CheckVerdict::kFail,
                    formatted("%.0f ms behind the newest state, %.0f ms at most",
                              1e3 * sum_age_s / static_cast<double>(frames.count()), 1e3 * oldest_frame_s),
                    late});
  }
  const auto wrong = contradiction(newest_frame->camera, settings.carm);
  const XrayCamera::Parameters& k = newest_frame->camera.parameters();
  rows.push_back({"frame geometry", wrong ? CheckVerdict::kFail : CheckVerdict::kPass,
                  wrong.value_or(formatted("%d x %d px, fx %.1f px", k.width_px, k.height_px, k.fx_px)), focal});
}

std::vector<CheckRow> MachineCheck::rows() const {
  const Parts& p = *parts_;
  std::vector<CheckRow> rows;
  p.judgeStates(rows);
  p.judgeFrames(rows);
  rows.push_back(p.orientation.value_or(
      CheckRow{"image orientation", CheckVerdict::kNotSeen, "no frame was looked at", "as seen from the source"}));
  if (!p.settings.move) {
    rows.push_back({"motion", CheckVerdict::kNotSeen, "it was not to be moved", "--move"});
    return rows;
  }
  rows.insert(rows.end(), p.found.begin(), p.found.end());
  const std::string velocities = "joint_velocity is what joint_position changes by, 0.75 to 1.3 times";
  if (p.velocities_seen) {
    const bool good = p.worst_velocity >= kMinShare && p.worst_velocity <= kMaxShare;
    rows.push_back({"velocities", good ? CheckVerdict::kPass : CheckVerdict::kFail,
                    formatted("%.2f of the motion, of the worst joint", p.worst_velocity), velocities});
  } else {
    rows.push_back({"velocities", CheckVerdict::kNotSeen, "it did not move", velocities});
  }
  const std::string asked = formatted("%.0f ms at most from a command to motion", 1e3 * kMaxLatency_s);
  if (p.latency_s) {
    rows.push_back({"latency", *p.latency_s <= kMaxLatency_s ? CheckVerdict::kPass : CheckVerdict::kFail,
                    formatted("%.0f ms", 1e3 * *p.latency_s), asked});
  } else {
    rows.push_back({"latency", CheckVerdict::kNotSeen, "it did not move", asked});
  }
  return rows;
}

bool passed(const std::vector<CheckRow>& rows) {
  return std::none_of(rows.begin(), rows.end(), [](const CheckRow& r) { return r.verdict == CheckVerdict::kFail; });
}

std::string table(const std::vector<CheckRow>& rows) {
  std::string text;
  for (const CheckRow& r : rows) {
    const char* verdict = r.verdict == CheckVerdict::kPass   ? "pass"
                          : r.verdict == CheckVerdict::kFail ? "FAIL"
                                                             : "not seen";
    text += formatted("%-8s  %-24s  ", verdict, r.name.c_str()) + r.measured;
    if (r.verdict == CheckVerdict::kFail) text += "  (asked: " + r.asked + ")";
    text += "\n";
  }
  return text;
}

}  // namespace angio::machine_check
