// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rehearsal/navigate_study.hpp"

#include <algorithm>
#include <cmath>
#include <deque>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/localisation/tip_on_ray.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "navigate_sight.hpp"

namespace angio {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kStart_m = 30e-3;  // Inside the tree when the journey begins.

constexpr double kLeastInto_m = 5e-3;  // A shorter branch is hardly a place to go to.

TreePlace startOf(const TreeMap& map, const TreePlace& target) {
  const double way_m = map.start_m(target.chain) + target.arc_m;
  return map.before(target, way_m - std::min(kStart_m, 0.5 * way_m));
}

double narrowestOnWay(const VesselTree& tree, const TreeMap& map, int chain) {
  double least = 1;
  for (const int c : map.pathTo(chain)) {
    for (const int i : map.points(c)) least = std::min(least, *tree.radii()[i]);
  }
  return least;
}

// Commands on their way to the drive.
class CommandLine {
 public:
  explicit CommandLine(double latency_ms) : latency_us_(std::llround(1e3 * latency_ms)) {}
  void send(const CatheterCommand& command, std::int64_t now_us) {
    waiting_.emplace_back(now_us + latency_us_, command);
  }
  void deliver(SimulatedCatheter& catheter, std::int64_t now_us) {
    while (!waiting_.empty() && waiting_.front().first <= now_us) {
      catheter.obey(waiting_.front().second, waiting_.front().first);
      waiting_.pop_front();
    }
    catheter.advance(now_us);
  }

 private:
  std::int64_t latency_us_;
  std::deque<std::pair<std::int64_t, CatheterCommand>> waiting_;
};

void judge(const TipBelief& belief, const std::optional<CatheterTrace>& trace, const SeenPose& pose,
           const CatheterTruth& truth, NavigateRow& row) {
  if (belief.status != BeliefStatus::kSeen || !trace) return;
  const auto end = tipEnd(trace->evidence, belief.tip);
  const double error_m = (end.value_or(tipOnRay(belief.tip, trace->seen, pose)) - truth.tip_model).norm();
  row.errors_m.push_back(error_m);
  if (belief.tip.chain == truth.tip.chain) {
    row.arc_errors_m.push_back(std::abs(belief.tip.arc_m - truth.tip.arc_m));
  } else {
    row.wrong_chain += error_m > 2e-3;
  }
}

}  // namespace

std::vector<TreePlace> navigateTargets(const VesselTree& tree, const NavigateStudySettings& study, int count) {
  const VesselTree full = withPlausibleRadii(tree, 0.6e-3);
  const TreeMap map(full);
  // Journeys begin at the root that most branches hang on.
  std::vector<int> hanging(map.chains(), 0);
  for (int c = 0; c < map.chains(); ++c) ++hanging[map.pathTo(c).front()];
  const auto root = static_cast<int>(std::max_element(hanging.begin(), hanging.end()) - hanging.begin());
  std::vector<TreePlace> fit, spread;
  for (int c = 0; c < map.chains(); ++c) {
    const TreePlace place{c, std::min(1e-3 * study.into_branch_mm, 0.8 * map.length_m(c))};
    if (map.pathTo(c).front() != root || place.arc_m < kLeastInto_m || map.start_m(c) < 1e-3 * study.least_way_mm)
      continue;
    if (narrowestOnWay(full, map, c) >= 1e-3 * study.least_radius_mm) fit.push_back(place);
  }
  const int n = std::min(count, static_cast<int>(fit.size()));
  for (int k = 0; k < n; ++k)
    spread.push_back(fit[static_cast<std::size_t>(k) * fit.size() / static_cast<std::size_t>(n)]);
  return spread;
}

NavigateRow studyNavigation(const VesselTree& tree, const TreePlace& target, const NavigateStudySettings& study,
                            const NavigateParts& parts, std::uint64_t seed, const NavigateObserver& look_on) {
  checkSettings("navigate", study);
  const VesselTree full = withPlausibleRadii(tree, 1e-3 * parts.patient.fluoroscopy.end_radius_mm);
  const TreeMap map(full);
  const TreePlace start = startOf(map, target);
  CatheterSettings made = parts.catheter;
  made.roll_zero_deg = static_cast<double>(seed * 7919 % 360);
  SimulatedCatheter catheter(full, made, start, 0);
  CatheterLoop loop(full, start, target, parts.loop);
  NavigateSight sight(full, study, parts, seed);
  ViewPlanner way_view(full, target, NavigateSight::reachable(), parts.view);
  double turning_until_s = 0;
  bool in_doubt = false;

  NavigateRow row;
  row.target = target;
  row.way_m = map.start_m(target.chain) + target.arc_m - map.start_m(start.chain) - start.arc_m;
  row.forks = static_cast<int>(map.pathTo(target.chain).size()) - 1;
  row.ended = "too long";
  CommandLine line(parts.loop.latency_ms);
  const double period_s = 1 / study.frame_rate_hz;
  for (std::int64_t k = 1; static_cast<double>(k) * period_s < study.longest_s; ++k) {
    const std::int64_t now_us = std::llround(1e6 * static_cast<double>(k) * period_s);
    line.deliver(catheter, now_us);
    const double now_s = 1e-6 * static_cast<double>(now_us);
    if (now_s < turning_until_s) continue;
    if (const auto view = way_view.next({loop.belief().tip.chain, loop.belief().tip.arc_m}, in_doubt)) {
      ++row.views;
      turning_until_s = now_s + sight.turnTo(*view);
      in_doubt = false;
      if (now_s < turning_until_s) continue;  // The drive stands still meanwhile: silence means stop.
    }
    const auto trace = sight.look(catheter, loop, k, now_s);
    const auto [seen, input, answer] = loop.step({now_us, k, sight.pose(), catheter.state()}, trace);
    line.send(answer.command, now_us);
    in_doubt = answer.another_view;

    const CatheterTruth truth = catheter.truth();
    judge(*input.belief, trace, sight.pose(), truth, row);
    if (look_on) look_on({now_s, sight.image(), sight.pose(), trace, input, answer, truth});
    ++row.frames;
    row.waited += answer.state == NavigationState::kWaiting;
    row.largest_force_n = std::max(row.largest_force_n, std::abs(input.drive.insertion_force_n));
    row.wall_contacts = truth.wall_contacts;
    row.time_s = now_s;
    if (answer.state == NavigationState::kArrived || answer.state == NavigationState::kGivenUp) {
      row.reached = answer.state == NavigationState::kArrived && truth.tip.chain == target.chain;
      row.ended = stateName(answer.state) + (answer.why.empty() ? "" : ": " + answer.why);
      break;
    }
  }
  row.misses = loop.navigator().misses();
  return row;
}

Json navigateStudyAsJson(const std::string& tree_name, const std::vector<NavigateRow>& rows) {
  Json json;
  std::vector<double> errors_mm, arcs_mm, times, contacts;
  int reached = 0, misses = 0, frames = 0, waited = 0, wrong = 0, believed = 0, near = 0, forks = 0, views = 0;
  double force = 0;
  Json each = Json::array();
  for (const NavigateRow& row : rows) {
    reached += row.reached;
    misses += row.misses;
    frames += row.frames;
    waited += row.waited;
    wrong += row.wrong_chain;
    forks += row.forks;
    views += row.views;
    believed += static_cast<int>(row.errors_m.size());
    force = std::max(force, row.largest_force_n);
    contacts.push_back(row.wall_contacts);
    times.push_back(row.time_s);
    for (const double e : row.errors_m) errors_mm.push_back(1e3 * e), near += e <= 1.5e-3;
    for (const double e : row.arc_errors_m) arcs_mm.push_back(1e3 * e);
    each.push_back({{"branch", row.target.chain},
                    {"into_branch_mm", 1e3 * row.target.arc_m},
                    {"reached", row.reached},
                    {"ended", row.ended},
                    {"time_s", row.time_s},
                    {"way_mm", 1e3 * row.way_m},
                    {"forks", row.forks},
                    {"misses", row.misses},
                    {"views", row.views},
                    {"wall_contacts", row.wall_contacts}});
  }
  json["tree"] = tree_name;
  json["targets"] = rows.size();
  json["reached"] = reached;
  json["forks"] = forks;
  json["misses"] = misses;
  json["views"] = views;
  json["wall_contacts"] = {{"median", percentile(contacts, 0.5)}, {"max", percentile(contacts, 1)}};
  json["largest_force_n"] = force;
  json["time_s"] = {{"median", percentile(times, 0.5)}, {"max", percentile(times, 1)}};
  json["frames"] = frames;
  json["waited"] = waited;
  json["believed"] = believed;
  json["wrong_chain"] = wrong;
  json["tip_error_mm"] = {{"median", percentile(errors_mm, 0.5)},
                          {"p95", percentile(errors_mm, 0.95)},
                          {"within_1.5", believed > 0 ? static_cast<double>(near) / believed : 0.0}};
  json["along_vessel_mm"] = {{"median", percentile(arcs_mm, 0.5)}, {"p95", percentile(arcs_mm, 0.95)}};
  json["each"] = each;
  return json;
}

std::string navigateStudyTable(const Json& trees) {
  std::string table =
      formatted("%-24s %9s %7s %7s %7s %16s %9s %20s %10s %8s %14s\n", "navigate", "reached", "forks", "misses",
                "views", "wall contacts", "force", "tip error mm", "within", "waited", "time s");
  table += formatted("%-24s %9s %7s %7s %7s %16s %9s %20s %10s %8s %14s\n", "", "", "", "", "", "median (most)",
                     "most N", "median (95 %)", "1.5 mm", "frames", "median (most)");
  for (const Json& j : trees) {
    table +=
        formatted("%-24s %4d / %2d %7d %7d %7d %10.0f (%3.0f) %9.2f %12.2f (%5.2f) %8.1f %% %6.1f %% %7.0f (%4.0f)\n",
                  j["tree"].get<std::string>().c_str(), j["reached"].get<int>(), j["targets"].get<int>(),
                  j["forks"].get<int>(), j["misses"].get<int>(), j["views"].get<int>(),
                  j["wall_contacts"]["median"].get<double>(), j["wall_contacts"]["max"].get<double>(),
                  j["largest_force_n"].get<double>(), j["tip_error_mm"]["median"].get<double>(),
                  j["tip_error_mm"]["p95"].get<double>(), 100 * j["tip_error_mm"]["within_1.5"].get<double>(),
                  100.0 * j["waited"].get<int>() / std::max(1, j["frames"].get<int>()),
                  j["time_s"]["median"].get<double>(), j["time_s"]["max"].get<double>());
  }
  return table;
}

}  // namespace angio
