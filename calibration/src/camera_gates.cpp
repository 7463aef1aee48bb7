// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "angio/base/errors.hpp"
#include "camera_bundle.hpp"

namespace angio::calibration {
namespace {

constexpr std::size_t kFewestBeads = 8, kFewestMarks = 5;
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
  const bool flat = phantom.isPlanar();
  const std::size_t fewest_beads = flat ? kFewestMarks : kFewestBeads, fewest_views = flat ? 3 : 1;
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

namespace {

// Throws when two of the beads that do not fit would fit with each other's numbers.
void refuseSwapped(const BeadView& view, const AgreedProjection& agreed, const Eigen::Matrix3Xd& points,
                   const Eigen::Matrix2Xd& seen_px, const std::vector<bool>& fits, double tolerance_px) {
  for (int i = 0; i < static_cast<int>(fits.size()); ++i) {
    for (int j = 0; j < i && !fits[i]; ++j) {
      if (fits[j]) continue;
      if (distance_px(agreed.P, points.col(i), seen_px.col(j)) > tolerance_px ||
          distance_px(agreed.P, points.col(j), seen_px.col(i)) > tolerance_px) {
        continue;
      }
      const int a = view.beads[j].bead, b = view.beads[i].bead;
      throw InputError(view.name, "bead", std::to_string(std::min(a, b)) + ", " + std::to_string(std::max(a, b)),
                       "are swapped: each stands where the other must be");
    }
  }
}

}  // namespace

ViewProjection projectionOf(const BeadPhantom& phantom, const BeadView& view, double detector_width_px,
                            double min_share, const std::optional<Pose>& T_plane_phantom) {
  const double tolerance_px = 0.01 * detector_width_px;
  Eigen::Matrix3Xd points(3, view.beads.size());
  Eigen::Matrix2Xd seen_px(2, view.beads.size());
  for (std::size_t i = 0; i < view.beads.size(); ++i) {
    const Eigen::Vector3d& point_m = phantom.beads[view.beads[i].bead].position_m;
    points.col(i) = T_plane_phantom ? Eigen::Vector3d(*T_plane_phantom * point_m) : point_m;
    seen_px.col(i) = view.beads[i].center_px;
  }
  const auto agreed = agreedProjection(points, seen_px, tolerance_px, T_plane_phantom.has_value());
  if (!agreed) {
    throw InputError(view.name, "beads", std::to_string(view.beads.size()),
                     "must not lie on a line or in a plane, which leaves their projection open");
  }
  ViewProjection result;
  result.P = agreed->P;
  result.H << agreed->P.leftCols<2>(), agreed->P.col(3);
  result.fits.assign(view.beads.size(), false);
  for (const int i : agreed->points) result.fits[i] = true;
  refuseSwapped(view, *agreed, points, seen_px, result.fits, tolerance_px);
  const std::size_t fitting = agreed->points.size();
  if (static_cast<double>(fitting) < min_share * static_cast<double>(view.beads.size())) {
    throw InputError(view.name, "beads", std::to_string(fitting) + " of " + std::to_string(view.beads.size()),
                     "must fit one projection of the phantom: are the numbers, or the phantom, of another set?");
  }
  return result;
}

}  // namespace angio::calibration
