// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "angio/test/namespace.hpp"

namespace angio::test {

/// A tube of contrast agent: points of its centre line about a pixel apart, and its radius [px].
struct Tube {
  std::vector<Eigen::Vector2d> line;
  double radius_px = 0;
};

/// Tubes that form one vessel: where they meet, the beam crosses the widest and not the sum of them.
using Vessel = std::vector<Tube>;

struct Scene {
  int width_px = 512;
  int height_px = 512;
  std::vector<Vessel> vessels;      ///< Vessels lie behind each other: their absorptions add.
  double absorption_per_px = 0.02;  ///< A vessel of 1 mm (5 px) absorbs 10 %, as diluted contrast agent does.
  double noise = 0.01;              ///< Standard deviation, as a part of the unattenuated intensity.
  double background = 0.5;          ///< Height of the smooth hills of tissue, as absorption.
  unsigned seed = 1;
};

/// The scene's X-ray image (Beer and Lambert), dark vessels on bright, CV_16UC1.
cv::Mat render(const Scene& scene);

/// The positive picture printed in the negative: bright vessels.
cv::Mat negative(const cv::Mat& image);

Tube straightTube(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius_px);
Tube arcTube(const Eigen::Vector2d& center, double bend_radius_px, double from_rad, double to_rad, double radius_px);

/// A random tree of smooth curves that stays on the image: each branch splits in two, with thinner children.
Vessel randomTree(unsigned seed, int width_px, int height_px);

/// Distance of a point to the nearest centre line of the scene [px].
double distanceToLines(const Scene& scene, const Eigen::Vector2d& p);

}  // namespace angio::test
