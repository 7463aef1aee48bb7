// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/fault_experiment.hpp"

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/experiments/navigate_experiment.hpp"
#include "angio/experiments/observers.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/types/channels.hpp"
#include "injected_fault.hpp"

namespace angio::experiments {
namespace {

// How a run goes.
struct Course {
  double sound_s = 2;               // Until the fault begins ...
  double disturbed_s = 2;           // ... while it lasts; late frames are late for at least as long as it was sound ...
  double recovery_s = 3;            // ... and from its end to the run's.
  double max_primary_deg = 30;      // Views are spread evenly over +- this ...
  double max_secondary_deg = 15;    // ... and this; the start is between them.
  double max_command_age_ms = 350;  // A command for motion that arrives later after its exposure is a stale one.
  double max_frame_age_ms = 300;    // Of a frame that a loop may move by, as its own settings say ...
  double frame_age_margin_ms = 20;  // ... and so much above it counts as late: loops know the quickest frame's only.
  double steady_s = 0.5;            // So long it has to servo on end to have recovered.
};

// A catheter's roadmap comes first, and once more for a loop that starts anew.
Course courseOf(OperatedMachine machine) {
  Course course;
  if (machine == OperatedMachine::kCArm) return course;
  course.sound_s = course.recovery_s = 6;
  course.max_frame_age_ms = 200;
  course.max_primary_deg = course.max_secondary_deg = 0;
  return course;
}

constexpr int kImage_px = 512;

// Asks for what leads to servoing, as one who looks at the screen, and resets only when the fault is over.
class FaultOperator {
 public:
  FaultOperator(Bus& bus, OperatedMachine machine) : operator_(bus, machine) {}

  void act(std::int64_t now_us, bool fault_lasts) {
    const ServoState state = operator_.status() ? operator_.status()->state : ServoState::kIdle;
    if (state == ServoState::kHold || state == ServoState::kServo) return;
    const bool latched = state != ServoState::kIdle && state != ServoState::kArmed;
    if ((latched && fault_lasts) || (last_us_ && now_us - *last_us_ < kPatience_us)) return;
    operator_.ask(state == ServoState::kIdle    ? ServoRequestKind::kArm
                  : state == ServoState::kArmed ? ServoRequestKind::kStart
                                                : ServoRequestKind::kReset,
                  now_us);
    last_us_ = now_us;
  }

  const std::optional<ServoStatus>& status() const { return operator_.status(); }

 private:
  static constexpr std::int64_t kPatience_us = 150'000;
  Operator operator_;
  std::optional<std::int64_t> last_us_;
};

// The same vessels, turned, mirrored and smaller: nobody's in this lab.
VesselTree otherPatient(const VesselTree& tree) {
  const Eigen::Vector3d centroid = tree.centroid();
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(0.3, 0.2, 1.2)) * Eigen::Vector3d(-0.85, 0.85, 0.85).asDiagonal();
  Eigen::Matrix3Xd points = (turn * (tree.points().colwise() - centroid)).colwise() + centroid;
  return VesselTree(points, tree.parents(), tree.radii());
}

constexpr int kCatheterTargets = 20;
constexpr double kInside_m = 30e-3;   // Inside the tree, a catheter's start is at least ...
constexpr double kMinWay_m = 130e-3;  // ... and before its target, less what it is inside.

// What there is, and what the loops are told of it.
struct Scene {
  const VesselTree& tree;
  Scenario world;
  FaultParts parts;
  std::optional<LabCatheter> catheter;
  TreeLocation target;  // Of the catheter.
};

// What the experiment has to know of a machine: its node, its truth, and what else a person does for it.
struct CArmMachine {
  using Node = ServoNode;
  using Command = CArmCommand;
  static constexpr OperatedMachine kMachine = OperatedMachine::kCArm;
  static constexpr const char* kCommandChannel = kCArmCommandChannel;

  const Scene& scene;

  AxesLimits limits() const { return scene.parts.carm_loop.limits; }
  static AxesState state(const SimulatedLab& lab) { return lab.arm().state(); }
  void start(std::optional<Node>& node, SimulatedLab& lab) const {
    node.emplace(lab.loopSide(), scene.parts.carm_loop, scene.tree);
  }
  static void assist(SimulatedLab&, const std::optional<ServoStatus>&) {}
  void hear(const ServoReport&) {}
  std::optional<double> error(const SimulatedLab& lab, const Node& node) const {
    const auto desired = node.loop().task().desired_T_camera_model();
    if (!desired) return std::nullopt;
    const CArmCalibration& truth = scene.world.truth;
    const Pose seen = truth.carm.T_camera_patient(lab.arm().state().joints) * truth.T_dsa_cb;
    const auto target = targetOf(scene.parts.carm_loop, scene.tree);
    return radToDeg(viewError(seen, *desired, target).direction_rad);
  }
};

struct CatheterMachine {
  using Node = CatheterNode;
  using Command = CatheterCommand;
  static constexpr OperatedMachine kMachine = OperatedMachine::kCatheter;
  static constexpr const char* kCommandChannel = kCatheterCommandChannel;

  const Scene& scene;
  std::optional<double> estimated_m = {};  // Of the tip, from the root; nothing: the newest frame did not tell.

  AxesLimits limits() const { return scene.catheter->settings; }
  static AxesState state(const SimulatedLab& lab) { return lab.catheter().state(); }
  // The person who starts the program says where the tip is.
  void start(std::optional<Node>& node, SimulatedLab& lab) const {
    node.emplace(lab.loopSide(), navigateSetup(scene.world, scene.parts.carm_loop.limits), scene.tree,
                 lab.catheter().truth().tip, scene.target, scene.parts.controller);
  }
  // Contrast agent for a loop that waits for a roadmap.
  static void assist(SimulatedLab& lab, const std::optional<ServoStatus>& status) {
    if (status && status->reason.rfind("waits for a roadmap", 0) == 0) {
      lab.beginInjection();
    } else {
      lab.endInjection();
    }
  }
  void hear(const CatheterControllerReport& report) {
    const auto& belief = report.loop.input.belief;
    estimated_m.reset();
    if (belief && belief->status == BeliefStatus::kSeen) estimated_m = belief->tip.path_m;
  }
  std::optional<double> error(const SimulatedLab& lab, const Node&) const {
    if (!estimated_m) return std::nullopt;
    return 1e3 * std::abs(*estimated_m - lab.catheter().truth().path_m);
  }
};

// One run's parties and witnesses.
template <typename Machine>
class Run {
 public:
  Run(const Scene& scene, const Course& course, FaultKind kind)
      : machine_{scene},
        lab_(labOf(scene.tree, scene.world, scene.parts.scenario, scene.parts.carm_loop, scene.parts.patient,
                   scene.catheter)),
        other_(otherPatient(scene.tree), scene.parts.patient, scene.world.truth.carm, scene.world.truth.T_dsa_cb,
               scene.parts.carm_loop.carm.camera()),
        fault_(kind, Machine::kMachine, scene.parts.scenario.seed, scene.parts.scenario.lab.command_latency_ms,
               1e-3 * course.max_frame_age_ms, lab_, other_),
        limits_(machine_.limits()),
        commands_(machine_.limits(), 1e-3 * course.max_command_age_ms,
                  1e-3 * (course.max_frame_age_ms + course.frame_age_margin_ms)),
        operator_(lab_.fromMachines(), Machine::kMachine),
        steady_us_(std::llround(1e6 * course.steady_s)) {
    lab_.tamperWithFrames([this](XrayFrame& frame) { spoilt_ = fault_.tamper(frame); });
    lab_.loopSide().subscribe(Machine::kCommandChannel, [this](const std::uint8_t* data, std::size_t size) {
      const auto command = decode<typename Machine::Command>(data, size);
      if (command.value) commands_.arrived(*command.value, lab_.now_us());
    });
    if (scene.catheter) {
      other_.show([this](const Eigen::Matrix3Xd& points) { return lab_.catheter().device(points); });
    }
    machine_.start(node_, lab_);
  }

  void beginFault() {
    fault_.begin();
    if (fault_.kills()) node_.reset();
    if (fault_.startsAnewAtOnce()) machine_.start(node_, lab_);
  }

  void endFault() {
    fault_.end();
    if (!node_) machine_.start(node_, lab_);
    recovered_us_.reset();
    steady_ = false;
  }

  void until(double time_s) {
    while (lab_.now_s() < time_s) step();
  }

  // What the supervisor's log says since a time.
  std::vector<std::string> causesSince(std::int64_t time_us) const {
    std::vector<std::string> causes;
    if (!node_) return causes;
    for (const auto& t : node_->states().log()) {
      if (t.time_us > time_us) causes.push_back(std::string(nameOf(t.to)) + ": " + t.reason);
    }
    return causes;
  }

  std::int64_t now_us() const { return lab_.now_us(); }
  const InjectedFault& fault() const { return fault_; }
  bool servoes() const { return node_ && node_->states().moves(); }
  std::optional<double> error() const { return machine_.error(lab_, *node_); }  // While the node runs.
  // Since when it has servoed steadily, since the fault's end if that has come.
  std::optional<std::int64_t> recovered_us() const { return steady_ ? recovered_us_ : std::nullopt; }
  std::optional<std::string> breach() const { return limits_.breach() ? limits_.breach() : commands_.breach(); }
  int unsound() const { return commands_.unsound(); }

 private:
  // One event in the lab, and what everybody makes of it.
  void step() {
    const auto exposure = lab_.advance();
    const std::int64_t now_us = lab_.now_us();
    const AxesState truth = Machine::state(lab_);
    limits_.see(truth);
    commands_.see(truth);
    if (exposure) {
      commands_.exposed(exposure->frame.sequence, now_us, spoilt_);
      fault_.spoil(now_us);
    }
    if (node_) {
      if (const auto report = node_->answer(now_us)) {
        commands_.sent(report->command, now_us);
        machine_.hear(*report);
      }
    }
    if (!steady_) {
      if (!servoes()) recovered_us_.reset();
      if (servoes() && !recovered_us_) recovered_us_ = now_us;
      steady_ = recovered_us_ && now_us - *recovered_us_ >= steady_us_;
    }
    operator_.act(now_us, fault_.lasts());
    Machine::assist(lab_, operator_.status());
  }

  Machine machine_;
  SimulatedLab lab_;
  SimulatedXrayNode other_;
  InjectedFault fault_;
  LimitObserver limits_;
  CommandObserver commands_;
  FaultOperator operator_;
  std::optional<typename Machine::Node> node_;
  std::optional<std::string> spoilt_;
  std::optional<std::int64_t> recovered_us_;
  std::int64_t steady_us_;
  bool steady_ = false;
};

template <typename Machine>
FaultResult run(const Scene& scene, const Course& course, FaultKind kind) {
  Run<Machine> run(scene, course, kind);
  FaultResult row;
  row.machine = Machine::kMachine;
  row.seed = scene.parts.scenario.seed;
  row.kind = kind;
  row.fault = run.fault().description();
  run.until(course.sound_s);
  row.moved_before = run.servoes();
  row.error_at_fault = run.error();
  const std::int64_t begun_us = run.now_us();
  run.beginFault();
  const double lasts_s =
      run.fault().startsAnewAtOnce() ? std::max(course.sound_s, course.disturbed_s) : course.disturbed_s;
  run.until(course.sound_s + lasts_s);
  row.causes = run.causesSince(begun_us);
  run.endFault();
  const std::int64_t ended_us = run.now_us();
  run.until(course.sound_s + lasts_s + course.recovery_s);
  if (const auto since_us = run.recovered_us()) {
    row.recovered_s = std::max(0.0, 1e-6 * static_cast<double>(*since_us - ended_us));
  }
  row.error_at_end = run.error();
  row.breach = run.breach();
  row.unsound_commands = run.unsound();
  return row;
}

}  // namespace

FaultResult runFault(OperatedMachine machine, FaultKind kind, const VesselTree& tree, const CArmCalibration& nominal,
                     FaultParts parts) {
  const Course course = courseOf(machine);
  std::mt19937_64 engine(static_cast<std::uint64_t>(parts.scenario.seed) ^ 0x63616d70);
  const ViewAngles goal =
      drawViews(engine, course.max_primary_deg, course.max_secondary_deg, parts.scenario, parts.carm_loop).second;
  const Scenario world = randomScenario(tree, withDetectorPixels(nominal, kImage_px), parts.scenario, goal);
  parts.carm_loop = loopIn(world, parts.carm_loop);
  if (machine == OperatedMachine::kCArm) return run<CArmMachine>({tree, world, parts, {}, {}}, course, kind);

  parts.patient = navigatePatient(parts.patient);
  const VesselTree full = withPlausibleRadii(tree, 1e-3 * parts.patient.fluoroscopy.end_radius_mm);
  const auto targets = navigateTargets(full, {}, kCatheterTargets);
  if (targets.empty()) throw InputError("fault experiment", "tree", "", "has no branch that a catheter can go to");
  const TreeLocation target = targets[static_cast<std::size_t>(parts.scenario.seed) % targets.size()];
  parts.catheter = navigateCatheter(parts.catheter, parts.scenario.seed);
  const TreeTopology map(full);
  const double route_m = map.start_m(target.branch) + target.arc_m,
               uniform = static_cast<double>(engine() >> 11) * 0x1p-53;
  const double before_m = std::max(0.5 * route_m, route_m - kInside_m - uniform * std::max(0.0, route_m - kMinWay_m));
  const LabCatheter catheter{parts.catheter, map.before(target, before_m)};
  return run<CatheterMachine>({full, world, parts, catheter, target}, course, kind);
}

}  // namespace angio::experiments
