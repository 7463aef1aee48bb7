// SPDX-License-Identifier: GPL-2.0-or-later
#include "tree_viterbi.hpp"

#include <algorithm>
#include <cmath>

namespace angio::navigation {
namespace {

constexpr double kSpacing_m = 1e-3;
constexpr float kLine = 0.4f;     // Of a catheter's contrast: below, there is rather none.
constexpr float kMaxLine = 0.6f;  // Nats a millimetre, at most for or against.
constexpr float kStiff = 0.5f;    // Nats for a displacement that changes by a step a millimetre, by its square ...
constexpr float kAskew = 0.25f;   // ... and in a wide vessel for each further step: a bent tip lies across it.
constexpr float kOutside = 20;    // Nats for each millimetre outside of the lumen, squared.
constexpr int kHop = 2;           // Steps of displacement from place to place, at most.
constexpr int kWideHop = 5;       // The same in a wide vessel: 60 deg to its axis.
constexpr int kWideReach = 16;    // Steps: a vessel of 5 mm radius.
constexpr int kMinReach = 8;      // Steps: what a pose that is a little off needs in the narrowest vessel.

using Scores = TreeViterbi::Scores;

// What it costs that a displacement changes by `d` steps from one place to the next.
float price(int d, bool wide) {
  const auto steps = static_cast<float>(std::abs(d));
  return wide && steps > 1 ? kStiff + kAskew * (steps - 1) : kStiff * steps * steps;
}

// Adds to `scores` the best of all displacements from which one comes there, less what the change costs; one axis after
// the other. `across` and `best` are room for the work.
void addCarried(const Scores& from, bool wide, Scores& across, Eigen::ArrayXf& best, Scores& scores) {
  const Eigen::Index side = from.rows();
  const int hop = wide ? kWideHop : kHop;
  across = from;
  for (int d = 1; d <= hop; ++d) {
    const Eigen::Index n = side - d;
    const float costs = price(d, wide);
    across.leftCols(n).array() = across.leftCols(n).array().max(from.rightCols(n).array() - costs);
    across.rightCols(n).array() = across.rightCols(n).array().max(from.leftCols(n).array() - costs);
  }
  for (Eigen::Index y = 0; y < side; ++y) {
    const auto in = across.col(y).array();
    best = in;
    for (int d = 1; d <= hop; ++d) {
      const Eigen::Index n = side - d;
      const float costs = price(d, wide);
      best.head(n) = best.head(n).max(in.tail(n) - costs);
      best.tail(n) = best.tail(n).max(in.head(n) - costs);
    }
    scores.col(y).array() += best;
  }
}

}  // namespace

WalkPlaces::WalkPlaces(const VesselTree& tree) {
  const TreeTopology map(tree);
  branch_first.assign(map.branchCount(), -1);
  branch_last.assign(map.branchCount(), -1);
  std::vector<int> waiting;
  for (int c = map.branchCount() - 1; c >= 0; --c) {
    if (!map.parent(c)) waiting.push_back(c);
  }
  while (!waiting.empty()) {
    const int c = waiting.back();
    waiting.pop_back();
    const double length = map.length_m(c);
    const int steps = std::max(1, static_cast<int>(std::ceil(length / kSpacing_m)));
    int before = map.parent(c) ? branch_last[*map.parent(c)] : -1;
    branch_first[c] = static_cast<int>(points_m.size());
    for (int k = before < 0 ? 0 : 1; k <= steps; ++k) {
      const TreeLocation place{c, length * k / steps};
      const EdgePoint spot = map.spot(place);
      const auto &a = tree.radii()[spot.a], &b = tree.radii()[spot.b];
      points_m.push_back(map.point(place));
      frames.push_back(map.frame(place));
      path_m.push_back(map.start_m(c) + place.arc_m);
      arc_m.push_back(place.arc_m);
      branch.push_back(c);
      radius_m.push_back((1 - spot.weight) * a.value_or(1e-3) + spot.weight * b.value_or(1e-3));
      parent.push_back(before);
      before = static_cast<int>(points_m.size()) - 1;
    }
    branch_last[c] = before;
    for (const int child : map.children(c)) waiting.push_back(child);
  }
}

int WalkPlaces::nearest(int of_branch, double at_m) const {
  const int first = branch_first[of_branch], last = branch_last[of_branch];
  const double start_m = parent[first] >= 0 ? path_m[parent[first]] : path_m[first];
  const auto from = path_m.begin() + first, to = path_m.begin() + last + 1;
  const auto at = std::lower_bound(from, to, start_m + at_m);
  return std::min(static_cast<int>(at - path_m.begin()), last);
}

WalkArea areaAround(const WalkPlaces& places, const TipBelief& expected, double behind_m, double ahead_m) {
  const std::size_t n = places.points_m.size();
  std::vector<double> nearest(n, 1e9), from(n);
  std::vector<bool> wanted(n, false), on_path(n);
  std::vector<TipPlace> tips = expected.alternatives;
  tips.insert(tips.begin(), expected.tip);
  for (const TipPlace& tip : tips) {
    std::fill(on_path.begin(), on_path.end(), false);
    const int end = places.nearest(tip.branch, tip.arc_m);
    for (int i = end; i >= 0; i = places.parent[i]) on_path[i] = true;
    for (std::size_t i = 0; i < n; ++i) {
      const int p = places.parent[i];
      const double step = p >= 0 ? places.path_m[i] - places.path_m[p] : 0;
      from[i] = on_path[i] ? places.path_m[end] - places.path_m[i] : (p >= 0 ? from[p] + step : 1e9);
      const bool here = on_path[i] ? from[i] <= behind_m : from[i] <= ahead_m;
      if (here) wanted[i] = true, nearest[i] = std::min(nearest[i], from[i]);
    }
  }
  WalkArea area;
  std::vector<int> index(n, -1);
  for (std::size_t i = 0; i < n; ++i) {
    if (!wanted[i]) continue;
    index[i] = static_cast<int>(area.places.size());
    area.places.push_back(static_cast<int>(i));
    area.parent.push_back(places.parent[i] >= 0 ? index[places.parent[i]] : -1);
    area.from_tip_m.push_back(nearest[i]);
  }
  return area;
}

Eigen::Vector2f TreeViterbi::at(int k, int u) const {
  return px_->col(k) +
         step_px_ * Eigen::Vector2f(static_cast<float>(u % side_ - reach_), static_cast<float>(u / side_ - reach_));
}

int TreeViterbi::reach(const WalkArea& area) const {
  double room_m = 0;
  for (const int place : area.places) room_m = std::max(room_m, places_.radius_m[place] + slack_m_);
  return std::clamp(static_cast<int>(std::ceil(room_m / kStep_m)), kMinReach, kMaxReach);
}

void TreeViterbi::run(const WalkArea& area, const Eigen::Matrix2Xf& px, double px_per_m, const DeviceContrast& seen,
                      double level) {
  area_ = &area;
  px_ = &px;
  step_px_ = static_cast<float>(kStep_m * px_per_m);
  reach_ = reach(area);
  side_ = 2 * reach_ + 1;
  wide_ = reach_ > kWideReach;
  const auto count = area.places.size();
  steps_.resize(count);
  scores_.resize(count);
  dark_.resize(count);
  const cv::Mat& image = seen.contrast;
  const auto pixel = [&](const Eigen::Vector2f& p) {
    const int x = static_cast<int>(p.x() + 0.5f) - seen.corner.x, y = static_cast<int>(p.y() + 0.5f) - seen.corner.y;
    const bool inside = x >= 0 && y >= 0 && x < image.cols && y < image.rows;
    return inside ? image.ptr<float>(y)[x] : kLine * static_cast<float>(level);
  };
  const float per_level = static_cast<float>(1 / level);
  if (beside_m_.rows() != side_) {
    beside_m_.resize(side_, side_);
    for (int u = 0; u < beside_m_.size(); ++u)
      beside_m_.data()[u] = kStep_m * std::hypot(u % side_ - reach_, u / side_ - reach_);
  }
  for (std::size_t k = 0; k < count; ++k) {
    const int place = area.places[k], parent = area.parent[k];
    const double room_m = places_.radius_m[place] + slack_m_;
    const Eigen::Vector2f half =
        parent >= 0 ? Eigen::Vector2f(0.5f * (px.col(parent) - px.col(k))) : Eigen::Vector2f(Eigen::Vector2f::Zero());
    Scores& own = scores_[k];
    own.resize(side_, side_);
    dark_[k].resize(side_, side_);
    for (int u = 0; u < own.size(); ++u) {
      const Eigen::Vector2f p = at(static_cast<int>(k), u);
      const float here = pixel(p);
      dark_[k].data()[u] = here;
      // A line askew is not where its displacement stays.
      const float between = parent >= 0 && !wide_ ? pixel(p + half) : here;
      const auto worth = [&](float value) { return std::clamp(per_level * value - kLine, -kMaxLine, kMaxLine); };
      const auto outside = static_cast<float>(1e3 * std::max(beside_m_.data()[u] - room_m, 0.0));
      own.data()[u] = 0.5f * (worth(here) + worth(between)) - kOutside * outside * outside;
    }
    if (parent >= 0) addCarried(scores_[parent], wide_, across_, best_, own);
    steps_[k] = parent >= 0 ? steps_[parent] + 1 : 1;
  }
}

std::optional<double> TreeViterbi::lack(int k, const Eigen::Vector2f& off_px) const {
  const Eigen::Vector2i u = (off_px / step_px_).array().round().cast<int>();
  if (u.cwiseAbs().maxCoeff() > reach_) return std::nullopt;
  return kMaxLine * static_cast<float>(steps_[k]) - scores_[k](u.x() + reach_, u.y() + reach_);
}

std::vector<Eigen::Vector2d> TreeViterbi::backFrom(int k, int u) const {
  std::vector<Eigen::Vector2d> line;
  for (;;) {
    line.push_back(at(k, u).cast<double>());
    const int parent = area_->parent[k];
    if (parent < 0) break;
    const int x = u % side_, y = u / side_;
    float most = -1e30f;
    const int hop = wide_ ? kWideHop : kHop;
    for (int dx = -hop; dx <= hop; ++dx) {
      for (int dy = -hop; dy <= hop; ++dy) {
        if (x + dx < 0 || y + dy < 0 || x + dx >= side_ || y + dy >= side_) continue;
        const int from = x + dx + side_ * (y + dy);
        const float value = scores_[parent].data()[from] - price(dx, wide_) - price(dy, wide_);
        if (value > most) most = value, u = from;
      }
    }
    k = parent;
  }
  std::reverse(line.begin(), line.end());
  return line;
}

}  // namespace angio::navigation
