// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/camera_calibration.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "angio/geometry/decompositions.hpp"
#include "camera_bundle.hpp"
#include "camera_covariance.hpp"
#include "information.hpp"
#include "map_turn.hpp"

namespace angio::calibration {
namespace {

constexpr double kCauchyScale = 2.5;        // Of Cauchy's loss, in standard deviations.
constexpr double kRayleighMedian = 1.1774;  // Median length of a residual of unit variance in each axis.
// Views do not share one camera when K's of their own explain them better than chance by this factor, and their mean
// square falls by this factor: no real bead is so well known that the first alone says much.
constexpr double kBeyondChance = 4, kBeyondMatter = 1.1;
constexpr int kPlateRounds = 4;

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
  return {at.squared, squaredMahalanobis(gradient, S), at.residuals};
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

// Solves the bundle: robustly first, then by least squares without the beads that are off and without the views that
// another K would explain much better. Returns the given numbers of the views left out; the bundle has no longer got
// them. Throws InputError that names the views when more of them disagree than may be left out, or beads of a view.
std::vector<std::size_t> solveRobustly(CameraBundle& bundle, const std::vector<BeadView>& views,
                                       const CameraCalibrationSettings& settings) {
  const std::size_t given = bundle.views.size();
  std::vector<std::size_t> left_out;
  for (;;) {
    const auto require = [&](bool usable) {
      if (!usable) throw InputError("views", "bundle", "", "no camera explains them: the solver found no answer");
    };
    require(bundle.solve(kCauchyScale * robustNoise(bundle), settings.max_iterations));
    chooseBeads(bundle, settings.outlier_stds * robustNoise(bundle));
    require(bundle.solve(kCauchyScale * robustNoise(bundle), settings.max_iterations));
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
      bundle.views.erase(bundle.views.begin() + *foreign);
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

// Lets the phantom's plates move, from a bundle that is solved without. What is known of the shifts is weighed against
// the beads' noise, which is measured as the shifts explain more of the residuals.
void solvePlates(CameraBundle& bundle, const PhantomPlates& plates, const std::vector<BeadView>& views,
                 const CameraCalibrationSettings& settings) {
  bundle.addPlates(plates, views);
  bundle.plates_noise_px = robustNoise(bundle);
  for (int round = 0; round < kPlateRounds; ++round) {
    if (settings.noise_px > 0) bundle.plates_noise_px = settings.noise_px;
    if (!bundle.solve(std::nullopt, settings.max_iterations)) {
      throw InputError("views", "bundle", "", "no shifts of the phantom's plates explain them");
    }
    chooseBeads(bundle, settings.outlier_stds * robustNoise(bundle));
    bundle.plates_noise_px = std::sqrt(measuredVariance(bundle));
  }
}

// Errors of a pose fitted to every other bead, at the beads between: what K does for beads it has not seen.
double heldOutSquared(const CameraBundle& bundle, BundleView view, int& points) {
  const std::vector<bool> use = view.use;
  for (std::size_t i = 1; i < use.size(); i += 2) view.use[i] = false;
  view.T_camera_phantom = fittedPose(bundle, view);
  const Eigen::Matrix2Xd r = bundle.residualsOf(view);
  double squared = 0;
  for (std::size_t i = 1; i < use.size(); i += 2) {
    if (!use[i]) continue;
    squared += r.col(i).squaredNorm();
    ++points;
  }
  return squared;
}

CalibratedView calibratedView(const BeadView& given, const CameraBundle& bundle, const BundleView& view) {
  CalibratedView result;
  result.name = given.name;
  result.T_camera_phantom = view.T_camera_phantom;
  result.beads = given.beads;
  result.residuals_px = bundle.residualsOf(view);
  result.held_out = given.held_out;
  int points = 0;
  for (std::size_t i = 0; i < view.use.size(); ++i) {
    result.is_outlier.push_back(!view.use[i]);
    if (!view.use[i]) continue;
    result.rms_px += result.residuals_px.col(i).squaredNorm();
    ++points;
  }
  result.rms_px = points > 0 ? std::sqrt(result.rms_px / points) : 0;
  return result;
}

CameraFile cameraOfBundle(const CameraBundle& bundle, const DetectorOfViews& detector,
                          const std::vector<BeadView>& views) {
  const LensNumbers lens = bundle.lens();
  XrayCamera::Parameters p;
  p.width_px = detector.width_px;
  p.height_px = detector.height_px;
  p.fx_px = lens[kFx];
  p.fy_px = lens[kFy];
  p.cx_px = lens[kCx];
  p.cy_px = lens[kCy];
  p.pixel_spacing_m = detector.pixel_spacing_m;
  if (std::any_of(views.begin(), views.end(), [](const BeadView& v) { return v.source_detector_distance_m; })) {
    p.source_detector_distance_m = bundle.model.reference_distance_m;
  }
  CameraFile file{XrayCamera(p), detector.distortion, {}};
  if (bundle.model.kind == LensKind::kIntensifier) {
    file.distortion = DetectorDistortion::intensifier(file.camera, {lens[kK1], lens[kK2], lens[kS1], lens[kS2]});
  } else if (bundle.model.turn.order > 0) {
    file.distortion = turnedMap(file.distortion.value(), lens[kS1]);
  } else if (bundle.model.kind == LensKind::kRadial || lens[kSkew] != 0) {
    file.distortion = DetectorDistortion::radial(file.camera, lens[kK1], lens[kK2], lens[kSkew]);
  }
  if (file.distortion) file.distortion->check("camera", p.width_px, p.height_px);
  const auto& names = bundle.parameters.names;
  if (std::find(names.begin(), names.end(), "source_detector_offset_mm") != names.end()) {
    file.distance_law = CameraDistanceLaw{lens[kOffset], lens.segment<2>(kSlopeX)};
  }
  return file;
}

// K with the mean depth of the phantom beside it: f and depth are nearly one direction, and this says how nearly.
void recordParameters(const CameraBundle& bundle, const JointCovariance& joint, double mean_depth_m,
                      CalibrationRecord& record) {
  const Eigen::Index n = bundle.values.size();
  record.parameters = bundle.parameters.names;
  record.parameters.push_back("mean_depth_mm");
  record.values.resize(n + 1);
  record.values << bundle.values, 1e3 * mean_depth_m;
  record.covariance.resize(n + 1, n + 1);
  record.covariance.topLeftCorner(n, n) = 0.5 * (joint.values + joint.values.transpose());
  record.covariance.row(n).head(n) = 1e3 * joint.mean_depth.head(n);
  record.covariance.col(n).head(n) = 1e3 * joint.mean_depth.head(n).transpose();
  record.covariance(n, n) = 1e6 * joint.mean_depth[n];
  recordObservability(record);
}

}  // namespace

CameraCalibration calibrateCamera(const BeadPhantom& phantom, const DetectorOfViews& detector,
                                  const std::vector<BeadView>& views, const CameraCalibrationSettings& settings,
                                  const PhantomPlates& plates) {
  checkViews(phantom, detector, views, settings);
  CameraBundle all = startOf(phantom, detector, views, settings);
  requireObservable(all, phantom, views, settings);
  CameraBundle bundle = all;
  bundle.views.clear();
  for (const BundleView& view : all.views) {
    if (!views[view.index].held_out) bundle.views.push_back(view);
  }
  const std::vector<std::size_t> left_out = solveRobustly(bundle, views, settings);
  if (!plates.isOnePiece()) solvePlates(bundle, plates, views, settings);

  CameraCalibration result{cameraOfBundle(bundle, detector, views), {}, {}, 0, 0, {}};
  double squared = 0, mean_depth_m = 0;
  int points = 0;
  for (const BundleView& view : bundle.views) {
    mean_depth_m += (view.T_camera_phantom * phantom.center_m()).z() / static_cast<double>(bundle.views.size());
    const Eigen::Matrix2Xd r = bundle.residualsOf(view);
    for (Eigen::Index i = 0; i < r.cols(); ++i) {
      if (!view.use[i]) continue;
      squared += r.col(i).squaredNorm();
      ++points;
    }
  }
  const JointCovariance joint =
      jointCovariance(bundle, phantom.center_m(), settings.noise_px, detector.map_covariance_px2);
  result.noise_px = std::sqrt(squared / joint.freedom);
  result.left_out_rms_px = std::sqrt(joint.left_out_squared_px2 / points);
  const Eigen::Index shifts = 3 * bundle.plates.count;
  result.plates = {bundle.values.tail(shifts), joint.values.bottomRightCorner(shifts, shifts)};

  CalibrationRecord& record = result.record;
  record.kind = "camera";
  recordParameters(bundle, joint, mean_depth_m, record);
  record.residual_unit = "px";
  record.residual_rms = std::sqrt(squared / points);
  double held_out_squared = 0;
  int held_out_points = 0;
  if (!plates.isOnePiece()) all.addPlates(plates, views);
  for (BundleView& view : all.views) {
    const auto used = std::find_if(bundle.views.begin(), bundle.views.end(),
                                   [&](const BundleView& other) { return other.index == view.index; });
    const bool took_part = used != bundle.views.end();
    all.values = bundle.values;
    if (!took_part) view.T_camera_phantom = fittedPose(all, view);
    result.views.push_back(calibratedView(views[view.index], bundle, took_part ? *used : view));
    CalibratedView& calibrated = result.views.back();
    if (took_part) {
      const Eigen::MatrixXd& of_view = joint.views[static_cast<std::size_t>(used - bundle.views.begin())];
      calibrated.covariance = of_view.bottomRightCorner<6, 6>();
      calibrated.plate_covariance_mm = of_view.bottomRows<6>().middleCols(bundle.values.size() - shifts, shifts);
    }
    calibrated.left_out = std::count(left_out.begin(), left_out.end(), view.index) > 0;
    if (calibrated.held_out) held_out_squared += heldOutSquared(all, view, held_out_points);
    record.views.push_back(
        {calibrated.name, static_cast<int>(calibrated.beads.size()), calibrated.rms_px, calibrated.left_out});
  }
  if (held_out_points > 0) record.held_out_rms = std::sqrt(held_out_squared / held_out_points);
  return result;
}

}  // namespace angio::calibration
