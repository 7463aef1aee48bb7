// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/navigate_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "angio/experiments/observers.hpp"
#include "angio/localisation/catheter_localiser.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/simulation/nodes.hpp"

namespace angio::experiments {
namespace {

constexpr double kStart_m = 30e-3;  // Inside the tree when the journey begins.

constexpr double kSamePoint_m = 1e-6;

constexpr double kNear_m = 1.5e-3;

constexpr double kMinInto_m = 5e-3;  // A shorter branch is hardly a place to go to.

TreeLocation startOf(const TreeTopology& map, const TreeLocation& target) {
  const double route_m = map.start_m(target.branch) + target.arc_m;
  return map.before(target, route_m - std::min(kStart_m, 0.5 * route_m));
}

double narrowestOnRoute(const VesselTree& tree, const TreeTopology& map, int branch) {
  double least = 1;
  for (const int c : map.pathTo(branch)) {
    for (const int i : map.points(c)) least = std::min(least, *tree.radii()[i]);
  }
  return least;
}

void score(const TipBelief& belief, const std::optional<CatheterTrace>& trace, const SeenPose& pose,
           const CatheterTruth& truth, NavigateResult& row) {
  if (!trace) return;
  const auto end = tipEnd(trace->evidence, belief.tip);
  const double error_m = (end.value_or(tipOnRay(belief.tip, trace->seen, pose)) - truth.tip_model).norm();
  row.near_of_all += error_m <= kNear_m;
  if (belief.status != BeliefStatus::kSeen) return;
  row.errors_m.push_back(error_m);
  if (belief.tip.branch == truth.tip.branch) {
    row.arc_errors_m.push_back(std::abs(belief.tip.arc_m - truth.tip.arc_m));
  } else {
    row.wrong_branch += error_m > 2e-3;
  }
}

}  // namespace

SimulatedPatientSettings navigatePatient(SimulatedPatientSettings patient) {
  patient.device.kind = DeviceKind::kNone;
  patient.bolus.enabled = true;
  patient.bolus.trigger = BolusTrigger::kDemand;
  return patient;
}

CatheterSettings navigateCatheter(CatheterSettings catheter, int seed) {
  // By the golden angle: seeds in a row are far from each other, and spread evenly.
  catheter.roll_zero_deg = std::fmod(137.50776405 * seed, 360);
  return catheter;
}

CArmSetup navigateSetup(const Scenario& world, const CArmLimits& limits) {
  return {world.calibrated.carm, limits, world.calibrated.T_dsa_cb, world.truth.R_lps_model};
}

std::vector<TreeLocation> navigateTargets(const VesselTree& tree, const NavigateExperimentSettings& experiment,
                                          int count) {
  const VesselTree full = withPlausibleRadii(tree, 0.6e-3);
  const TreeTopology map(full);
  // Journeys begin at the root that most branches hang on.
  std::vector<int> hanging(map.branchCount(), 0);
  for (int c = 0; c < map.branchCount(); ++c) ++hanging[map.pathTo(c).front()];
  const auto root = static_cast<int>(std::max_element(hanging.begin(), hanging.end()) - hanging.begin());
  std::vector<TreeLocation> fit, spread;
  for (int c = 0; c < map.branchCount(); ++c) {
    const TreeLocation place{c, std::min(1e-3 * experiment.into_branch_mm, 0.8 * map.length_m(c))};
    if (map.pathTo(c).front() != root || place.arc_m < kMinInto_m || map.start_m(c) < 1e-3 * experiment.min_route_mm)
      continue;
    if (narrowestOnRoute(full, map, c) >= 1e-3 * experiment.min_radius_mm) fit.push_back(place);
  }
  const int n = std::min(count, static_cast<int>(fit.size()));
  for (int k = 0; k < n; ++k)
    spread.push_back(fit[static_cast<std::size_t>(k) * fit.size() / static_cast<std::size_t>(n)]);
  return spread;
}

std::vector<TreeLocation> targetsAlong(const VesselTree& tree, const NavigateExperimentSettings& experiment,
                                       const std::vector<Eigen::Matrix3Xd>& curves, int count) {
  const TreeTopology map(withPlausibleRadii(tree, 0.6e-3));
  // Where each of the tree's points is; a fork's is the end of the branch that leads to it.
  std::vector<std::optional<TreeLocation>> places(static_cast<std::size_t>(tree.size()));
  for (int c = 0; c < map.branchCount(); ++c) {
    double arc_m = 0;
    int before = map.points(c).front();
    for (const int i : map.points(c)) {
      arc_m += (tree.points().col(i) - tree.points().col(before)).norm();
      before = i;
      if (arc_m > 0) places[static_cast<std::size_t>(i)] = TreeLocation{c, std::min(arc_m, map.length_m(c))};
    }
  }
  std::vector<std::vector<TreeLocation>> along;
  for (const Eigen::Matrix3Xd& curve : curves) {
    std::vector<TreeLocation> fit;
    for (Eigen::Index k = 0; k < curve.cols(); ++k) {
      Eigen::Index i = 0;
      if ((tree.points().colwise() - curve.col(k)).colwise().squaredNorm().minCoeff(&i) > kSamePoint_m * kSamePoint_m)
        continue;
      const auto& place = places[static_cast<std::size_t>(i)];
      if (place && map.start_m(place->branch) + place->arc_m >= 1e-3 * experiment.min_route_mm) fit.push_back(*place);
    }
    if (!fit.empty()) along.push_back(std::move(fit));
  }
  std::vector<TreeLocation> targets;
  if (along.empty()) return targets;
  const auto curves_used = static_cast<int>(along.size());
  for (int k = 0; k < count; ++k) {
    const std::vector<TreeLocation>& fit = along[static_cast<std::size_t>(k % curves_used)];
    const int here = (count - 1 - k % curves_used) / curves_used + 1;  // Targets on this curve.
    const double share = (k / curves_used + 0.5) / here;
    targets.push_back(fit[static_cast<std::size_t>(share * static_cast<double>(fit.size() - 1))]);
  }
  return targets;
}

namespace {

// The same detector with fewer pixels, and the tree's centroid at the isocentre.
CArmCalibration laboratoryOf(const VesselTree& tree, const CArmCalibration& nominal, int detector_px) {
  CArmCalibration lab = withDetectorPixels(nominal, detector_px);
  lab.T_dsa_cb.translation() = -(lab.T_dsa_cb.linear() * tree.centroid());
  return lab;
}

ScenarioSettings settingsOf(const NavigateExperimentSettings& experiment, int seed) {
  ScenarioSettings settings;
  settings.patient_turn_deg = settings.patient_shift_mm = 0;
  settings.calibration_error_deg = experiment.calibration_error_deg;
  settings.calibration_error_mm = experiment.calibration_error_mm;
  settings.lab = experiment.lab;
  settings.seed = seed;
  return settings;
}

// The parties of one journey.
class Journey {
 public:
  Journey(const VesselTree& full, const Scenario& world, const TreeLocation& start, const TreeLocation& target,
          const NavigateExperimentSettings& experiment, const NavigateParts& parts, int seed)
      : lab_(labOf(full, world, settingsOf(experiment, seed), carmLoop(world, parts), navigatePatient(parts.patient),
                   LabCatheter{navigateCatheter(parts.catheter, seed), start})),
        injector_(lab_.fromMachines(), experiment.roadmap_contrast_s),
        carm_(lab_.loopSide(), carmLoop(world, parts), full),
        catheter_(lab_.loopSide(), navigateSetup(world, parts.carm_loop.limits), full, start, target,
                  controllerOf(parts)),
        carm_person_(lab_.fromMachines()),
        catheter_person_(lab_.fromMachines(), OperatedMachine::kCatheter),
        limits_(parts.carm_loop.limits) {}

  // One event in the lab, and what the nodes make of it; the catheter's answer, if it was to a frame.
  std::optional<CatheterControllerReport> advance() {
    if (const auto exposure = lab_.advance()) exposure_ = exposure;
    const std::int64_t now_us = lab_.now_us();
    limits_.see(lab_.arm().state());
    if (injector_.injects(now_us)) {
      lab_.beginInjection();
    } else {
      lab_.endInjection();
    }
    carm_person_.start(now_us);
    catheter_person_.start(now_us);
    carm_.answer(now_us);
    return catheter_.answer(now_us);
  }

  const SimulatedLab& lab() const { return lab_; }
  const Exposure& exposure() const { return *exposure_; }
  const CatheterNode& catheter() const { return catheter_; }
  const std::optional<std::string>& breach() const { return limits_.breach(); }

 private:
  static ServoLoopSettings carmLoop(const Scenario& world, const NavigateParts& parts) {
    ServoLoopSettings loop = loopIn(world, parts.carm_loop);
    ViewTaskSettings view;
    view.goal = ViewGoal::kRequested;
    loop.task = view;
    return loop;
  }

  static CatheterControllerSettings controllerOf(const NavigateParts& parts) {
    CatheterControllerSettings controller = parts.controller;
    controller.ask_for_views = true;
    return controller;
  }

  SimulatedLab lab_;
  SimulatedInjector injector_;
  ServoNode carm_;
  CatheterNode catheter_;
  Operator carm_person_, catheter_person_;
  LimitObserver limits_;
  std::optional<Exposure> exposure_;
};

}  // namespace

NavigateResult runNavigationExperiment(const VesselTree& tree, const CArmCalibration& nominal,
                                       const TreeLocation& target, const NavigateExperimentSettings& experiment,
                                       const NavigateParts& parts, int seed, const NavigateObserver& observer) {
  checkSettings("navigate", experiment);
  const VesselTree full = withPlausibleRadii(tree, 1e-3 * parts.patient.fluoroscopy.end_radius_mm);
  const TreeTopology map(full);
  const TreeLocation start = startOf(map, target);
  const Scenario world =
      randomScenario(full, laboratoryOf(full, nominal, experiment.detector_px), settingsOf(experiment, seed), {});
  Journey journey(full, world, start, target, experiment, parts, seed);

  NavigateResult row;
  row.seed = seed;
  row.target = target;
  row.route_m = map.start_m(target.branch) + target.arc_m - map.start_m(start.branch) - start.arc_m;
  row.forks = static_cast<int>(map.pathTo(target.branch).size()) - 1;
  row.ended = "too long";
  std::int64_t request_us = 0;
  while (journey.lab().now_s() < experiment.max_s) {
    const auto report = journey.advance();
    if (!report) continue;
    if (report->view_request && report->view_request->time_us != request_us) {
      request_us = report->view_request->time_us;
      ++row.views;
    }
    const CatheterTruth& truth = *journey.exposure().catheter;
    const NavigationInput& input = report->loop.input;
    row.looked += input.belief.has_value();
    if (input.belief && report->patient) {
      score(*input.belief, report->loop.trace,
            {journey.exposure().frame.camera, report->patient->T_camera_model, report->patient->covariance}, truth,
            row);
    }
    if (observer) {
      ServoStatus status;
      journey.catheter().safety().describe(status);
      observer({journey.lab().now_s(), journey.exposure().frame, *report, status, truth});
    }
    ++row.frames;
    row.held += report->hold_reason.has_value();
    row.max_force_n = std::max(truth.max_push_n, truth.max_pull_n);
    row.max_tip_force_n = truth.max_tip_force_n;
    row.wall_contacts = truth.wall_contacts;
    row.time_s = journey.lab().now_s();
    const NavigationState state = journey.catheter().loop().navigation();
    if (state == NavigationState::kArrived || state == NavigationState::kGivenUp) {
      const std::string& why = report->loop.answer.why;
      row.reached = state == NavigationState::kArrived && truth.tip.branch == target.branch;
      row.ended = stateName(state) + (why.empty() ? "" : ": " + why);
      break;
    }
  }
  row.breach = journey.breach();
  row.misses = journey.catheter().loop().misses();
  return row;
}

namespace {

const std::vector<Column<NavigateResult>>& navigateColumns() {
  using R = const NavigateResult&;
  const auto near = [](R r) {
    return std::count_if(r.errors_m.begin(), r.errors_m.end(), [](double e) { return e <= kNear_m; });
  };
  const auto millimetres = [](const std::vector<double>& lengths_m) {
    Json all = Json::array();
    for (const double length_m : lengths_m) all.push_back(1e3 * length_m);
    return all;
  };
  static const std::vector<Column<NavigateResult>> kColumns = {
      {"seed", "", "", [](R r) { return r.seed; }},
      {"branch", "", "", [](R r) { return r.target.branch; }},
      {"into_branch_mm", "", "", [](R r) { return 1e3 * r.target.arc_m; }},
      {"reached", "reached", "sum", [](R r) { return r.reached; }},
      {"ended", "", "", [](R r) { return r.ended; }},
      {"time_s", "time_s", "median max", [](R r) { return r.time_s; }},
      {"way_mm", "", "", [](R r) { return 1e3 * r.route_m; }},
      {"forks", "forks", "sum", [](R r) { return r.forks; }},
      {"misses", "misses", "sum", [](R r) { return r.misses; }},
      {"views", "views", "sum", [](R r) { return r.views; }},
      {"wall_contacts", "wall_contacts", "median max", [](R r) { return r.wall_contacts; }},
      {"frames_with_catheter", "frames_with_catheter", "sum", [](R r) { return r.looked; }},
      {"believed", "believed", "sum", [](R r) { return r.errors_m.size(); }},
      {"within_1.5", "near", "sum", near},
      {"near_of_all", "near_of_all", "sum", [](R r) { return r.near_of_all; }},
      {"max_force_n", "max_force_n", "max", [](R r) { return r.max_force_n; }},
      {"max_tip_force_n", "max_tip_force_n", "max", [](R r) { return r.max_tip_force_n; }},
      {"", "frames", "sum", [](R r) { return r.frames; }},
      {"", "held", "sum", [](R r) { return r.held; }},
      {"", "limits_exceeded", "sum", [](R r) { return r.breach.has_value(); }},
      {"", "wrong_chain", "sum", [](R r) { return r.wrong_branch; }},
      {"", "tip_error_mm", "median p95", [=](R r) { return millimetres(r.errors_m); }},
      {"", "along_vessel_mm", "median p95", [=](R r) { return millimetres(r.arc_errors_m); }}};
  return kColumns;
}

}  // namespace

Json navigateExperimentAsJson(const std::string& tree_name, const std::vector<NavigateResult>& rows) {
  Json json = {{"tree", tree_name}, {"targets", rows.size()}};
  summarise(rows, navigateColumns(), json);
  const auto share = [&](const char* of, const char* all) {
    return json[of].get<double>() / std::max(1, json[all].get<int>());
  };
  json["tip_error_mm"]["within_1.5"] = share("near", "believed");
  json["within_1.5_of_all"] = share("near_of_all", "frames_with_catheter");
  json.erase("near");
  json.erase("near_of_all");
  json["each"] = rowsOf(rows, navigateColumns());
  return json;
}

std::string navigateExperimentTable(const Json& trees) {
  std::string table =
      "navigate                   reached   forks  misses   views    wall contacts     force  tip's force   within     "
      " believed "
      "        tip error mm     within     held  limits         time s\n"
      "                                                              median (most)    most N       most N   1.5 mm     "
      "   frames "
      "       median (95 %)     1.5 mm   frames  broken  median (most)\n";
  for (Json tree : trees) {
    const auto percent = [&](const char* of, const char* all) {
      return 100.0 * tree[of].get<int>() / std::max(1, tree[all].get<int>());
    };
    tree["believed_percent"] = percent("believed", "frames_with_catheter");
    tree["held_percent"] = percent("held", "frames");
    table += filled(
        "{tree:%-24s} {reached:%4d} / {targets:%2d} {forks:%7d} {misses:%7d} {views:%7d} "
        "{wall_contacts/median:%10.0f} ({wall_contacts/max:%3.0f}) {max_force_n:%9.2f} {max_tip_force_n:%12.2f} "
        "{100*within_1.5_of_all:%6.1f "
        "%%} "
        "{believed_percent:%11.1f %%} {tip_error_mm/median:%11.2f} ({tip_error_mm/p95:%5.2f}) "
        "{100*tip_error_mm/within_1.5:%8.1f %%} {held_percent:%6.1f %%} {limits_exceeded:%7d} {time_s/median:%7.0f} "
        "({time_s/max:%4.0f})\n",
        tree);
  }
  return table;
}

}  // namespace angio::experiments
