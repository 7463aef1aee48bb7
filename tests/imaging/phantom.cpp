// SPDX-License-Identifier: GPL-2.0-or-later
#include "phantom.hpp"

#include <algorithm>
#include <cmath>

#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

double squaredDistanceToSegment(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d ab = b - a;
  const double t = std::clamp((p - a).dot(ab) / std::max(ab.squaredNorm(), 1e-12), 0.0, 1.0);
  return (p - a - t * ab).squaredNorm();
}

// Squared distance to the tube's centre line at each pixel that the tube covers; elsewhere more than the squared
// radius.
cv::Mat squaredDistances(const Tube& tube, const cv::Size& size) {
  const double reach = tube.radius_px + 1;
  cv::Mat distance(size, CV_64FC1, cv::Scalar(1e9));
  for (std::size_t i = 1; i < tube.line.size(); ++i) {
    const Eigen::Vector2d &a = tube.line[i - 1], &b = tube.line[i];
    const int x0 = std::max(0, static_cast<int>(std::min(a.x(), b.x()) - reach));
    const int x1 = std::min(size.width - 1, static_cast<int>(std::max(a.x(), b.x()) + reach + 1));
    const int y0 = std::max(0, static_cast<int>(std::min(a.y(), b.y()) - reach));
    const int y1 = std::min(size.height - 1, static_cast<int>(std::max(a.y(), b.y()) + reach + 1));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        double& d = distance.at<double>(y, x);
        d = std::min(d, squaredDistanceToSegment(Eigen::Vector2d(x, y), a, b));
      }
    }
  }
  return distance;
}

}  // namespace

cv::Mat render(const Scene& scene) {
  const cv::Size size(scene.width_px, scene.height_px);
  cv::Mat depth = cv::Mat::zeros(size, CV_64FC1);
  for (const Vessel& vessel : scene.vessels) {
    cv::Mat chord = cv::Mat::zeros(size, CV_64FC1);
    for (const Tube& tube : vessel) {
      cv::Mat inside = tube.radius_px * tube.radius_px - squaredDistances(tube, size);
      chord = cv::max(chord, cv::max(inside, 0));
    }
    cv::sqrt(chord, chord);
    depth += 2 * chord;
  }
  Random random(scene.seed);
  const double phase_x = random.uniform(0, 6), phase_y = random.uniform(0, 6);
  cv::Mat image(size, CV_16UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      // Hills 200 to 400 px wide: several times the widest vessel, as the soft tissue of a body is.
      const double hills = 0.5 * scene.background * (1 + std::sin(x / 60.0 + phase_x) * std::cos(y / 85.0 + phase_y));
      const double intensity = std::exp(-hills - scene.absorption_per_px * depth.at<double>(y, x));
      const double value = 30000 * (intensity + scene.noise * random.normal());
      image.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(std::lround(std::clamp(value, 0.0, 65535.0)));
    }
  }
  return image;
}

cv::Mat negative(const cv::Mat& image) {
  cv::Mat result;
  cv::bitwise_not(image, result);
  return result;
}

Tube straightTube(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius_px) {
  Tube tube{{}, radius_px};
  const int pieces = std::max(1, static_cast<int>((to - from).norm()));
  for (int i = 0; i <= pieces; ++i) tube.line.push_back(from + (to - from) * (static_cast<double>(i) / pieces));
  return tube;
}

Tube arcTube(const Eigen::Vector2d& center, double bend_radius_px, double from_rad, double to_rad, double radius_px) {
  Tube tube{{}, radius_px};
  const int pieces = std::max(1, static_cast<int>(bend_radius_px * std::abs(to_rad - from_rad)));
  for (int i = 0; i <= pieces; ++i) {
    const double angle = from_rad + (to_rad - from_rad) * i / pieces;
    tube.line.push_back(center + bend_radius_px * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return tube;
}

Vessel randomTree(unsigned seed, int width_px, int height_px) {
  Random random(seed);
  Vessel tree;
  const double unit = std::min(width_px, height_px) / 1024.0;
  const std::function<void(Eigen::Vector2d, double, double, int)> grow = [&](Eigen::Vector2d at, double heading,
                                                                             double radius, int generation) {
    Tube tube{{at}, radius};
    const double bend = 0.003 * random.normal();
    const int steps = static_cast<int>(unit * (260 - 40 * generation));
    for (int i = 0; i < steps; ++i) {
      heading += bend;
      at += Eigen::Vector2d(std::cos(heading), std::sin(heading));
      if (at.x() < 30 || at.y() < 30 || at.x() > width_px - 31 || at.y() > height_px - 31) break;
      tube.line.push_back(at);
    }
    const bool whole = static_cast<int>(tube.line.size()) == steps + 1;
    tree.push_back(tube);
    if (!whole || generation == 3) return;
    const double fork = random.uniform(0.4, 0.7);
    grow(at, heading + fork, 0.7 * radius, generation + 1);
    grow(at, heading - fork, 0.7 * radius, generation + 1);
  };
  grow({0.5 * width_px, 40}, 1.57, 12 * unit, 0);
  return tree;
}

double distanceToLines(const Scene& scene, const Eigen::Vector2d& p) {
  double best = 1e18;
  for (const Vessel& vessel : scene.vessels) {
    for (const Tube& tube : vessel) {
      for (std::size_t i = 1; i < tube.line.size(); ++i) {
        best = std::min(best, squaredDistanceToSegment(p, tube.line[i - 1], tube.line[i]));
      }
    }
  }
  return std::sqrt(best);
}

}  // namespace angio::test
