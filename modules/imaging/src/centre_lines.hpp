// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/vessel/centerline2d.hpp"
#include "flatten.hpp"
#include "tracks.hpp"

namespace angio::imaging {

/// What the skeleton was drawn on: grey values, the mask's distance transform, and how far the second reaches over the
/// edge of the first.
struct SkeletonImages {
  const cv::Mat& absorption;  ///< CV_32FC1, working pixels.
  const cv::Mat& background;  ///< CV_32FC1, the logarithm of what lies behind the vessels.
  const cv::Mat& distance;    ///< CV_32FC1, `margin` pixels larger on each side.
  int margin = 0;
};

/// A vessel's centre line with its radius at every point, in working pixels of the absorption image.
struct CentreLine {
  Polyline line;
  std::vector<float> radius;
  std::vector<float> sigma, contrast;  ///< Of each point, or empty where the method does not measure them.
  float step = 0;  ///< From the image on its one side to that on the other, mean along it, over its contrast.
  CurveKind kind = CurveKind::kVessel;
  bool expected = false;  ///< A vessel is expected there (ExpectedLines).
};

/// Moves the graph's branches from pixel centres onto the vessels' centre lines. A line crosses the vessel's profile
/// where its upper half has its centre of mass, and the radius follows from the width of that half. At a junction the
/// branches run straight to the point that is nearest to all of them. `blur` is the standard deviation of the noise
/// filter [working px]. Parts of lines that lie outside of the absorption image are left out, and so are lines along a
/// step of the background, such as the collimator's edge: a vessel has the same on both sides.
std::vector<CentreLine> centreLines(const SkeletonGraph& graph, const SkeletonImages& images, float blur);

/// Lines in working pixels -> points of the image at equal distances, with the tangents of the lines.
Centerline2d sampled(const std::vector<CentreLine>& lines, const WorkingGrid& grid, double spacing_px);

}  // namespace angio::imaging
