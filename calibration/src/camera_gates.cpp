// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "camera_bundle.hpp"
#include "information.hpp"

namespace angio::calibration {
namespace {

constexpr double kWorstNoise_px = 0.5;  // Of beads found by any means; settings may know better.
constexpr std::size_t kMinSeenBeads = 8, kMinMarks = 5;
constexpr double kSame_px = 2;  // Root mean square: nobody moves a phantom so little on purpose.

// Whether two views show their common beads in one place.
bool sameView(const BeadView& a, const BeadView& b) {
  std::map<int, Eigen::Vector2d> places;
  for (const SeenBead& seen : a.beads) places[seen.bead] = seen.center_px;
  double squares = 0;
  int common = 0;
  for (const SeenBead& seen : b.beads) {
    const auto place = places.find(seen.bead);
    if (place == places.end()) continue;
    squares += (place->second - seen.center_px).squaredNorm();
    ++common;
  }
  return common > 0 && std::sqrt(squares / common) < kSame_px;
}

// Copies average noise and hide everything else.
void requireDifferentViews(const std::vector<BeadView>& views) {
  std::vector<const BeadView*> used;
  for (const BeadView& view : views) {
    if (!view.held_out) used.push_back(&view);
  }
  if (used.size() < 2) return;
  if (!std::all_of(used.begin() + 1, used.end(), [&](const BeadView* view) { return sameView(*used[0], *view); })) {
    return;
  }
  throw InputError("views", "beads", std::to_string(used.size()) + " views that show them in one place",
                   "must show the phantom from different sides: all are copies of " + used[0]->name);
}

}  // namespace

void checkViews(const BeadPhantom& phantom, const DetectorOfViews& detector, const std::vector<BeadView>& views,
                const CameraCalibrationSettings& settings) {
  checkSettings("camera calibration", settings);
  if (detector.distortion && (settings.distortion != LensKind::kNone || settings.skew)) {
    throw InputError("camera calibration", "distortion, skew", "",
                     "must be none where the detector's distortion is known by a grid");
  }
  const bool flat = phantom.isPlanar();
  const std::size_t fewest_beads = flat ? kMinMarks : kMinSeenBeads, fewest_views = flat ? 3 : 1;
  std::size_t used = 0;
  for (const BeadView& view : views) {
    used += !view.held_out;
    std::set<int> named;
    for (const SeenBead& seen : view.beads) {
      const std::string number = std::to_string(seen.bead);
      if (seen.bead < 0 || seen.bead >= static_cast<int>(phantom.beads.size())) {
        throw InputError(view.name, "bead", number,
                         "must be 0 to " + std::to_string(phantom.beads.size() - 1) + ": the phantom has no other");
      }
      if (!named.insert(seen.bead).second) throw InputError(view.name, "bead", number, "must not be named twice");
      const Eigen::Vector2d& px = seen.center_px;
      if (!(px.x() >= -0.5 && px.y() >= -0.5 && px.x() <= detector.width_px - 0.5 &&
            px.y() <= detector.height_px - 0.5)) {
        throw InputError(view.name + ": bead " + number, "x_px, y_px", formatValue(px.x()) + ", " + formatValue(px.y()),
                         "must lie on the detector, " + std::to_string(detector.width_px) + " x " +
                             std::to_string(detector.height_px) + " px");
      }
      requirePositive(view.name + ": bead " + number, "sigma_px", seen.std_px);
    }
    if (view.beads.size() < fewest_beads) {
      throw InputError(view.name, "beads", std::to_string(view.beads.size()),
                       "must be at least " + std::to_string(fewest_beads));
    }
  }
  if (used < fewest_views) {
    throw InputError("views", "count", std::to_string(used),
                     "must be at least " + std::to_string(fewest_views) + " that are not held out" +
                         (flat ? ", of a flat phantom" : ""));
  }
  requireDifferentViews(views);
}

void requireObservable(const CameraBundle& start, const BeadPhantom& phantom, const std::vector<BeadView>& views,
                       const CameraCalibrationSettings& settings) {
  const Eigen::Index n = start.values.size();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  double deepest_m = 0;
  for (const BundleView& view : start.views) {
    if (views[view.index].held_out) continue;
    information += informationOf(start, view).reducedLens();
    const Eigen::RowVectorXd depths = (view.T_camera_phantom * view.points_m).row(2);
    deepest_m = std::max(deepest_m, depths.maxCoeff() - depths.minCoeff());
  }
  const Eigen::MatrixXd covariance = covarianceOf(information, 1e-14);
  const double noise_px = settings.noise_px > 0 ? settings.noise_px : kWorstNoise_px;
  const double sigma = noise_px * std::sqrt(std::abs(covariance(0, 0))) / start.values[0];
  if (sigma <= settings.max_focal_std) return;
  throw InputError("views", start.parameters.names[0], formatted("%.4g +- %.2g %%", start.values[0], 100 * sigma),
                   formatted("focal length and depth cannot be told apart: beads of %s are %.3g mm deep at most, "
                             "for errors of %.2g px",
                             phantom.name.c_str(), 1e3 * deepest_m, noise_px));
}

}  // namespace angio::calibration
