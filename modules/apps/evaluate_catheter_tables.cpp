// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluate_catheter_tables.hpp"

#include <algorithm>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::apps {
namespace {

// How far apart two places are along the vessels [m].
double alongVessels_m(const TreeTopology& map, const TipPlace& a, const TipPlace& b) {
  const auto to_a = map.pathTo(a.chain), to_b = map.pathTo(b.chain);
  std::size_t shared = 0;
  while (shared < to_a.size() && shared < to_b.size() && to_a[shared] == to_b[shared]) ++shared;
  if (shared == 0) return (a.tip_model - b.tip_model).norm();  // Different roots.
  const int last = to_a[shared - 1];
  const double end_m = map.start_m(last) + map.length_m(last);
  const double at_a_m = map.start_m(a.chain) + a.arc_m, at_b_m = map.start_m(b.chain) + b.arc_m;
  const double fork_m = std::min({end_m, at_a_m, at_b_m});
  return at_a_m + at_b_m - 2 * fork_m;
}

// The mean residual of the frames that nothing was learnt from.
double leftOut_px(const CatheterRoute& way) {
  std::vector<double> residuals_px;
  for (std::size_t t = 0; t < way.frames.size(); ++t) {
    if (!way.learnt[t] && way.frames[t].belief.residual_px) residuals_px.push_back(*way.frames[t].belief.residual_px);
  }
  return mean(residuals_px);
}

}  // namespace

std::string catheterTable(const CatheterRoute& way, const CaseSet& set) {
  std::string table =
      way.name +
      "\n\nframe      status     chain  arc mm  from root mm  sigma mm  probability  residual px  shift mm x, y\n";
  for (std::size_t t = 0; t < way.frames.size(); ++t) {
    const TipBelief& b = way.frames[t].belief;
    const Pose& T = way.frames[t].T_camera_model;
    const double mm_per_px = 1e3 * (T * b.tip.tip_model).z() / set.cases[t].views.front().camera.parameters().fx_px;
    table +=
        formatted("%-10s %-10s %5d %7.1f %13.1f %9.2f %12.3f %12.2f %9.1f %5.1f\n", set.cases[t].name.c_str(),
                  statusName(b.status), b.tip.chain, 1e3 * b.tip.arc_m, 1e3 * b.tip.path_m, 1e3 * b.tip.std_m,
                  b.tip.probability, b.residual_px.value_or(0), mm_per_px * b.shift_px.x(), mm_per_px * b.shift_px.y());
  }
  return table;
}

CatheterSummary catheterSummary(const CatheterRoute& way) {
  std::string text;
  const TreeTopology map(way.tree);
  std::vector<double> residuals_px, steps_mm, times_ms;
  std::string chains;
  int seen = 0, sure = 0, within = 0;
  for (std::size_t t = 0; t < way.frames.size(); ++t) {
    const TipBelief& b = way.frames[t].belief;
    seen += b.status == BeliefStatus::kSeen;
    sure += b.tip.probability > 0.9;
    if (b.residual_px) residuals_px.push_back(*b.residual_px), within += *b.residual_px <= 3;
    if (way.frames[t].time_s > 0) times_ms.push_back(1e3 * way.frames[t].time_s);
    if (t > 0) steps_mm.push_back(1e3 * alongVessels_m(map, way.frames[t - 1].belief.tip, b.tip));
    if (t == 0 || b.tip.chain != way.frames[t - 1].belief.tip.chain)
      chains += (t ? " " : "") + std::to_string(b.tip.chain);
  }
  const double max_mm = percentile(steps_mm, 1), median_mm = percentile(steps_mm, 0.5);
  text += formatted(
      "located in %d of %d frames, in one chain with more than 90 %% in %d\nresidual of the curve against the path "
      "from the "
      "root: mean %.2f px, largest %.2f px, within 3 px in %d\nchains in order: %s\nfrom frame to frame along the "
      "vessels: "
      "median %.1f mm, at most %.1f mm\n",
      seen, static_cast<int>(way.frames.size()), sure, mean(residuals_px), percentile(residuals_px, 1), within,
      chains.c_str(), median_mm, max_mm);
  if (!times_ms.empty())
    text += formatted("a frame takes %.1f ms (median), %.1f ms at most\n", percentile(times_ms, 0.5),
                      percentile(times_ms, 1));
  const bool all_learnt = std::find(way.learnt.begin(), way.learnt.end(), false) == way.learnt.end();
  if (!all_learnt)
    text += formatted("residual of the frames that were not learnt from: mean %.2f px\n", leftOut_px(way));
  nlohmann::ordered_json numbers = {{"frames", way.frames.size()},
                                    {"seen", seen},
                                    {"probability_above_0.9", sure},
                                    {"mean_residual_px", mean(residuals_px)},
                                    {"max_residual_px", percentile(residuals_px, 1)},
                                    {"within_3_px", within},
                                    {"chains", chains},
                                    {"median_step_mm", median_mm},
                                    {"max_step_mm", max_mm}};
  if (!all_learnt) numbers["left_out_residual_px"] = leftOut_px(way);
  return {text, numbers};
}

nlohmann::ordered_json catheterAsJson(const CatheterRoute& way, const CaseSet& set) {
  nlohmann::ordered_json json;
  for (std::size_t t = 0; t < way.frames.size(); ++t) {
    const TipBelief& b = way.frames[t].belief;
    auto& one = json[set.cases[t].name];
    one = {{"status", statusName(b.status)},
           {"chain", b.tip.chain},
           {"arc_mm", 1e3 * b.tip.arc_m},
           {"path_mm", 1e3 * b.tip.path_m},
           {"std_mm", 1e3 * b.tip.std_m},
           {"probability", b.tip.probability},
           {"shift_px", {b.shift_px.x(), b.shift_px.y()}}};
    const Eigen::Vector3d tip_mm = 1e3 * b.tip.tip_model;
    one["tip_mm"] = {tip_mm.x(), tip_mm.y(), tip_mm.z()};
    if (b.residual_px) one["residual_px"] = *b.residual_px;
    if (!b.why.empty()) one["why"] = b.why;
  }
  return json;
}

std::string catheterComparison(const CatheterRoute& a, const CatheterRoute& b) {
  std::vector<double> apart_mm;
  int same = 0;
  for (std::size_t t = 0; t < a.frames.size(); ++t) {
    apart_mm.push_back(1e3 * (a.frames[t].belief.tip.tip_model - b.frames[t].belief.tip.tip_model).norm());
    same += a.frames[t].belief.tip.chain == b.frames[t].belief.tip.chain;
  }
  return formatted("tip from that of %s: median %.1f mm, at most %.1f mm; in the same chain in %d frames\n",
                   b.name.c_str(), percentile(apart_mm, 0.5), percentile(apart_mm, 1), same);
}

}  // namespace angio::apps
