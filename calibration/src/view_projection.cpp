// SPDX-License-Identifier: GPL-2.0-or-later
#include "view_projection.hpp"

#include <algorithm>
#include <numeric>
#include <random>

#include "angio/base/errors.hpp"

namespace angio::calibration {
namespace {

constexpr double kTolerance = 0.01;  // Of the detector's width.
constexpr int kDraws = 400;          // Of six beads, all right ones once in 1 / 0.75^6 = 6 with a quarter wrong.

class ProjectionFit {
 public:
  ProjectionFit(const BeadPhantom& phantom, const BeadView& view, double tolerance_px,
                const std::optional<Pose>& T_plane_phantom)
      : view_(view), tolerance_px_(tolerance_px), flat_(T_plane_phantom.has_value()) {
    points_ = phantom.positions_m();
    if (flat_) points_ = *T_plane_phantom * points_;
    seen_px_.resize(2, static_cast<Eigen::Index>(view.beads.size()));
    for (std::size_t i = 0; i < view.beads.size(); ++i) {
      seen_px_.col(static_cast<Eigen::Index>(i)) = view.beads[i].center_px;
    }
  }

  /// The projection of the chosen beads of the view, if they decide it.
  std::optional<Matrix34d> fit(const std::vector<int>& chosen) const {
    Eigen::Matrix3Xd points(3, chosen.size());
    Eigen::Matrix2Xd pixels(2, chosen.size());
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      points.col(static_cast<Eigen::Index>(k)) = pointOf(chosen[k]);
      pixels.col(static_cast<Eigen::Index>(k)) = seen_px_.col(chosen[k]);
    }
    if (!flat_) return directLinearTransform(points, pixels);
    const auto H = directLinearHomography(points.topRows<2>(), pixels);
    if (!H) return std::nullopt;
    Matrix34d P = Matrix34d::Zero();  // The plane's z counts for nothing.
    P.leftCols<2>() = H->leftCols<2>();
    P.col(3) = H->col(2);
    return P;
  }

  std::vector<int> fitting(const Matrix34d& P) const {
    std::vector<int> chosen;
    for (int i = 0; i < static_cast<int>(view_.beads.size()); ++i) {
      if (distance_px(P, view_.beads[static_cast<std::size_t>(i)].bead, i) < tolerance_px_) chosen.push_back(i);
    }
    return chosen;
  }

  /// The fit that most beads agree on.
  std::pair<Matrix34d, std::vector<int>> mostAgreed() const {
    std::vector<int> all(view_.beads.size());
    std::iota(all.begin(), all.end(), 0);
    std::pair<Matrix34d, std::vector<int>> best{Matrix34d::Zero(), {}};
    if (const auto P = fit(all)) best = {*P, fitting(*P)};
    if (best.second.size() == all.size()) return best;
    std::mt19937 engine(1);
    const std::size_t sample = flat_ ? 4 : 6;
    for (int draw = 0; draw < kDraws && all.size() >= sample; ++draw) {
      std::vector<int> some = all;
      for (std::size_t k = 0; k < sample; ++k) std::swap(some[k], some[k + engine() % (some.size() - k)]);
      some.resize(sample);
      const auto P = fit(some);
      if (!P) continue;
      auto chosen = fitting(*P);
      if (chosen.size() > best.second.size()) best = {*P, std::move(chosen)};
    }
    for (int i = 0; i < 5; ++i) {
      const auto P = fit(best.second);
      if (!P) break;
      best = {*P, fitting(*P)};
    }
    return best;
  }

  double distance_px(const Matrix34d& P, int bead, int seen) const {
    const Eigen::Vector3d h = P * points_.col(bead).homogeneous();
    if (!(h.z() > 0)) return std::numeric_limits<double>::infinity();
    return (h.hnormalized() - seen_px_.col(seen)).norm();
  }

  /// Throws when two of the beads that do not fit would fit with each other's numbers.
  void refuseSwapped(const Matrix34d& P, const std::vector<bool>& fits) const {
    for (int i = 0; i < static_cast<int>(fits.size()); ++i) {
      for (int j = 0; j < i && !fits[static_cast<std::size_t>(i)]; ++j) {
        if (fits[static_cast<std::size_t>(j)]) continue;
        const int a = view_.beads[static_cast<std::size_t>(j)].bead, b = view_.beads[static_cast<std::size_t>(i)].bead;
        if (distance_px(P, b, j) > tolerance_px_ || distance_px(P, a, i) > tolerance_px_) continue;
        throw InputError(view_.name, "bead", std::to_string(std::min(a, b)) + ", " + std::to_string(std::max(a, b)),
                         "are swapped: each stands where the other must be");
      }
    }
  }

 private:
  Eigen::Vector3d pointOf(int seen) const { return points_.col(view_.beads[static_cast<std::size_t>(seen)].bead); }

  const BeadView& view_;
  double tolerance_px_;
  bool flat_;
  Eigen::Matrix3Xd points_;
  Eigen::Matrix2Xd seen_px_;
};

}  // namespace

ViewProjection projectionOf(const BeadPhantom& phantom, const BeadView& view, double detector_width_px,
                            double min_share, const std::optional<Pose>& T_plane_phantom) {
  const ProjectionFit fit(phantom, view, kTolerance * detector_width_px, T_plane_phantom);
  const auto [P, chosen] = fit.mostAgreed();
  const std::string count = std::to_string(chosen.size()) + " of " + std::to_string(view.beads.size());
  if (P.isZero()) {
    throw InputError(view.name, "beads", std::to_string(view.beads.size()),
                     "must not lie on a line or in a plane, which leaves their projection open");
  }
  ViewProjection result;
  result.P = P;
  result.H << P.leftCols<2>(), P.col(3);
  result.fits.assign(view.beads.size(), false);
  for (const int i : chosen) result.fits[static_cast<std::size_t>(i)] = true;
  fit.refuseSwapped(P, result.fits);
  if (static_cast<double>(chosen.size()) < min_share * static_cast<double>(view.beads.size())) {
    throw InputError(view.name, "beads", count,
                     "must fit one projection of the phantom: are the numbers, or the phantom, of another set?");
  }
  return result;
}

}  // namespace angio::calibration
