// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/picture_views.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/imaging/collimator_opening.hpp"

namespace angio::calibration {
namespace {

constexpr double kMaxFocalSpread = 0.01;  // Between readings of which any will do.
constexpr double kUsualRadius_px = 8;
// Equal beads at different distances: a bead's shadow differs from the median's by these factors at most. What does
// more is a wire, or an edge of the phantom's body.
constexpr double kBeadRadiusSpread = 1.7, kBeadContrastSpread = 1.8;

double medianOfBeads(const std::vector<BeadDetection>& beads, std::optional<double> BeadDetection::*value) {
  std::vector<double> values;
  for (const BeadDetection& bead : beads) values.push_back((bead.*value).value_or(0));
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<BeadDetection> equalBeads(std::vector<BeadDetection> beads) {
  if (beads.empty()) return beads;
  const double radius_px = medianOfBeads(beads, &BeadDetection::radius_px);
  const double contrast = medianOfBeads(beads, &BeadDetection::contrast);
  const auto differs = [](std::optional<double> value, double usual, double factor) {
    return !value || *value > factor * usual || *value * factor < usual;
  };
  beads.erase(std::remove_if(beads.begin(), beads.end(),
                             [&](const BeadDetection& bead) {
                               return differs(bead.radius_px, radius_px, kBeadRadiusSpread) ||
                                      differs(bead.contrast, contrast, kBeadContrastSpread);
                             }),
              beads.end());
  return beads;
}

// Where a bead of the usual size would be seen whole: away from the rim and from the image's edge.
cv::Mat wholeBeadMask(const cv::Mat& picture, const std::vector<BeadDetection>& detections) {
  double radius_px = kUsualRadius_px;
  for (const BeadDetection& bead : detections) radius_px = std::max(radius_px, bead.radius_px.value_or(0));
  const int margin = static_cast<int>(std::ceil(radius_px)) + 2;
  cv::Mat mask = findOpenField(picture).mask.clone();
  if (mask.empty()) mask = cv::Mat(picture.size(), CV_8UC1, cv::Scalar(255));
  cv::erode(mask, mask, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * margin + 1, 2 * margin + 1}), {-1, -1}, 1,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  return mask;
}

UncodedView pinholeView(const std::string& path, const cv::Mat& picture, const std::vector<BeadDetection>& detections,
                        const std::optional<DetectorDistortion>& distortion) {
  UncodedView view;
  view.width_px = picture.cols;
  view.pinhole_px.resize(2, static_cast<Eigen::Index>(detections.size()));
  for (std::size_t i = 0; i < detections.size(); ++i) {
    const Eigen::Vector2d& seen_px = detections[i].center_px;
    const auto pinhole_px = distortion ? distortion->undistorted(seen_px) : std::optional(seen_px);
    if (!pinhole_px) throw InputError(path, "distortion", "", "has no inverse at a bead");
    view.pinhole_px.col(static_cast<Eigen::Index>(i)) = *pinhole_px;
  }
  const cv::Mat mask = wholeBeadMask(picture, detections);
  view.is_open = [mask, distortion](const Eigen::Vector2d& pinhole_px) {
    const Eigen::Vector2d at = distortion ? distortion->distorted(pinhole_px) : pinhole_px;
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() <= mask.cols - 1 && at.y() <= mask.rows - 1)) return false;
    return mask.at<unsigned char>(static_cast<int>(std::lround(at.y())), static_cast<int>(std::lround(at.x()))) > 0;
  };
  return view;
}

PhantomReading anyReading(const std::string& path, const std::vector<PhantomReading>& readings) {
  const auto lessFocal = [](const PhantomReading& a, const PhantomReading& b) { return a.K(0, 0) < b.K(0, 0); };
  const auto [shortest, longest] = std::minmax_element(readings.begin(), readings.end(), lessFocal);
  if (longest->K(0, 0) - shortest->K(0, 0) > kMaxFocalSpread * longest->K(0, 0)) {
    throw InputError(path, "focal length", formatted("%.5g to %.5g px", shortest->K(0, 0), longest->K(0, 0)),
                     "differs between readings that fit equally well: name some beads (--known-beads)");
  }
  return *std::find_if(readings.begin(), readings.end(), [](const PhantomReading& r) { return !r.mirrored; });
}

}  // namespace

PictureView readPicture(const std::string& path, const cv::Mat& picture, const BeadPhantom& phantom,
                        const std::optional<DetectorDistortion>& distortion, const BeadDetectionSettings& settings,
                        const PictureHint& hint) {
  PictureView result;
  result.view.name = path;
  result.detections = equalBeads(detectBeads(picture, settings));
  const UncodedView pinhole = pinholeView(path, picture, result.detections, distortion);
  const std::vector<PhantomReading> readings = readingsOf(path, phantom, pinhole);
  result.readings = static_cast<std::size_t>(
      std::count_if(readings.begin(), readings.end(), [](const PhantomReading& r) { return !r.mirrored; }));
  ReadingHint known{{}, hint.T_near};
  for (const BeadDetection& bead : hint.known_beads) {
    const auto at_px = distortion ? distortion->undistorted(bead.center_px) : std::optional(bead.center_px);
    if (at_px && bead.bead) known.named.emplace_back(*at_px, *bead.bead);
  }
  const bool any = hint.any_reading && known.named.empty() && !known.T_near;
  result.reading = any ? anyReading(path, readings) : chosenReading(path, phantom, readings, pinhole, known);
  for (std::size_t i = 0; i < result.detections.size(); ++i) {
    BeadDetection& bead = result.detections[i];
    bead.bead = result.reading.bead[i];
    if (bead.bead) result.view.beads.push_back({*bead.bead, bead.center_px, 1});
  }
  return result;
}

RelativePose relativePose(const CalibratedView& first, const CalibratedView& second, const PlateShifts& plates) {
  RelativePose relative;
  relative.T_second_first = second.T_camera_phantom * first.T_camera_phantom.inverse();
  const Eigen::Matrix3d R = relative.T_second_first.linear();
  const Eigen::Matrix3d arm = skew(R * first.T_camera_phantom.translation());
  Matrix6d by_first = Matrix6d::Zero(), by_second = Matrix6d::Identity();
  by_first.topLeftCorner<3, 3>() = -R;
  by_first.bottomRightCorner<3, 3>() = -R;
  by_first.topRightCorner<3, 3>() = -arm * R;
  by_second.topRightCorner<3, 3>() = arm;
  relative.covariance = by_first * first.covariance.value() * by_first.transpose() +
                        by_second * second.covariance.value() * by_second.transpose();
  if (plates.covariance_mm2.size() > 0) {
    // Poses have errors in common as far as both follow the shifts.
    const Matrix6d common = by_first * first.plate_covariance_mm * inverseOfSymmetric(plates.covariance_mm2) *
                            second.plate_covariance_mm.transpose() * by_second.transpose();
    relative.covariance += common + common.transpose();
  }
  return relative;
}

}  // namespace angio::calibration
