// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>
#include <tuple>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/direct_linear.hpp"
#include "angio/calibration/uncoded_phantom.hpp"
#include "bead_symmetry.hpp"
#include "three_point_pose.hpp"

namespace angio::calibration {
namespace {

constexpr int kMinMatchedBeads = 8;
constexpr double kMinExplainedShare = 2.0 / 3;  // Of the beads that should be seen, seen.
constexpr double kMinTrueShare = 0.5;           // Of the detections that are beads.
constexpr double kClearShare = 0.85;            // Of the beads that should be seen: ends the search.
constexpr double kSymmetryTolerance_m = 1e-3;
constexpr double kNearestPhantom_m = 0.3, kFarthestPhantom_m = 5;
constexpr double kScoredWithin = 0.013;  // Of the detector's width: a focal length may be off by a tenth.
constexpr double kRefinedWithin[] = {0.014, 0.012, 0.010, 0.008, 0.006, 0.004, 0.004};
constexpr std::size_t kRefinedPoses = 64;  // Hypotheses of one pass that are refined.
constexpr int kTriples = 8;                // Of detections that are tried.
constexpr double kFocalLengths[] = {4.3, 5.2, 3.6, 6.2, 3.0, 7.4, 2.5, 8.9, 2.1};  // In detector widths.
constexpr double kThinTriple = 0.15;  // Height of a bead triple over its base, at least.
constexpr int kLeastScore = -1000;
constexpr int kCell_px = 4;
constexpr double kMapMargin = 0.1;  // Of the map beyond the detector, in its widths.

// For every place of the pinhole image: whether a bead would be seen there, and whether one was.
class SeenMap {
 public:
  explicit SeenMap(const UncodedView& view) : margin_px_(kMapMargin * view.width_px) {
    double farthest = view.width_px;
    for (Eigen::Index i = 0; i < view.pinhole_px.cols(); ++i) {
      farthest = std::max(farthest, view.pinhole_px.col(i).maxCoeff());
    }
    side_ = static_cast<int>((farthest + 2 * margin_px_) / kCell_px) + 1;
    cells_.assign(static_cast<std::size_t>(side_) * side_, 0);
    const double within_px = kScoredWithin * view.width_px;
    for (int y = 0; y < side_; ++y) {
      for (int x = 0; x < side_; ++x) {
        const Eigen::Vector2d at(x * kCell_px - margin_px_, y * kCell_px - margin_px_);
        if (!view.is_open(at)) continue;
        const bool near = (view.pinhole_px.colwise() - at).colwise().norm().minCoeff() < within_px;
        cells_[static_cast<std::size_t>(y) * side_ + x] = near ? 2 : 1;
      }
    }
  }

  // 0 where nothing could be seen, 1 where nothing was, 2 near a detection.
  int at(const Eigen::Vector2d& pinhole_px) const {
    const double x = (pinhole_px.x() + margin_px_) / kCell_px, y = (pinhole_px.y() + margin_px_) / kCell_px;
    if (!(x >= 0 && y >= 0 && x < side_ - 1 && y < side_ - 1)) return 0;
    return cells_[static_cast<std::size_t>(std::lround(y)) * side_ + static_cast<std::size_t>(std::lround(x))];
  }

 private:
  double margin_px_;
  int side_ = 0;
  std::vector<char> cells_;
};

struct PoseHypothesis {
  Matrix34d P;
  int score = 0;  // Twice the beads near a detection, less those that should be seen and are not.
};

using BeadTriple = std::array<int, 3>;

class UncodedSearch {
 public:
  UncodedSearch(const BeadPhantom& phantom, const UncodedView& view)
      : phantom_(phantom),
        view_(view),
        points_m_(phantom.positions_m()),
        symmetries_(symmetriesOf(phantom, kSymmetryTolerance_m)),
        seen_(view),
        triples_(beadTriples()) {}

  // The readings of the pass that explains most, without the symmetries' images; empty when none explains enough.
  std::vector<PhantomReading> find() const {
    std::vector<PhantomReading> best;
    for (const BeadTriple& detections : detectionTriples()) {
      for (const double widths : kFocalLengths) {
        std::vector<PhantomReading> readings = refined(hypotheses(detections, widths * view_.width_px));
        if (!readings.empty() && (best.empty() || share(readings.front()) > share(best.front()))) best = readings;
        if (!best.empty() && share(best.front()) >= kClearShare) return best;
      }
    }
    if (!best.empty() && share(best.front()) < kMinExplainedShare) best.clear();
    return best;
  }

  // With those that the phantom's symmetries make of them.
  std::vector<PhantomReading> withSymmetries(const std::vector<PhantomReading>& readings) const {
    std::vector<PhantomReading> all;
    std::set<std::pair<bool, std::vector<int>>> known;
    for (const PhantomReading& reading : readings) {
      for (const PhantomSymmetry& symmetry : symmetries_) {
        std::vector<std::optional<int>> names = reading.bead;
        std::vector<int> key;
        for (auto& name : names) {
          if (name) name = symmetry.image[static_cast<std::size_t>(*name)];
          key.push_back(name.value_or(-1));
        }
        if (known.count({reading.mirrored != symmetry.mirrors, key})) continue;
        auto image = readingBy(names, reading.unseen);
        if (!image) continue;
        known.insert({image->mirrored, key});
        all.push_back(*image);
      }
    }
    return all;
  }

 private:
  // Of the beads that should be seen, those that are; nothing counts where most detections are no beads.
  double share(const PhantomReading& reading) const {
    if (reading.matched < kMinTrueShare * static_cast<double>(view_.pinhole_px.cols())) return 0;
    return static_cast<double>(reading.matched) / (reading.matched + reading.unseen);
  }

  // Beads of which no symmetry makes another one of the list, with all pairs of others that are no thin triangle.
  std::vector<BeadTriple> beadTriples() const {
    const int count = static_cast<int>(phantom_.beads.size());
    std::set<int> first;
    for (int i = 0; i < count; ++i) {
      int least = i;
      for (const PhantomSymmetry& symmetry : symmetries_) least = std::min(least, symmetry.image[i]);
      first.insert(least);
    }
    std::vector<BeadTriple> triples;
    for (const int i : first) {
      for (int j = 0; j < count; ++j) {
        const Eigen::Vector3d a = points_m_.col(j) - points_m_.col(i);
        for (int k = 0; k < count && j != i; ++k) {
          if (k == i || k == j) continue;
          const Eigen::Vector3d b = points_m_.col(k) - points_m_.col(i);
          const double longest = std::max({a.norm(), b.norm(), (a - b).norm()});
          if (a.cross(b).norm() > kThinTriple * longest * longest) triples.push_back({i, j, k});
        }
      }
    }
    return triples;
  }

  // Detections that span large triangles, by draws that are the same each time: any of them may be no bead.
  std::vector<BeadTriple> detectionTriples() const {
    const auto count = static_cast<int>(view_.pinhole_px.cols());
    std::vector<std::pair<double, BeadTriple>> drawn;
    std::mt19937_64 engine(1);
    for (int n = 0; n < 40 * kTriples; ++n) {
      BeadTriple t{};
      for (int& i : t) i = static_cast<int>(engine() % static_cast<std::uint64_t>(count));
      const Eigen::Vector2d a = view_.pinhole_px.col(t[1]) - view_.pinhole_px.col(t[0]),
                            b = view_.pinhole_px.col(t[2]) - view_.pinhole_px.col(t[0]);
      drawn.emplace_back(-std::abs(a.x() * b.y() - a.y() * b.x()), t);
    }
    // Not the largest of all, which would have the same corners again and again.
    std::vector<BeadTriple> triples;
    for (int n = 0; n < kTriples; ++n) {
      triples.push_back(std::min_element(drawn.begin() + 40 * n, drawn.begin() + 40 * (n + 1))->second);
    }
    return triples;
  }

  std::vector<PoseHypothesis> hypotheses(const BeadTriple& detections, double f_px) const {
    const double c_px = 0.5 * (view_.width_px - 1);
    Eigen::Matrix3d K, rays, points_m;
    K << f_px, 0, c_px, 0, f_px, c_px, 0, 0, 1;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d px = view_.pinhole_px.col(detections[k]);
      rays.col(k) = Eigen::Vector3d((px.x() - c_px) / f_px, (px.y() - c_px) / f_px, 1).normalized();
    }
    std::vector<PoseHypothesis> found;
    std::vector<Pose> poses;
    for (const BeadTriple& beads : triples_) {
      for (int k = 0; k < 3; ++k) points_m.col(k) = points_m_.col(beads[k]);
      threePointPoses(points_m, rays, poses);
      for (const Pose& T : poses) {
        const Matrix34d P = K * T.matrix().topRows<3>();
        const int score = scoreOf(P);
        if (score > kLeastScore) found.push_back({P, score});
      }
    }
    const std::size_t kept = std::min(kRefinedPoses, found.size());
    std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), found.end(),
                      [](const PoseHypothesis& a, const PoseHypothesis& b) { return a.score > b.score; });
    found.resize(kept);
    return found;
  }

  // kLeastScore for what is behind the source, or explains too little.
  int scoreOf(const Matrix34d& P) const {
    int near = 0, unseen = 0;
    for (Eigen::Index i = 0; i < points_m_.cols(); ++i) {
      const Eigen::Vector3d p = P.leftCols<3>() * points_m_.col(i) + P.col(3);
      if (!(p.z() > 0)) return kLeastScore;
      const int seen = seen_.at(p.hnormalized());
      near += seen == 2;
      unseen += seen == 1;
    }
    return near < kMinMatchedBeads ? kLeastScore : 2 * near - unseen;
  }

  // Each detection at most one bead and the reverse, the nearest pairs first.
  std::vector<std::optional<int>> assigned(const Matrix34d& P, double within_px) const {
    const Eigen::Matrix2Xd at_px = projectedBy(P, points_m_);
    std::vector<std::tuple<double, int, int>> pairs;
    for (int i = 0; i < at_px.cols(); ++i) {
      for (int d = 0; d < view_.pinhole_px.cols(); ++d) {
        const double distance = (at_px.col(i) - view_.pinhole_px.col(d)).norm();
        if (distance < within_px) pairs.emplace_back(distance, d, i);
      }
    }
    std::sort(pairs.begin(), pairs.end());
    std::vector<std::optional<int>> names(static_cast<std::size_t>(view_.pinhole_px.cols()));
    std::set<int> taken;
    for (const auto& [distance, d, i] : pairs) {
      if (names[static_cast<std::size_t>(d)] || !taken.insert(i).second) continue;
      names[static_cast<std::size_t>(d)] = i;
    }
    return names;
  }

  std::optional<Matrix34d> projectionOf(const std::vector<std::optional<int>>& names) const {
    Eigen::Matrix3Xd points_m(3, names.size());
    Eigen::Matrix2Xd pixels_px(2, names.size());
    Eigen::Index count = 0;
    for (std::size_t d = 0; d < names.size(); ++d) {
      if (!names[d]) continue;
      points_m.col(count) = points_m_.col(*names[d]);
      pixels_px.col(count++) = view_.pinhole_px.col(static_cast<Eigen::Index>(d));
    }
    if (count < kMinMatchedBeads) return std::nullopt;
    return directLinearTransform(points_m.leftCols(count), pixels_px.leftCols(count));
  }

  std::optional<PhantomReading> readingBy(const std::vector<std::optional<int>>& names, int unseen) const {
    const auto P = projectionOf(names);
    if (!P) return std::nullopt;
    const ProjectionParts parts = decomposed(*P);
    PhantomReading reading;
    reading.bead = names;
    reading.unseen = unseen;
    reading.mirrored = parts.mirrored;
    reading.K = parts.K;
    reading.T_camera_phantom = parts.T_camera_model;
    double squared = 0;
    for (std::size_t d = 0; d < names.size(); ++d) {
      if (!names[d]) continue;
      const Eigen::Vector2d seen_px = view_.pinhole_px.col(static_cast<Eigen::Index>(d));
      const double distance = distance_px(*P, points_m_.col(*names[d]), seen_px);
      squared += distance * distance;
      ++reading.matched;
    }
    reading.rms_px = std::sqrt(squared / reading.matched);
    return reading;
  }

  std::optional<PhantomReading> refined(const PoseHypothesis& hypothesis) const {
    Matrix34d P = hypothesis.P;
    std::vector<std::optional<int>> names;
    for (const double within : kRefinedWithin) {
      names = assigned(P, within * view_.width_px);
      const auto next = projectionOf(names);
      if (!next) return std::nullopt;
      P = *next;
    }
    names = assigned(P, kRefinedWithin[std::size(kRefinedWithin) - 1] * view_.width_px);
    const Eigen::Matrix2Xd at_px = projectedBy(P, points_m_);
    int open = 0;
    for (Eigen::Index i = 0; i < at_px.cols(); ++i) open += view_.is_open(at_px.col(i));
    const auto matched = std::count_if(names.begin(), names.end(), [](const auto& n) { return n.has_value(); });
    return readingBy(names, std::max(0, open - static_cast<int>(matched)));
  }

  // The best, and those that fit as well, each once.
  std::vector<PhantomReading> refined(const std::vector<PoseHypothesis>& hypotheses) const {
    std::vector<PhantomReading> readings;
    for (const PoseHypothesis& hypothesis : hypotheses) {
      const auto reading = refined(hypothesis);
      if (!reading || reading->mirrored) continue;  // A pose of P3P mirrors nothing: such a projection fits nothing.
      const bool known = std::any_of(readings.begin(), readings.end(),
                                     [&](const PhantomReading& other) { return other.bead == reading->bead; });
      if (!known) readings.push_back(*reading);
    }
    if (readings.empty()) return {};
    const auto worth = [](const PhantomReading& r) { return 2 * r.matched - r.unseen; };
    std::sort(readings.begin(), readings.end(), [&](const PhantomReading& a, const PhantomReading& b) {
      return std::make_pair(-worth(a), a.rms_px) < std::make_pair(-worth(b), b.rms_px);
    });
    const PhantomReading best = readings.front();
    readings.erase(std::remove_if(readings.begin(), readings.end(),
                                  [&](const PhantomReading& r) {
                                    return r.matched < best.matched - 1 || worth(r) < worth(best) - 3;
                                  }),
                   readings.end());
    return readings;
  }

  const BeadPhantom& phantom_;
  const UncodedView& view_;
  Eigen::Matrix3Xd points_m_;
  std::vector<PhantomSymmetry> symmetries_;
  SeenMap seen_;
  std::vector<BeadTriple> triples_;
};

// Left and right exchanged.
UncodedView flipped(const UncodedView& view) {
  UncodedView other = view;
  const double last_px = view.width_px - 1;
  other.pinhole_px.row(0) = (last_px - view.pinhole_px.row(0).array()).matrix();
  const auto is_open = view.is_open;
  other.is_open = [=](const Eigen::Vector2d& at) { return is_open({last_px - at.x(), at.y()}); };
  return other;
}

void requireDistance(const std::string& place, const BeadPhantom& phantom, const PhantomReading& reading) {
  const double depth_m = (reading.T_camera_phantom * phantom.center_m()).z();
  if (depth_m >= kNearestPhantom_m && depth_m <= kFarthestPhantom_m) return;
  throw InputError(place, "phantom", formatted("%.4g mm from the source", 1e3 * depth_m),
                   "must be 300 to 5000: is the phantom's unit or scale wrong?");
}

}  // namespace

std::vector<PhantomReading> readingsOf(const std::string& place, const BeadPhantom& phantom, const UncodedView& view) {
  if (view.pinhole_px.cols() < kMinMatchedBeads) {
    throw InputError(place, "beads", std::to_string(view.pinhole_px.cols()), "must be at least 8 that are seen");
  }
  const UncodedSearch search(phantom, view);
  const std::vector<PhantomReading> readings = search.find();
  if (readings.empty()) {
    const bool mirrored = !UncodedSearch(phantom, flipped(view)).find().empty();
    throw InputError(place, "beads", std::to_string(view.pinhole_px.cols()),
                     mirrored ? "fit the phantom in a mirrored picture only: flip the pictures (--mirrored), or the "
                                "phantom's file is mirrored"
                              : "no pose of " + phantom.name +
                                    " explains them with two thirds of its beads seen that should be: is its file of "
                                    "another phantom, or shuffled?");
  }
  requireDistance(place, phantom, readings.front());
  return search.withSymmetries(readings);
}

}  // namespace angio::calibration
