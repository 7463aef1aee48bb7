// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/tip_evidence.hpp"

#include <algorithm>
#include <cmath>

#include "tip_filter.hpp"

namespace angio {
namespace {

constexpr double kSamePlace_m = 2e-3;

using ByArc = std::vector<std::pair<double, double>>;  // Arc length and log evidence.

// Between neighbours, and up to half a step beyond the first and the last.
std::optional<double> evidenceAt(const ByArc& known, double arc_m, double half_step_m) {
  if (known.empty() || arc_m < known.front().first - half_step_m || arc_m > known.back().first + half_step_m) {
    return std::nullopt;
  }
  const auto above = std::lower_bound(known.begin(), known.end(), std::make_pair(arc_m, -1e300));
  if (above == known.begin()) return above->second;
  const auto below = above - 1;
  if (above == known.end()) return below->second;
  if (above->first - below->first > 4 * half_step_m) {  // A hole: nothing is known in it.
    if (arc_m - below->first <= half_step_m) return below->second;
    if (above->first - arc_m <= half_step_m) return above->second;
    return std::nullopt;
  }
  const double weight = above->first > below->first ? (arc_m - below->first) / (above->first - below->first) : 0;
  return (1 - weight) * below->second + weight * above->second;
}

}  // namespace

std::optional<Eigen::Vector3d> tipEnd(const TipEvidence& evidence, const TipPlace& place) {
  double nearest_m = kSamePlace_m;
  std::optional<Eigen::Vector3d> end;
  for (const PlaceEvidence& one : evidence.places) {
    const double off_m = std::abs(one.arc_m - place.arc_m);
    if (one.chain == place.chain && off_m < nearest_m) nearest_m = off_m, end = one.tip_model;
  }
  return end;
}

FrameOutcome TipFilter::observe(const TipEvidence& evidence) {
  FrameOutcome outcome;
  candidates_.clear();
  if (evidence.places.empty()) return outcome.why = "no place explains the tip", outcome;
  std::vector<ByArc> known(chain_length_m_.size());
  for (const PlaceEvidence& one : evidence.places) {
    if (one.chain < 0 || one.chain >= static_cast<int>(known.size()) || !std::isfinite(one.arc_m) ||
        !std::isfinite(one.log_evidence)) {
      return outcome.why = "the evidence of a place is none", outcome;
    }
    known[one.chain].emplace_back(one.arc_m, one.log_evidence);
  }
  if (!std::isfinite(evidence.elsewhere)) return outcome.why = "the evidence of other places is not finite", outcome;
  for (ByArc& chain : known) std::sort(chain.begin(), chain.end());

  double best = -1e300;
  for (int i = 0; i < grid_.size(); ++i) {
    const auto value = evidenceAt(known[grid_.chain[i]], grid_.arc_m[i], grid_.spacing_m);
    next_probability_[i] = std::log(probability_[i]) + value.value_or(evidence.elsewhere);
    best = std::max(best, next_probability_[i]);
  }
  double sum = 0;
  for (double& p : next_probability_) sum += p = std::exp(p - best);
  for (double& p : next_probability_) p /= sum;
  probability_.swap(next_probability_);
  outcome.used = true;
  outcome.residual_px = evidence.residual_px;
  return outcome;
}

}  // namespace angio
