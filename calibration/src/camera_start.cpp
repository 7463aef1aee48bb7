// SPDX-License-Identifier: GPL-2.0-or-later
#include "camera_bundle.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "angio/geometry/decompositions.hpp"
#include "information.hpp"
#include "map_turn.hpp"

namespace angio::calibration {
namespace {

constexpr double kMinTilt_rad = 0.035;  // Between two tilts of a plane: 2 deg.
constexpr double kSameDistance_m = 5e-3;
constexpr double kNearest_m = 0.1, kFarthest_m = 5;  // From the source to a phantom.

// What one view says by itself, without K.
struct ViewProjection {
  Matrix34d P = Matrix34d::Zero();                  // Of a phantom with depth.
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();  // Of a flat one, from the axes of its plane.
  std::vector<bool> fits;                           // One a bead of the view.
};

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

// Finds the projection that most of a view's beads agree on, to a hundredth of the detector's width: enough to tell
// beads apart, wide enough for a detector's distortion. Throws InputError that names view and beads when two are
// swapped, when fewer than `min_share` agree, and when the beads leave the projection open.
//
// `T_plane_phantom` is a flat phantom's own frame, whose z is the plane's normal; absent for one with depth.
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

double medianOf(std::vector<double> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The distance that most views have; 1 m when they do not say, which is then nothing but a unit.
double mostUsedDistance_m(const std::vector<BeadView>& views) {
  std::map<double, int> counts;
  for (const BeadView& view : views) {
    if (view.source_detector_distance_m) ++counts[*view.source_detector_distance_m];
  }
  double best = 1;
  int most = 0;
  for (const auto& [distance_m, count] : counts) {
    if (count > most) best = distance_m;
    most = std::max(most, count);
  }
  return best;
}

// The frame of a flat phantom: its own axes where its points already have z = 0.
Pose planeFrame(const BeadPhantom& phantom) {
  Pose T = Pose::Identity();
  const Eigen::Matrix3Xd points = phantom.positions_m();
  if (points.row(2).cwiseAbs().maxCoeff() == 0) return T;
  const Eigen::Matrix3Xd centered = points.colwise() - phantom.center_m();
  const SymmetricEigen3 spread = eigenOfSymmetric(centered * centered.transpose());
  Eigen::Matrix3d axes;
  axes << spread.vectors.col(2), spread.vectors.col(1), Eigen::Vector3d::Zero();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  T.linear() = axes.transpose();
  T.translation() = -axes.transpose() * phantom.center_m();
  return T;
}

void refuseMirrored(const std::vector<BeadView>& views, const std::vector<ViewProjection>& projections) {
  std::vector<std::string> mirrored;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!(projections[v].P.leftCols<3>().determinant() > 0)) mirrored.push_back(views[v].name);
  }
  if (mirrored.empty()) return;
  throw InputError(
      joined(mirrored, 5), "beads", std::to_string(mirrored.size()) + " of " + std::to_string(views.size()),
      "views are mirrored against the phantom: turn the images, or the phantom's file, the right way round");
}

// Planes at one tilt have one vanishing line: its distance in units of the focal length is the tilt.
void requireTilts(const std::vector<ViewProjection>& projections, const std::vector<bool>& used,
                  const DetectorOfViews& detector) {
  const Eigen::Vector2d middle_px(0.5 * (detector.width_px - 1), 0.5 * (detector.height_px - 1));
  // No tilt is known before the focal length is; detectors are narrower than a fifth of it, or, of a lens, about as
  // wide as it. Taking the smaller makes tilts look smaller.
  const double unit_px = detector.width_px;
  double widest = 0;
  std::vector<Eigen::Vector3d> lines;
  for (std::size_t v = 0; v < projections.size(); ++v) {
    if (!used[v]) continue;
    Eigen::Matrix3d N = Eigen::Matrix3d::Identity();
    N.topLeftCorner<2, 2>() /= unit_px;
    N.topRightCorner<2, 1>() = -middle_px / unit_px;
    const Eigen::Matrix3d H = N * projections[v].H;
    lines.push_back(H.col(0).cross(H.col(1)).normalized());  // The image of the plane's points at infinity.
    for (const auto& other : lines) widest = std::max(widest, lines.back().cross(other).norm());
  }
  if (widest > kMinTilt_rad) return;
  throw InputError("views", "tilt", formatted("%.2f deg", radToDeg(std::asin(widest))),
                   "the phantom is flat and all views are parallel to one: tilt it by some tens of degrees between "
                   "views, about two axes");
}

// Focal lengths with the principal point in the image's middle, as OpenCV has them; all else is for the bundle to find.
Eigen::Matrix3d planarStart(const BeadPhantom& phantom, const Pose& T_plane_phantom, const std::vector<BeadView>& views,
                            const std::vector<ViewProjection>& projections, const DetectorOfViews& detector) {
  std::vector<std::vector<cv::Point3f>> marks;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].held_out) continue;
    marks.emplace_back();
    pixels.emplace_back();
    for (std::size_t i = 0; i < views[v].beads.size(); ++i) {
      if (!projections[v].fits[i]) continue;
      const SeenBead& seen = views[v].beads[i];
      const Eigen::Vector3f mark = (T_plane_phantom * phantom.beads[seen.bead].position_m).cast<float>();
      marks.back().emplace_back(mark.x(), mark.y(), 0.0F);
      pixels.back().emplace_back(static_cast<float>(seen.center_px.x()), static_cast<float>(seen.center_px.y()));
    }
  }
  Eigen::Matrix3d K;
  cv::cv2eigen(cv::initCameraMatrix2D(marks, pixels, {detector.width_px, detector.height_px}, 0), K);
  const double max_focal_px = 50 * std::hypot(detector.width_px, detector.height_px);
  if (K.allFinite() && K(0, 0) > 0 && K(0, 0) < max_focal_px && K(1, 1) > 0 && K(1, 1) < max_focal_px) return K;
  throw InputError("views", "tilt", "",
                   "no camera explains the views of a flat phantom: tilt it by more between views");
}

Eigen::Matrix3d solidStart(const std::vector<ViewProjection>& projections, const std::vector<bool>& used,
                           const std::vector<double>& stretches) {
  std::vector<double> fx, fy, cx, cy;
  for (std::size_t v = 0; v < projections.size(); ++v) {
    if (!used[v]) continue;
    const Eigen::Matrix3d K = decomposed(projections[v].P).K;
    fx.push_back(K(0, 0) / stretches[v]);
    fy.push_back(K(1, 1) / stretches[v]);
    cx.push_back(K(0, 2));
    cy.push_back(K(1, 2));
  }
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = medianOf(fx);
  K(1, 1) = medianOf(fy);
  K(0, 2) = medianOf(cx);
  K(1, 2) = medianOf(cy);
  return K;
}

void requireUnits(const CameraBundle& bundle, const DetectorOfViews& detector, const std::vector<BeadView>& views,
                  const Eigen::Vector3d& center_m) {
  const double f_px = bundle.lens()[kFx], distance_m = bundle.model.reference_distance_m;
  const bool says =
      std::any_of(views.begin(), views.end(), [](const BeadView& v) { return v.source_detector_distance_m; });
  if (says && detector.pixel_spacing_m) {
    const double expected_px = distance_m / *detector.pixel_spacing_m;
    if (!(f_px > 0.5 * expected_px && f_px < 2 * expected_px)) {
      throw InputError("views", "focal length", formatted("%.6g px", f_px),
                       formatted("must be near source_detector_distance_mm / pixel_spacing_mm = %.6g px: are the units "
                                 "right?",
                                 expected_px));
    }
  }
  for (const BundleView& view : bundle.views) {
    const double depth_m = (view.T_camera_phantom * center_m).z();
    if (depth_m > kNearest_m && depth_m < kFarthest_m) continue;
    throw InputError(views[view.index].name, "depth", formatted("%.6g mm", 1e3 * depth_m),
                     "the phantom must be 100 to 5000 mm from the source: are the phantom's millimetres right?");
  }
}

// The views as a pinhole camera sees them, where the detector's distortion is known. Throws InputError that names the
// view and the bead where no pinhole's pixel comes to be.
std::vector<BeadView> pinholeViews(const DetectorOfViews& detector, std::vector<BeadView> views) {
  if (!detector.distortion) return views;
  for (BeadView& view : views) {
    for (SeenBead& bead : view.beads) {
      const auto pinhole_px = detector.distortion->undistorted(bead.center_px);
      if (!pinhole_px) {
        throw InputError(view.name, "bead", std::to_string(bead.bead),
                         "is seen where the detector's map has no inverse");
      }
      bead.center_px = *pinhole_px;
    }
  }
  return views;
}

}  // namespace

CameraBundle startOf(const BeadPhantom& phantom, const DetectorOfViews& detector, const std::vector<BeadView>& given,
                     const CameraCalibrationSettings& settings) {
  const std::vector<BeadView> views = pinholeViews(detector, given);
  const bool flat = phantom.isPlanar();
  const std::optional<Pose> T_plane_phantom = flat ? std::optional(planeFrame(phantom)) : std::nullopt;
  std::vector<ViewProjection> projections;
  std::vector<bool> used;
  std::vector<double> stretches;
  CameraBundle bundle;
  bundle.model.kind = settings.distortion;
  bundle.model.known = detector.distortion;
  if (detector.turns_since_map) bundle.model.turn = turnOf(detector.distortion.value());
  bundle.model.middle_px = {0.5 * (detector.width_px - 1), 0.5 * (detector.height_px - 1)};
  bundle.model.half_width_px = 0.5 * detector.width_px;
  bundle.model.reference_distance_m = mostUsedDistance_m(views);
  double nearest_m = bundle.model.reference_distance_m, farthest_m = nearest_m;
  for (const BeadView& view : views) {
    projections.push_back(
        projectionOf(phantom, view, detector.width_px, 1 - settings.max_outlier_share, T_plane_phantom));
    used.push_back(!view.held_out);
    const double distance_m = view.source_detector_distance_m.value_or(bundle.model.reference_distance_m);
    if (used.back()) nearest_m = std::min(nearest_m, distance_m);
    if (used.back()) farthest_m = std::max(farthest_m, distance_m);
    stretches.push_back(distance_m / bundle.model.reference_distance_m);
  }
  if (!flat) refuseMirrored(views, projections);
  if (flat) requireTilts(projections, used, detector);
  const Eigen::Matrix3d K = flat ? planarStart(phantom, *T_plane_phantom, views, projections, detector)
                                 : solidStart(projections, used, stretches);
  bundle.parameters = freeParameters(settings, farthest_m - nearest_m > kSameDistance_m, detector.turns_since_map);
  bundle.values = Eigen::VectorXd::Zero(bundle.parameters.map.cols());
  for (Eigen::Index k = 0; k < bundle.values.size(); ++k) {
    const std::string& name = bundle.parameters.names[k];
    if (name == "f_px") bundle.values[k] = std::sqrt(K(0, 0) * K(1, 1));
    if (name == "fx_px") bundle.values[k] = K(0, 0);
    if (name == "fy_px") bundle.values[k] = K(1, 1);
    if (name == "cx_px") bundle.values[k] = K(0, 2);
    if (name == "cy_px") bundle.values[k] = K(1, 2);
  }
  for (std::size_t v = 0; v < views.size(); ++v) {
    BundleView view;
    view.index = v;
    view.distance_m = stretches[v] * bundle.model.reference_distance_m;
    const Eigen::Index count = views[v].beads.size();
    view.points_m.resize(3, count);
    view.seen_px.resize(2, count);
    view.stds_px.resize(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const SeenBead& seen = views[v].beads[i];
      view.points_m.col(i) = phantom.beads[seen.bead].position_m;
      view.seen_px.col(i) = given[v].beads[i].center_px;
      view.stds_px[i] = seen.std_px;
    }
    view.use = projections[v].fits;
    Eigen::Matrix3d K_view = K;
    K_view.topLeftCorner<2, 2>() *= stretches[v];
    if (flat) {
      view.T_camera_phantom = planarPose(projections[v].H, K_view) * *T_plane_phantom;
    } else {
      const ProjectionParts parts = decomposed(projections[v].P);
      view.T_camera_phantom = parts.T_camera_model;
      // The same place in the image and the same size with the common K.
      Eigen::Vector3d center_m = parts.T_camera_model * phantom.center_m();
      const Eigen::Vector2d px = (parts.K * center_m).hnormalized();
      const double depth_m = center_m.z() * K_view(0, 0) / parts.K(0, 0);
      center_m = depth_m * Eigen::Vector3d(K_view.inverse() * px.homogeneous());
      view.T_camera_phantom.translation() = center_m - parts.T_camera_model.linear() * phantom.center_m();
    }
    view.T_camera_phantom = fittedPose(bundle, view);
    bundle.views.push_back(std::move(view));
  }
  requireUnits(bundle, detector, views, phantom.center_m());
  return bundle;
}

}  // namespace angio::calibration
