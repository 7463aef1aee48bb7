// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>

#include "angio/calibration/bead_phantom.hpp"
#include "angio/geometry/distortion.hpp"
#include "angio/simulation/fluoroscopy.hpp"

namespace angio::calibration {

/// X-ray images of steel balls in a body of plastic: scatter, blur, quantum noise, and shadows that overlap.
class PhantomRenderer {
 public:
  PhantomRenderer(const BeadPhantom& phantom, int seed);

  /// The image, CV_16UC1, of those beads that are `shown`. The same seed and frame give the same image.
  cv::Mat render(const XrayCamera& camera, const Pose& T_camera_phantom, const std::vector<int>& shown,
                 const std::optional<DetectorDistortion>& distortion, std::uint64_t frame);

 private:
  BeadPhantom phantom_;
  FluoroscopyRenderer renderer_;
};

}  // namespace angio::calibration
