// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/tip_belief.hpp"

#include <algorithm>
#include <cmath>

#include "tip_filter.hpp"

namespace angio::localisation {
namespace {

constexpr double kSamePlace_m = 2e-3;
constexpr double kBeyond_m = 0.5e-3;  // What is known of a place counts so far beyond the last one of a branch.
constexpr double kHole_m = 2e-3;      // Between places that are further apart, nothing is known.

using ByArc = std::vector<std::pair<double, double>>;  // Arc length and log evidence.

// Between neighbours, and a little beyond the first and the last.
std::optional<double> evidenceAt(const ByArc& known, double arc_m) {
  if (known.empty() || arc_m < known.front().first - kBeyond_m || arc_m > known.back().first + kBeyond_m) {
    return std::nullopt;
  }
  const auto above = std::lower_bound(known.begin(), known.end(), std::make_pair(arc_m, -1e300));
  if (above == known.begin()) return above->second;
  const auto below = above - 1;
  if (above == known.end()) return below->second;
  if (above->first - below->first > kHole_m) {
    if (arc_m - below->first <= kBeyond_m) return below->second;
    if (above->first - arc_m <= kBeyond_m) return above->second;
    return std::nullopt;
  }
  const double weight = above->first > below->first ? (arc_m - below->first) / (above->first - below->first) : 0;
  return (1 - weight) * below->second + weight * above->second;
}

const PlaceEvidence* nearestTo(const TipEvidence& evidence, const TipPlace& place) {
  double nearest_m = kSamePlace_m;
  const PlaceEvidence* nearest = nullptr;
  for (const PlaceEvidence& one : evidence.places) {
    const double off_m = std::abs(one.arc_m - place.arc_m);
    if (one.branch == place.branch && off_m < nearest_m) nearest_m = off_m, nearest = &one;
  }
  return nearest;
}

}  // namespace

std::optional<Eigen::Vector3d> tipEnd(const TipEvidence& evidence, const TipPlace& place) {
  const PlaceEvidence* nearest = nearestTo(evidence, place);
  return nearest ? std::optional<Eigen::Vector3d>(nearest->tip_model) : std::nullopt;
}

double tipEndStd_m(const TipEvidence& evidence, const TipPlace& place) {
  const PlaceEvidence* nearest = nearestTo(evidence, place);
  return nearest ? nearest->end_std_m : 0.0;
}

// A branch begins where its parent ends: what is known of that place counts for both.
void TipFilter::beginAtForks(std::vector<std::vector<std::pair<double, double>>>& known) const {
  for (std::size_t c = 0; c < known.size(); ++c) {
    const int fork = fork_of_branch_[c];
    if (fork < 0 || known[c].empty() || !(known[c].front().first > 0)) continue;
    const auto parent = static_cast<std::size_t>(grid_.branch[fork]);
    if (known[parent].empty() || known[parent].back().first < grid_.arc_m[fork] - kBeyond_m) continue;
    known[c].insert(known[c].begin(), {0.0, known[parent].back().second});
  }
}

FrameOutcome TipFilter::observe(const TipEvidence& evidence) {
  FrameOutcome outcome;
  candidates_.clear();
  if (evidence.places.empty()) return outcome.why = "no place explains the tip", outcome;
  std::vector<ByArc> known(branch_length_m_.size());
  for (const PlaceEvidence& one : evidence.places) {
    if (one.branch < 0 || one.branch >= static_cast<int>(known.size()) || !std::isfinite(one.arc_m) ||
        !std::isfinite(one.log_evidence)) {
      return outcome.why = "the evidence of a place is none", outcome;
    }
    known[one.branch].emplace_back(one.arc_m, one.log_evidence);
  }
  if (!std::isfinite(evidence.elsewhere)) return outcome.why = "the evidence of other places is not finite", outcome;
  for (ByArc& branch : known) std::sort(branch.begin(), branch.end());
  beginAtForks(known);

  double best = -1e300;
  for (int i = 0; i < grid_.size(); ++i) {
    const auto value = evidenceAt(known[grid_.branch[i]], grid_.arc_m[i]);
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

}  // namespace angio::localisation
