// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

/// Reads a phantom of equal beads (CSV), a row each: `x_mm,y_mm,z_mm`, or `x,y,z` in `unit_m`, as XMALab's frame
/// specifications are. The beads' numbers are their rows', from 0. Throws InputError that names file, line, field,
/// value and rule: columns `x,y,z` without a unit, fewer than 8 beads, two in one place, all in one plane, within 10 mm
/// or farther than 1 m from the origin.
BeadPhantom readPointPhantom(const std::string& path, std::optional<double> unit_m);

/// One way to say which bead each detection is.
struct PhantomReading {
  std::vector<std::optional<int>> bead;  ///< One a detection; nothing for what is no bead.
  int matched = 0;                       ///< Detections that are beads.
  int unseen = 0;                        ///< Beads that should be seen in the open field and are not.
  double rms_px = 0;                     ///< Of a projection fitted to the matched ones, both axes together.
  bool mirrored = false;                 ///< It holds if the picture is mirrored.
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  Pose T_camera_phantom = Pose::Identity();  ///< About; of a mirrored picture: of the one that is flipped back.
};

/// Beads of one view as a pinhole camera sees them.
struct UncodedView {
  Eigen::Matrix2Xd pinhole_px;                                     ///< Detections, without the detector's distortion.
  int width_px = 0;                                                ///< Of the detector.
  std::function<bool(const Eigen::Vector2d& pinhole_px)> is_open;  ///< Whether a bead there would be seen.
};

/// Every reading of a view that fits as well as the best, by geometry alone: poses by three detections and three beads
/// (P3P, focal lengths of 2 to 9 detector widths) are scored by where they put all beads, the best are refined to
/// projections, and the symmetries of the phantom give the readings that no view can tell from each other: the phantom
/// turned onto itself, and, with the picture mirrored, mirrored onto itself. A reading fits as well when it explains
/// one bead less at most and leaves as few unseen.
///
/// Throws InputError that begins with `place` when fewer than 8 beads are seen, when no pose explains half of
/// them and lets two thirds of the beads be seen that should be, and when the phantom would stand nearer than 0.3 m to
/// the source or farther than 5 m: its unit is wrong.
std::vector<PhantomReading> readingsOf(const std::string& place, const BeadPhantom& phantom, const UncodedView& view);

/// What somebody knows of a view.
struct ReadingHint {
  std::vector<std::pair<Eigen::Vector2d, int>> named;  ///< Places in the pinhole image and the beads seen there.
  std::optional<Pose> T_near;                          ///< The phantom's pose, roughly.
};

/// The one reading that a hint leaves. Throws InputError that begins with `place`: more than one is left (the line says
/// how many, and what would tell); named places where nothing was found; names that no reading has, as of a phantom
/// whose rows stand in another order; names that only a mirrored picture has; a pose that is near to no reading.
PhantomReading chosenReading(const std::string& place, const BeadPhantom& phantom,
                             const std::vector<PhantomReading>& readings, const UncodedView& view,
                             const ReadingHint& hint);

}  // namespace angio::calibration
