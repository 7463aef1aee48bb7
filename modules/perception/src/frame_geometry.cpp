// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/frame_geometry.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"

namespace angio::perception {
namespace {

constexpr double kMaxError = 0.01;
constexpr double kMaxShift_m = 0.5e-3;  // Of the principal point, at the isocentre.
// No C-arm is so long, and no detector so coarse: such a number is in millimetres.
constexpr double kMaxDistance_m = 5, kMaxSpacing_m = 5e-3;
constexpr double kEdge_px = 1;  // Of sizes: a detector's last row or column may be left out.

constexpr double kDepthStd_m = 5e-3;  // Of a view: what a tree that deforms looks nearer or further by.
constexpr double kMinTurn_rad = 0.035;
constexpr double kSure = 3;  // Standard deviations.

bool agree(double a, double b) { return std::abs(a / b - 1) <= kMaxError; }

std::string against(const char* what, double value, const char* unit, const char* other, double expected) {
  return formatted("%s %.6g%s contradicts %s %.6g%s by %.1f %%: at most %g %%", what, value, unit, other, expected,
                   unit, 100 * (value / expected - 1), 100 * kMaxError);
}

// A window of the detector lies anywhere on it; the whole of it has one principal point.
bool within(double from_corner_m, double expected_m, double hidden_m, double tolerance_m) {
  return from_corner_m <= expected_m + tolerance_m && from_corner_m >= expected_m - hidden_m - tolerance_m;
}

}  // namespace

std::optional<std::string> contradiction(const XrayCamera& said, const CArmGeometry& calibrated) {
  const XrayCamera::Parameters& k = said.parameters();
  if (k.source_detector_distance_m && !(*k.source_detector_distance_m <= kMaxDistance_m)) {
    return formatted("source_detector_distance %.6g m is no C-arm's: in millimetres?", *k.source_detector_distance_m);
  }
  if (k.pixel_spacing_m && !(*k.pixel_spacing_m <= kMaxSpacing_m)) {
    return formatted("pixel_spacing %.6g m is no detector's: in millimetres?", *k.pixel_spacing_m);
  }
  if (k.source_detector_distance_m && k.pixel_spacing_m) {
    const double expected = *k.source_detector_distance_m / *k.pixel_spacing_m;
    if (!agree(k.fx_px, expected)) {
      return against("fx", k.fx_px, " px", "source_detector_distance / pixel_spacing =", expected);
    }
  }
  // The calibrated camera at the frame's distance, by the encoder.
  const double offset_m = calibrated.deviations.source_detector_offset_m;
  const double encoder_m =
      k.source_detector_distance_m ? *k.source_detector_distance_m - offset_m : calibrated.source_detector_distance_m;
  if (!(encoder_m > 0)) return std::string("source_detector_distance is none");
  const XrayCamera::Parameters c = calibrated.camera(encoder_m).parameters();
  // Pixels that are binned are a whole number of the detector's.
  const double spacing_m = k.pixel_spacing_m.value_or(calibrated.pixel_spacing_m);
  const double binned = std::max(1.0, std::round(spacing_m / calibrated.pixel_spacing_m));
  if (!agree(spacing_m, binned * calibrated.pixel_spacing_m)) {
    return against("pixel_spacing", 1e3 * spacing_m, " mm", "the calibration's", 1e3 * calibrated.pixel_spacing_m);
  }
  if (!agree(binned * k.fx_px, c.fx_px)) return against("fx", k.fx_px, " px", "the calibration's", c.fx_px / binned);
  if (!agree(binned * k.fy_px, c.fy_px)) return against("fy", k.fy_px, " px", "the calibration's", c.fy_px / binned);
  const double hidden_px[] = {c.width_px - binned * k.width_px, c.height_px - binned * k.height_px};
  if (hidden_px[0] < -kEdge_px * binned || hidden_px[1] < -kEdge_px * binned) {
    return formatted("%d x %d px of %.4g mm are more than the calibration's detector, %d x %d px of %.4g mm",
                     k.width_px, k.height_px, 1e3 * spacing_m, c.width_px, c.height_px,
                     1e3 * calibrated.pixel_spacing_m);
  }
  // From the middle of the corner pixel to that of the detector's lies half of what binning adds.
  const double corner_px = 0.5 * (binned - 1);
  const double tolerance_px = kMaxShift_m * c.fx_px / calibrated.source_isocenter_distance_m + kEdge_px * (binned - 1);
  const double at_px[] = {binned * k.cx_px + corner_px, binned * k.cy_px + corner_px};
  const double expected_px[] = {c.cx_px, c.cy_px};
  for (int axis = 0; axis < 2; ++axis) {
    if (within(at_px[axis], expected_px[axis], std::max(0.0, hidden_px[axis]), tolerance_px)) continue;
    return formatted("principal point %.6g, %.6g px contradicts the calibration's, %.6g, %.6g px, by more than %.2g px",
                     k.cx_px, k.cy_px, (c.cx_px - corner_px) / binned, (c.cy_px - corner_px) / binned,
                     tolerance_px / binned);
  }
  return std::nullopt;
}

void FocalLengthMonitor::see(const Eigen::Vector3d& beam_patient, double depth_off_m, double depth_m) {
  // The same view again errs as it did before.
  if (beam_patient.cross(last_beam_).norm() < std::sin(kMinTurn_rad) && beam_patient.dot(last_beam_) > 0) return;
  if (!beam_patient.allFinite() || !std::isfinite(depth_off_m) || !(depth_m > 0)) return;
  last_beam_ = beam_patient;
  Eigen::Vector4d row;
  row << beam_patient, depth_m;
  information_ += row * row.transpose() / (kDepthStd_m * kDepthStd_m);
  pull_ += row * depth_off_m / (kDepthStd_m * kDepthStd_m);
}

FocalLengthMonitor::Estimate FocalLengthMonitor::estimate() const {
  const Eigen::Matrix4d covariance = information_.inverse();
  return {(covariance * pull_)[3], std::sqrt(covariance(3, 3))};
}

std::optional<std::string> FocalLengthMonitor::warning() const {
  const Estimate e = estimate();
  if (!(std::abs(e.error) - kSure * e.std > kMaxError)) return std::nullopt;
  return formatted(
      "the focal length that frames say seems %.1f %% too %s (standard deviation %.1f %%): calibrate the camera",
      100 * std::abs(e.error), e.error > 0 ? "long" : "short", 100 * e.std);
}

}  // namespace angio::perception
