// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_flanks.hpp"

#include <algorithm>
#include <cmath>

#include "tracks.hpp"

namespace angio::imaging {
namespace {

// Beside a line, so far from its middle [radii] and [working px], is what is not it.
constexpr float kBesideRadii = 1.6f, kBeside = 2;

// Directions are taken over so many points to both sides; every other point is compared.
constexpr std::size_t kFlankReach = 3, kCompareEvery = 2;

}  // namespace

void compareFlanks(std::vector<CentreLine>& lines, const ScaleImage& image) {
  for (CentreLine& line : lines) {
    float difference = 0, contrast = 0;
    for (std::size_t i = 0; i < line.line.size(); i += kCompareEvery) {
      const cv::Point2f along = directionAt(line.line, i, kFlankReach);
      const float beside = std::max(kBesideRadii * line.radius[i], line.radius[i] + kBeside);
      const cv::Point2f middle = image.per_pixel * line.line[i],
                        aside = image.per_pixel * beside * cv::Point2f(-along.y, along.x);
      const cv::Point2f left = middle + aside, right = middle - aside;
      difference += image.smoothed->at(left.x, left.y) - image.smoothed->at(right.x, right.y);
      contrast += line.contrast[i];
    }
    line.step = std::abs(difference) / std::max(contrast, 1e-9f);
  }
}

}  // namespace angio::imaging
