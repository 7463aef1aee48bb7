// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/view_set.hpp"

namespace angio::calibration {

/// A view set with its beads found, or read, and told apart.
struct SeenViewSet {
  DetectorOfViews detector;
  std::vector<BeadView> views;
  std::vector<int> unmatched;            ///< Of each view: what was found and is no bead of the phantom.
  std::vector<CalibrationInput> inputs;  ///< Hashes of the views' files.
};

/// Reads tables and finds beads in images, and tells them apart by their sizes and places where no table says which
/// they are. Throws InputError that names file, view and rule: an image of another size, images of marks without sizes,
/// a view whose beads cannot be told apart or are mirrored, a view that is a copy of another.
SeenViewSet seenViews(const ViewSet& set, const BeadPhantom& phantom, const BeadDetectionSettings& settings = {},
                      const std::function<void(int done)>& progress = {});

}  // namespace angio::calibration
