// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rehearsal/fault_campaign.hpp"

#include <cmath>

#include "angio/messaging/channels.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/rehearsal/command_observer.hpp"
#include "angio/rehearsal/limit_observer.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_node.hpp"
#include "injected_fault.hpp"

namespace angio {
namespace {

// Asks for what leads to servoing, as one who looks at the screen, and resets only when the fault is over.
class FaultOperator {
 public:
  explicit FaultOperator(Bus& bus) : operator_(bus) {}

  void act(std::int64_t now_us, bool fault_lasts) {
    const ServoState state = operator_.status() ? operator_.status()->state : ServoState::kIdle;
    if (fault_lasts || (last_us_ && now_us - *last_us_ < kPatience_us)) return;
    if (state == ServoState::kHold || state == ServoState::kServo) return;
    operator_.ask(state == ServoState::kIdle    ? ServoRequestKind::kArm
                  : state == ServoState::kArmed ? ServoRequestKind::kStart
                                                : ServoRequestKind::kReset,
                  now_us);
    last_us_ = now_us;
  }

 private:
  static constexpr std::int64_t kPatience_us = 150'000;
  Operator operator_;
  std::optional<std::int64_t> last_us_;
};

// The same vessels, turned, mirrored and smaller: nobody's in this room.
VesselTree otherPatient(const VesselTree& tree) {
  const Eigen::Vector3d centroid = tree.centroid();
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(0.3, 0.2, 1.2)) * Eigen::Vector3d(-0.85, 0.85, 0.85).asDiagonal();
  Eigen::Matrix3Xd points = (turn * (tree.points().colwise() - centroid)).colwise() + centroid;
  return VesselTree(points, tree.parents(), tree.radii());
}

// One run's parties and witnesses.
class Run {
 public:
  Run(const VesselTree& tree, const RehearsalWorld& world, const RehearsalSettings& rehearsal,
      const ServoLoopSettings& loop, const SimulatedPatientSettings& patient, const FaultCampaignSettings& campaign,
      FaultKind kind)
      : tree_(tree),
        loop_(loop),
        truth_(world.truth),
        target_(loop.target_model.value_or(tree.centroid())),
        room_(roomOf(tree, world, rehearsal, loop, patient)),
        other_bus_(openBus("memq://")),
        other_(*other_bus_, otherPatient(tree), patient, world.truth.carm, world.truth.T_dsa_cb, loop.carm.camera()),
        fault_(kind, rehearsal.seed, rehearsal.room.command_latency_ms, room_, other_),
        limits_(loop.limits),
        commands_(loop.limits, 1e-3 * campaign.most_command_age_ms),
        operator_(room_.fromMachines()) {
    room_.tamperWithFrames([this](XrayFrame& frame) { spoilt_ = fault_.tamper(frame); });
    room_.loopSide().subscribe(kCArmCommandChannel, [this](const std::uint8_t* data, std::size_t size) {
      const auto command = decode<CArmCommand>(data, size);
      if (command.value) commands_.arrived(*command.value, room_.now_us());
    });
    startNode();
  }

  void startNode() { node_.emplace(room_.loopSide(), loop_, tree_); }
  void killNode() { node_.reset(); }

  // One event in the room, and what everybody makes of it.
  void step() {
    const auto exposure = room_.advance();
    const CArmState truth = room_.arm().state();
    limits_.see(truth);
    commands_.see(truth);
    if (exposure) {
      commands_.exposed(exposure->frame.sequence, room_.now_us(), spoilt_);
      fault_.spoil(room_.now_us());
    }
    if (node_) {
      node_->answer(room_.now_us());
      const bool servoes = node_->safety().moves();
      if (servoes && !servoes_since_us_) servoes_since_us_ = room_.now_us();
      if (!servoes) servoes_since_us_.reset();
    } else {
      servoes_since_us_.reset();
    }
    operator_.act(room_.now_us(), fault_.lasts());
  }

  // While the node runs.
  ViewError trueError() const {
    const auto desired = node_->loop().task().desired_T_camera_model();
    if (!desired) return {};
    return viewError(truth_.carm.T_camera_patient(room_.arm().state().joints) * truth_.T_dsa_cb, *desired, target_);
  }

  // What the supervisor's log says since a time.
  std::vector<std::string> causesSince(std::int64_t time_us) const {
    std::vector<std::string> causes;
    if (!node_) return causes;
    for (const auto& t : node_->safety().states().log()) {
      if (t.time_us > time_us) causes.push_back(std::string(nameOf(t.to)) + ": " + t.reason);
    }
    return causes;
  }

  SimulatedRoom& room() { return room_; }
  InjectedFault& fault() { return fault_; }
  bool servoes() const { return servoes_since_us_.has_value(); }
  std::optional<std::int64_t> servoesSince_us() const { return servoes_since_us_; }
  std::optional<std::string> breach() const { return limits_.breach() ? limits_.breach() : commands_.breach(); }
  int unsound() const { return commands_.unsound(); }

 private:
  const VesselTree& tree_;
  ServoLoopSettings loop_;
  CArmCalibration truth_;
  Eigen::Vector3d target_;
  SimulatedRoom room_;
  std::unique_ptr<Bus> other_bus_;
  SimulatedXrayNode other_;
  InjectedFault fault_;
  LimitObserver limits_;
  CommandObserver commands_;
  FaultOperator operator_;
  std::optional<ServoNode> node_;
  std::optional<std::string> spoilt_;
  std::optional<std::int64_t> servoes_since_us_;
};

double symmetric(std::mt19937_64& engine) { return 2 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1; }

}  // namespace

FaultRow runFault(const VesselTree& tree, const CArmCalibration& nominal, const FaultCampaignSettings& campaign,
                  FaultKind kind, RehearsalSettings rehearsal, ServoLoopSettings parts,
                  const SimulatedPatientSettings& patient) {
  checkSettings("fault campaign", campaign);
  std::mt19937_64 engine(static_cast<std::uint64_t>(rehearsal.seed) ^ 0x63616d70);
  const auto randomView = [&] {
    const double primary = symmetric(engine) * campaign.most_primary_deg;
    return ViewAngles{degToRad(primary), degToRad(symmetric(engine) * campaign.most_secondary_deg)};
  };
  const ViewAngles start = randomView(), goal = randomView();
  rehearsal.start_primary_deg = radToDeg(start.primary_rad);
  rehearsal.start_secondary_deg = radToDeg(start.secondary_rad);
  ViewTaskSettings view;
  view.primary_deg = radToDeg(goal.primary_rad);
  view.secondary_deg = radToDeg(goal.secondary_rad);
  parts.task = view;
  CArmCalibration small = nominal;  // The same detector, with fewer pixels.
  small.carm.pixel_spacing_m *= static_cast<double>(small.carm.image_width_px) / campaign.image_px;
  small.carm.image_width_px = small.carm.image_height_px = campaign.image_px;
  const RehearsalWorld world = madeUpWorld(tree, small, rehearsal, goal);
  Run run(tree, world, rehearsal, loopIn(world, parts), patient, campaign, kind);

  FaultRow row;
  row.seed = rehearsal.seed;
  row.kind = kind;
  row.fault = run.fault().description();
  const auto until = [&](double time_s) {
    while (run.room().now_s() < time_s) run.step();
  };
  until(campaign.sound_s);
  row.moved_before = run.servoes();
  row.error_at_fault = run.trueError();
  const std::int64_t begun_us = run.room().now_us();
  run.fault().begin();
  if (kind == FaultKind::kKilledNode) run.killNode();
  until(campaign.sound_s + campaign.disturbed_s);
  row.causes = run.causesSince(begun_us);
  run.fault().end();
  if (kind == FaultKind::kKilledNode) run.startNode();
  const std::int64_t ended_us = run.room().now_us();
  until(campaign.sound_s + campaign.disturbed_s + campaign.recovery_s);
  if (const auto since_us = run.servoesSince_us()) {
    row.recovered_s = std::max(0.0, 1e-6 * static_cast<double>(*since_us - ended_us));
  }
  row.error_at_end = run.trueError();
  row.breach = run.breach();
  row.unsound_commands = run.unsound();
  return row;
}

}  // namespace angio
