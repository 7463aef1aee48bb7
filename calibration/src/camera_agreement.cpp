// SPDX-License-Identifier: GPL-2.0-or-later
#include "camera_bundle.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"

namespace angio::calibration {
namespace {

constexpr double kRobustScale = 2.5;        // Of Cauchy's loss, in standard deviations.
constexpr double kRayleighMedian = 1.1774;  // Median length of a residual of unit variance in each axis.
// Views do not share one camera when K's of their own explain them better than chance by this factor, and their mean
// square falls by this factor: no real bead is so well known that the first alone says much.
constexpr double kBeyondChance = 4, kBeyondMatter = 1.1;

// Standard deviation per axis, in units of the beads' sigmas, whatever some beads do.
double robustNoise(const CameraBundle& bundle) {
  std::vector<double> lengths;
  for (const BundleView& view : bundle.views) {
    const Eigen::Matrix2Xd r = bundle.residualsOf(view);
    for (Eigen::Index i = 0; i < r.cols(); ++i) {
      if (view.use[i]) lengths.push_back(r.col(i).norm() / view.stds_px[i]);
    }
  }
  const auto middle = lengths.begin() + lengths.size() / 2;
  std::nth_element(lengths.begin(), middle, lengths.end());
  return std::max(1e-9, *middle / kRayleighMedian);
}

// Marks anew what counts: also beads that a view's own projection, without distortion, did not fit.
void chooseBeads(CameraBundle& bundle, double largest) {
  for (BundleView& view : bundle.views) {
    const Eigen::Matrix2Xd r = bundle.residualsOf(view);
    for (Eigen::Index i = 0; i < r.cols(); ++i) {
      view.use[i] = r.col(i).norm() <= largest * view.stds_px[i];
    }
  }
}

// How much a view's squared residuals would fall with a K of its own, to first order, and what they are.
struct OwnCamera {
  double squared = 0, gain = 0;
  int residuals = 0;
};

OwnCamera ownCamera(const CameraBundle& bundle, const BundleView& view) {
  const ViewInformation at = informationOf(bundle, view);
  Eigen::MatrixXd S = at.reducedLens();
  S.diagonal() *= 1 + 1e-9;  // One view of a plane leaves K open.
  const Eigen::VectorXd gradient = at.reducedGradient();
  return {at.squared, gradient.dot(S.ldlt().solve(gradient)), at.residuals};
}

// Place of the view that gains most by a K of its own, if the views do not share one.
std::optional<std::size_t> mostForeign(const CameraBundle& bundle) {
  const auto lens = static_cast<double>(bundle.values.size()), views = static_cast<double>(bundle.views.size());
  if (bundle.views.size() < 2) return std::nullopt;
  double squared = 0, gain = 0, residuals = 0, most = 0;
  std::size_t foreign = 0;
  for (std::size_t v = 0; v < bundle.views.size(); ++v) {
    const OwnCamera own = ownCamera(bundle, bundle.views[v]);
    squared += own.squared;
    gain += own.gain;
    residuals += own.residuals;
    if (own.gain > most) foreign = v;
    most = std::max(most, own.gain);
  }
  const double left = std::max(0.0, squared - gain), freedom = residuals - (6 + lens) * views;
  if (!(freedom > 0)) return std::nullopt;
  const double variance = left / freedom;
  const bool beyond_chance = gain > kBeyondChance * variance * lens * views;
  const bool beyond_matter = squared / (residuals - 6 * views) > kBeyondMatter * variance;
  return beyond_chance && beyond_matter ? std::optional(foreign) : std::nullopt;
}

double usedShare(const BundleView& view) {
  return static_cast<double>(std::count(view.use.begin(), view.use.end(), true)) / static_cast<double>(view.use.size());
}

// Place of the view of which fewest beads fit the camera, if those are less than half of its own: what is left of such
// a view fits any camera.
std::optional<std::size_t> mostlyUnused(const CameraBundle& bundle) {
  if (bundle.views.size() < 2) return std::nullopt;
  const auto least = std::min_element(bundle.views.begin(), bundle.views.end(),
                                      [](const auto& a, const auto& b) { return usedShare(a) < usedShare(b); });
  if (usedShare(*least) >= 0.5) return std::nullopt;
  return static_cast<std::size_t>(least - bundle.views.begin());
}

}  // namespace

std::vector<std::size_t> solveRobustly(CameraBundle& bundle, const std::vector<BeadView>& views,
                                       const CameraCalibrationSettings& settings) {
  const std::size_t given = bundle.views.size();
  std::vector<std::size_t> left_out;
  for (;;) {
    const auto require = [&](bool usable) {
      if (!usable) throw InputError("views", "bundle", "", "no camera explains them: the solver found no answer");
    };
    require(bundle.solve(kRobustScale * robustNoise(bundle), settings.max_iterations));
    chooseBeads(bundle, settings.outlier_stds * robustNoise(bundle));
    require(bundle.solve(kRobustScale * robustNoise(bundle), settings.max_iterations));
    const auto unused = mostlyUnused(bundle), foreign = unused ? unused : mostForeign(bundle);
    if (foreign) {
      left_out.push_back(bundle.views[*foreign].index);
      if (static_cast<double>(left_out.size()) > settings.max_outlier_share * static_cast<double>(given)) {
        std::vector<std::string> names;
        for (const std::size_t v : left_out) names.push_back(views[v].name);
        throw InputError(joined(names), "views",
                         std::to_string(left_out.size()) + " and more of " + std::to_string(given),
                         "do not share one camera with the others: are they of another machine, or does the detector "
                         "distort (--distortion)?");
      }
      bundle.views.erase(bundle.views.begin() + static_cast<std::ptrdiff_t>(*foreign));
      continue;
    }
    for (int round = 0; round < 2; ++round) {
      chooseBeads(bundle, settings.outlier_stds * robustNoise(bundle));
      require(bundle.solve(std::nullopt, settings.max_iterations));
    }
    break;
  }
  for (const BundleView& view : bundle.views) {
    if (usedShare(view) >= 1 - settings.max_outlier_share) continue;
    const auto unused = std::count(view.use.begin(), view.use.end(), false);
    throw InputError(views[view.index].name, "beads", formatted("%td of %zu", unused, view.use.size()),
                     "are too many that do not fit the camera");
  }
  return left_out;
}

}  // namespace angio::calibration
