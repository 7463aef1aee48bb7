// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

/// A ball's shadow in an X-ray image.
struct BeadDetection {
  Eigen::Vector2d center_px{0, 0};
  double std_px = 1;                ///< Standard deviation of the centre, per axis.
  std::optional<double> radius_px;  ///< Of the shadow, without the image's blur.
  std::optional<double> contrast;   ///< How much its middle weakens the beam (natural logarithm).
  std::optional<int> bead;          ///< Which one it is, when somebody said.
};

/// How beads are found.
struct BeadDetectionSettings {
  double min_radius_px = 2.5;
  double max_radius_px = 14;
  static constexpr double min_contrast = 0.1;    ///< Natural logarithm, in the shadow's middle.
  static constexpr double min_significance = 8;  ///< The contrast over its noise in an area of the bead's size.
  double border_px = 1;
  static constexpr double max_misfit = 3;  ///< Residual of the profile over the image's noise; more is no ball.
  double max_stretch = 0;                  ///< Of round shadows, of their squared radius: see throughIntensifier.

  void visit(SettingsVisitor& v) {
    v.number("min_radius_px", min_radius_px, 1.5, 100, "Radius of the smallest bead's shadow");
    v.number("max_radius_px", max_radius_px, 2, 200, "Radius of the largest bead's shadow");
    v.number("border_px", border_px, 0, 1000, "A bead's centre nearer to the image's edge is not looked for");
  }

  /// The same for an image intensifier, whose pincushion of 8 per cent stretches shadows at its edge; a stretch that
  /// somebody has chosen stays.
  BeadDetectionSettings throughIntensifier() const {
    BeadDetectionSettings settings = *this;
    if (settings.max_stretch == 0) settings.max_stretch = 0.15;
    return settings;
  }
};

/// Finds dark discs, the shadows of balls, on uneven ground, and fits to each the projected profile of a ball, jointly
/// where shadows overlap; pixels in a collimator's shadow are not looked at.
///
/// A ball off the beam's axis has an elliptic shadow whose centre is not the projected centre of the ball: for a ball
/// of radius r at distance z, seen d px from the principal point, they are d (r/z)^2 apart, 0.003 px for 3.2 mm at 0.8
/// m in a detector's corner. That is not corrected.
///
/// `image` is CV_8UC1 or CV_16UC1; throws InputError for another type, an empty image and settings out of range.
std::vector<BeadDetection> detectBeads(const cv::Mat& image, const BeadDetectionSettings& settings = {});

/// Which detection is which bead.
struct BeadMatch {
  std::vector<std::optional<int>> bead;  ///< One a detection; nothing for what is no bead.
  int matched = 0;
  Eigen::Matrix3d R_camera_phantom = Eigen::Matrix3d::Identity();  ///< About; a start for the next view.
};

/// Tells beads apart in one view without any start: apparent sizes say the scale and which beads are large; each
/// orientation of a grid over all rotations, those near `likely` first, puts the beads' places over those seen, and the
/// best of them are refined to a projection. A mirrored image matches as well: a projection without perspective cannot
/// tell it, the projection matrix afterwards does.
///
/// Throws InputError that begins with `place` when a detection has no radius, when too few beads are seen, and when no
/// orientation explains them.
BeadMatch matchBeads(const std::string& place, const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                     const std::vector<Eigen::Matrix3d>& likely = {});

}  // namespace angio::calibration
