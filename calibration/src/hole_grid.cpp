// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hole_grid.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/se3.hpp"
#include "least_squares.hpp"

namespace angio::calibration {
namespace {

constexpr double kMinPitch_px = 5, kMaxPitch_px = 80;
constexpr double kMinPeak = 20;          // Of the spectrum at the pitch, over its median there.
constexpr double kSmoothing = 0.15;      // Standard deviation, in pitches: less keeps noise, more joins neighbours.
constexpr double kOpenShare = 0.12;      // Of the bright parts' brightness; darker is beyond the intensifier's rim.
constexpr double kMinCurvature = 0.15;   // Of a hole's peak, of the median's.
constexpr double kStepTolerance = 0.25;  // Of a step, between where a neighbour is thought to be and is.
constexpr double kStepMemory = 0.7;      // How much of the step before goes into the next.
constexpr std::size_t kMinHoles = 100;
constexpr double kMinStepped = 0.8;

double directionsAngle_rad(GridShape shape) { return shape == GridShape::kHexagonal ? kPi / 3 : kPi / 2; }

// Steps to the nearest neighbours.
std::vector<Eigen::Vector2i> neighbourSteps(GridShape shape) {
  std::vector<Eigen::Vector2i> steps = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  if (shape == GridShape::kHexagonal) steps.insert(steps.end(), {{-1, 1}, {1, -1}});
  return steps;
}

// The distance of neighbouring holes by the strongest wave in the middle of the image.
double pitchOf(const std::string& place, const cv::Mat& values, GridShape shape) {
  const int side = cv::getOptimalDFTSize(std::min({values.cols, values.rows, 512})) & ~1;
  cv::Mat part = values(cv::Rect((values.cols - side) / 2, (values.rows - side) / 2, side, side)).clone(), window;
  cv::createHanningWindow(window, part.size(), CV_32F);
  part = (part - cv::mean(part)[0]).mul(window);
  cv::Mat spectrum;
  cv::dft(part, spectrum, cv::DFT_COMPLEX_OUTPUT);
  std::vector<float> all;
  double strongest = 0, wave_px = 0;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const double fx = x <= side / 2 ? x : x - side, fy = y <= side / 2 ? y : y - side;
      const double length_px = side / std::max(1e-9, std::hypot(fx, fy));
      if (length_px < kMinPitch_px * 0.8 || length_px > kMaxPitch_px) continue;
      const cv::Vec2f value = spectrum.at<cv::Vec2f>(y, x);
      all.push_back(std::hypot(value[0], value[1]));
      if (all.back() <= strongest) continue;
      strongest = all.back();
      wave_px = length_px;
    }
  }
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  if (!all.empty()) std::nth_element(all.begin(), middle, all.end());
  if (all.empty() || !(strongest > kMinPeak * *middle)) {
    throw InputError(place, "grid", "", "no regular pattern of holes is to be seen in the image's middle");
  }
  return shape == GridShape::kHexagonal ? wave_px / std::sin(kPi / 3) : wave_px;  // Rows are nearer than holes.
}

// A peak of smoothed brightness: its place by the parabola through the pixels around it, and how sharp it is.
struct Peak {
  Eigen::Vector2d center_px;
  double curvature;
};

std::optional<Peak> peakAt(const cv::Mat& smooth, int x, int y, int reach) {
  const int side = 2 * reach + 1;
  Eigen::MatrixXd A(side * side, 6), b(side * side, 1);
  for (int dy = -reach, k = 0; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx, ++k) {
      A.row(k) << 1, dx, dy, dx * dx, dx * dy, dy * dy;
      b(k, 0) = smooth.at<float>(y + dy, x + dx);
    }
  }
  // The window is the same everywhere, and so are the equations.
  static thread_local int known_reach = -1;
  static thread_local Eigen::MatrixXd solver;
  if (known_reach != reach) {
    solver = leastSquares(A, Eigen::MatrixXd::Identity(side * side, side * side)).solution;
    known_reach = reach;
  }
  const Eigen::VectorXd c = solver * b;
  Eigen::Matrix2d H;
  H << 2 * c[3], c[4], c[4], 2 * c[5];
  const double flattest = 0.5 * H.trace() + std::sqrt(std::max(0.0, 0.25 * H.trace() * H.trace() - H.determinant()));
  if (!(flattest < 0)) return std::nullopt;
  const Eigen::Vector2d step = -H.inverse() * c.segment<2>(1);
  if (!(step.cwiseAbs().maxCoeff() < reach)) return std::nullopt;
  return Peak{Eigen::Vector2d(x, y) + step, -flattest};
}

std::vector<Eigen::Vector2d> holeCenters(const cv::Mat& values, double pitch_px) {
  cv::Mat ground, smooth, largest;
  cv::GaussianBlur(values, ground, {0, 0}, pitch_px);
  double brightest = 0;
  cv::minMaxLoc(ground, nullptr, &brightest);
  cv::Mat flat = values / cv::max(ground, 1e-3 * brightest);  // Uneven light would move the peaks.
  cv::GaussianBlur(flat, smooth, {0, 0}, kSmoothing * pitch_px);
  const int apart = 2 * static_cast<int>(std::lround(0.3 * pitch_px)) + 1;
  cv::dilate(smooth, largest, cv::getStructuringElement(cv::MORPH_RECT, {apart, apart}));
  const int reach = std::max(2, static_cast<int>(std::lround(0.14 * pitch_px)));
  std::vector<Peak> peaks;
  for (int y = reach; y < values.rows - reach; ++y) {
    for (int x = reach; x < values.cols - reach; ++x) {
      if (smooth.at<float>(y, x) < largest.at<float>(y, x) || ground.at<float>(y, x) < kOpenShare * brightest) continue;
      if (const auto peak = peakAt(smooth, x, y, reach)) peaks.push_back(*peak);
    }
  }
  if (peaks.empty()) return {};
  std::vector<double> curvatures;
  for (const Peak& peak : peaks) curvatures.push_back(peak.curvature);
  const auto middle = curvatures.begin() + static_cast<std::ptrdiff_t>(curvatures.size() / 2);
  std::nth_element(curvatures.begin(), middle, curvatures.end());
  std::vector<Eigen::Vector2d> centers;
  for (const Peak& peak : peaks) {
    if (peak.curvature > kMinCurvature * *middle) centers.push_back(peak.center_px);
  }
  return centers;
}

// The nearest of points; cells of a pitch hold few each.
class NearestPoint {
 public:
  NearestPoint(const std::vector<Eigen::Vector2d>& points, double cell_px) : points_(points), cell_px_(cell_px) {
    for (std::size_t i = 0; i < points.size(); ++i) cells_[cellOf(points[i])].push_back(i);
  }

  /// Within a cell's width, or nothing; `besides` does not count.
  std::optional<std::size_t> to(const Eigen::Vector2d& at, std::optional<std::size_t> besides = {}) const {
    std::optional<std::size_t> best;
    const auto [cx, cy] = cellOf(at);
    for (int y = cy - 1; y <= cy + 1; ++y) {
      for (int x = cx - 1; x <= cx + 1; ++x) {
        const auto cell = cells_.find({x, y});
        if (cell == cells_.end()) continue;
        for (const std::size_t i : cell->second) {
          if (i == besides) continue;
          if (!best || (points_[i] - at).norm() < (points_[*best] - at).norm()) best = i;
        }
      }
    }
    return best;
  }

 private:
  std::pair<int, int> cellOf(const Eigen::Vector2d& at) const {
    return {static_cast<int>(std::floor(at.x() / cell_px_)), static_cast<int>(std::floor(at.y() / cell_px_))};
  }

  const std::vector<Eigen::Vector2d>& points_;
  double cell_px_;
  std::map<std::pair<int, int>, std::vector<std::size_t>> cells_;
};

// A hole that was stepped to, and the grid's two steps there.
struct SteppedHole {
  Eigen::Vector2i index;
  Eigen::Matrix2d steps_px;
};

// The two steps at a hole: to its nearest neighbour, and to where the grid's second direction leads from there.
std::optional<Eigen::Matrix2d> stepsAt(const std::vector<Eigen::Vector2d>& centers, const NearestPoint& nearest,
                                       std::size_t hole, double angle_rad) {
  const auto first = nearest.to(centers[hole], hole);
  if (!first) return std::nullopt;
  Eigen::Matrix2d steps;
  steps.col(0) = centers[*first] - centers[hole];
  const Eigen::Vector2d turned = Eigen::Rotation2Dd(angle_rad) * Eigen::Vector2d(steps.col(0));
  const auto second = nearest.to(centers[hole] + turned);
  if (!second || (centers[*second] - centers[hole] - turned).norm() > kStepTolerance * turned.norm()) {
    return std::nullopt;
  }
  steps.col(1) = centers[*second] - centers[hole];
  return steps;
}

using Stepped = std::map<std::size_t, SteppedHole>;

Stepped steppedFrom(const std::vector<Eigen::Vector2d>& centers, const NearestPoint& nearest, std::size_t start,
                    const Eigen::Matrix2d& steps_px, GridShape shape) {
  Stepped stepped{{start, {{0, 0}, steps_px}}};
  std::map<std::pair<int, int>, std::size_t> taken{{{0, 0}, start}};
  std::deque<std::size_t> queue{start};
  const auto neighbours = neighbourSteps(shape);
  while (!queue.empty()) {
    const std::size_t from = queue.front();
    queue.pop_front();
    const SteppedHole hole = stepped.at(from);
    for (const Eigen::Vector2i& step : neighbours) {
      const Eigen::Vector2i index = hole.index + step;
      if (taken.count({index.x(), index.y()})) continue;
      const Eigen::Vector2d step_px = hole.steps_px * step.cast<double>(), thought = centers[from] + step_px;
      const auto found = nearest.to(thought);
      if (!found || stepped.count(*found)) continue;
      if ((centers[*found] - thought).norm() > kStepTolerance * step_px.norm()) continue;
      SteppedHole next{index, hole.steps_px};
      for (int k = 0; k < 2; ++k) {
        if (step[1 - k] != 0) continue;
        next.steps_px.col(k) =
            kStepMemory * hole.steps_px.col(k) + (1 - kStepMemory) * step[k] * (centers[*found] - centers[from]);
      }
      stepped.emplace(*found, next);
      taken.emplace(std::make_pair(index.x(), index.y()), *found);
      queue.push_back(*found);
    }
  }
  return stepped;
}

}  // namespace

HoleGrid findHoleGrid(const std::string& place, const cv::Mat& image, GridShape shape) {
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_16UC1)) {
    throw InputError(place, "image", "", "must be grey, of 8 or 16 bits");
  }
  cv::Mat values;
  image.convertTo(values, CV_32F);
  HoleGrid grid{shape, image.cols, image.rows, pitchOf(place, values, shape), {}};
  const std::vector<Eigen::Vector2d> centers = holeCenters(values, grid.pitch_px);
  if (centers.size() < kMinHoles) {
    throw InputError(place, "holes", std::to_string(centers.size()), "must be at least " + std::to_string(kMinHoles));
  }
  const NearestPoint nearest(centers, 1.5 * grid.pitch_px);
  const Eigen::Vector2d middle(0.5 * (image.cols - 1), 0.5 * (image.rows - 1));
  const auto start = nearest.to(middle);
  const auto steps = start ? stepsAt(centers, nearest, *start, directionsAngle_rad(shape)) : std::nullopt;
  const Stepped stepped = steps ? steppedFrom(centers, nearest, *start, *steps, shape) : Stepped{};
  if (static_cast<double>(stepped.size()) < kMinStepped * static_cast<double>(centers.size())) {
    throw InputError(place, "holes", formatted("%zu of %zu", stepped.size(), centers.size()),
                     std::string("must be neighbours in one ") +
                         (shape == GridShape::kHexagonal ? "hexagonal" : "square") + " grid: is it another?");
  }
  std::map<std::pair<int, int>, bool> seen;
  for (const auto& [hole, at] : stepped) seen[{at.index.x(), at.index.y()}] = true;
  const double angle_rad = directionsAngle_rad(shape), edge_px = 0.5 * grid.pitch_px;
  for (const auto& [number, at] : stepped) {
    GridHole hole{at.index, centers[number], {}, true};
    hole.place_pitches = {at.index.x() + at.index.y() * std::cos(angle_rad), at.index.y() * std::sin(angle_rad)};
    for (const Eigen::Vector2i& step : neighbourSteps(shape)) {
      hole.whole &= seen.count({at.index.x() + step.x(), at.index.y() + step.y()}) > 0;
    }
    const Eigen::Vector2d& px = hole.center_px;
    hole.whole &= px.x() >= edge_px && px.y() >= edge_px && px.x() <= image.cols - 1 - edge_px &&
                  px.y() <= image.rows - 1 - edge_px;
    grid.holes.push_back(hole);
  }
  return grid;
}

}  // namespace angio::calibration
