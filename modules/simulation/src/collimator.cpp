// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/collimator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/geometry/se3.hpp"

namespace angio::simulation {
namespace {

constexpr int kCircleCorners = 128;

// Corners around the field's own centre.
std::vector<Eigen::Vector2d> cornersOf(const CollimatorSettings& s, int width_px, int height_px) {
  const double a = 0.5 * s.width * width_px, b = 0.5 * s.height * height_px, cut = 0.5 * std::min(a, b);
  switch (s.shutter) {
    case Shutter::kOpen:
      break;
    case Shutter::kRectangle:
      return {{-a, -b}, {a, -b}, {a, b}, {-a, b}};
    case Shutter::kOctagon:
      return {{-a + cut, -b}, {a - cut, -b}, {a, -b + cut}, {a, b - cut},
              {a - cut, b},   {-a + cut, b}, {-a, b - cut}, {-a, -b + cut}};
    case Shutter::kCircle: {
      const double r = 0.5 * s.width * std::min(width_px, height_px);
      std::vector<Eigen::Vector2d> corners;
      for (int i = 0; i < kCircleCorners; ++i) {
        const double turn = 2 * kPi * i / kCircleCorners;
        corners.emplace_back(r * std::cos(turn), r * std::sin(turn));
      }
      return corners;
    }
  }
  return {};
}

// The normal distribution's share below x.
float below(double x) { return static_cast<float>(0.5 * std::erfc(-x * std::sqrt(0.5))); }

// Of a convex polygon whose corners go clockwise in the image: positive inside, to the nearest edge's line.
double distanceInside(const std::vector<Eigen::Vector2d>& corners, const Eigen::Vector2d& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d along = corners[(i + 1) % corners.size()] - a, to = p - a;
    nearest = std::min(nearest, (along.x() * to.y() - along.y() * to.x()) / along.norm());
  }
  return nearest;
}

Eigen::Vector2d centerOf(const CollimatorSettings& s, int width_px, int height_px) {
  return {0.5 * (width_px - 1) + s.center_x * width_px, 0.5 * (height_px - 1) + s.center_y * height_px};
}

}  // namespace

std::vector<Eigen::Vector2d> openField(const CollimatorSettings& s, int width_px, int height_px) {
  if (s.shutter == Shutter::kOpen) {
    const double right = width_px - 0.5, bottom = height_px - 0.5;
    return {{-0.5, -0.5}, {right, -0.5}, {right, bottom}, {-0.5, bottom}};
  }
  std::vector<Eigen::Vector2d> corners = cornersOf(s, width_px, height_px);
  const Eigen::Rotation2Dd turn(degToRad(s.turn_deg));
  for (Eigen::Vector2d& corner : corners) corner = centerOf(s, width_px, height_px) + turn * corner;
  return corners;
}

cv::Mat shutterTransmission(const CollimatorSettings& s, int width_px, int height_px) {
  cv::Mat result(height_px, width_px, CV_32FC1, cv::Scalar(1));
  if (s.shutter == Shutter::kOpen) return result;
  const std::vector<Eigen::Vector2d> corners = openField(s, width_px, height_px);
  const Eigen::Vector2d center = centerOf(s, width_px, height_px);
  const double radius = 0.5 * s.width * std::min(width_px, height_px);
  const double softness = std::max(s.edge_px, 1e-3);
  const float leakage = static_cast<float>(s.leakage);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const Eigen::Vector2d p(x, y);
      const double inside = s.shutter == Shutter::kCircle ? radius - (p - center).norm() : distanceInside(corners, p);
      result.at<float>(y, x) = leakage + (1 - leakage) * below(inside / softness);
    }
  }
  return result;
}

}  // namespace angio::simulation
