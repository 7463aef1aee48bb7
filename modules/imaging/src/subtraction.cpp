// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/subtraction.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "angio/base/errors.hpp"
#include "quantile.hpp"
#include "xray_image.hpp"

namespace angio::imaging {
namespace {

// Frames are laid over each other on images of about these sizes, smoothed by so many pixels, in at most so many steps.
struct Round {
  int side;
  int steps;
};
constexpr Round kCoarse{256, 6}, kFine{512, 2};

// Every so many pixels are looked at, in rows and columns.
int stride(const cv::Mat& image) { return std::min(image.cols, image.rows) > kCoarse.side ? 3 : 2; }

constexpr double kSmoothing = 1.2;

constexpr double kStill = 0.002;          // Steps below this are no more worth another [small px].
constexpr double kPerDeviation = 1.4826;  // Standard deviation of a normal distribution, in median deviations.

constexpr int kMinSubtractedSide = 32;

// Added to both frames, as a part of their mean: it keeps quotients of dark pixels from being noise.
constexpr double kSubtractedDarkLevel = 0.02;

void requirePair(const cv::Mat& live, const cv::Mat& mask) {
  requireXray(live);
  requireXray(mask);
  if (mask.size() == live.size() && mask.type() == live.type()) return;
  const auto shown = [](const cv::Mat& m) {
    return std::to_string(m.cols) + " x " + std::to_string(m.rows) + " " + cv::typeToString(m.type());
  };
  throw InputError("mask", "size", shown(mask), "must be of the live frame's size and type, " + shown(live));
}

// Logarithm without its slow changes, on a small image.
cv::Mat prepared(const cv::Mat& image, const cv::Size& size) {
  cv::Mat small, slow;
  cv::resize(image, small, size, 0, 0, cv::INTER_AREA);
  small.convertTo(small, CV_32F);
  small += kSubtractedDarkLevel * cv::mean(small)[0] + 1e-3;
  cv::log(small, small);
  cv::GaussianBlur(small, small, cv::Size(), kSmoothing);
  cv::GaussianBlur(small, slow, cv::Size(), 16);
  return small - slow;
}

cv::Mat shifted(const cv::Mat& image, const Eigen::Vector2d& shift) {
  const cv::Matx23d M(1, 0, shift.x(), 0, 1, shift.y());
  cv::Mat result;
  cv::warpAffine(image, result, M, image.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return result;
}

// Root mean square of the difference without its largest part, which contrast agent makes.
double disagreement(const cv::Mat& live, const cv::Mat& mask) {
  std::vector<float> differences;
  const cv::Rect inside(8, 8, live.cols - 16, live.rows - 16);
  const cv::Mat a = live(inside), b = mask(inside);
  for (int y = 0; y < a.rows; y += stride(live)) {
    for (int x = 0; x < a.cols; x += stride(live))
      differences.push_back(std::abs(a.at<float>(y, x) - b.at<float>(y, x)));
  }
  return medianOf(differences);
}

// One step of Gauss and Newton with Tukey's weights.
Eigen::Vector2d step(const cv::Mat& live, const cv::Mat& moved, double deviation) {
  Eigen::Matrix2d A = 1e-12 * Eigen::Matrix2d::Identity();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  const double limit = 4.685 * std::max(deviation, 1e-6);
  for (int y = 9; y + 9 < live.rows; y += stride(live)) {
    const float *above = moved.ptr<float>(y - 1), *here = moved.ptr<float>(y), *below = moved.ptr<float>(y + 1);
    const float* seen = live.ptr<float>(y);
    for (int x = 9; x + 9 < live.cols; x += stride(live)) {
      const double left = seen[x] - here[x], part = left / limit;
      if (std::abs(part) >= 1) continue;
      const double weight = (1 - part * part) * (1 - part * part);
      // live(p) = moved(p - d): the difference is -gradient . d.
      const Eigen::Vector2d g(-0.5 * (here[x + 1] - here[x - 1]), -0.5 * (below[x] - above[x]));
      A += weight * g * g.transpose();
      b += weight * left * g;
    }
  }
  return A.ldlt().solve(b);
}

// Both frames prepared on a small image.
struct Pair {
  Pair(const cv::Mat& live, const cv::Mat& mask, int side) {
    const double factor = std::max(1.0, static_cast<double>(std::min(live.cols, live.rows)) / side);
    const cv::Size size(static_cast<int>(live.cols / factor), static_cast<int>(live.rows / factor));
    scale = {static_cast<double>(live.cols) / size.width, static_cast<double>(live.rows) / size.height};
    a = prepared(live, size);
    b = prepared(mask, size);
  }

  cv::Mat a, b;
  Eigen::Vector2d scale;  // Image pixels per small pixel.
};

// The phase of noise points anywhere: the shift must be allowed, and fit better than none.
Eigen::Vector2d phaseShift(const cv::Mat& live, const cv::Mat& mask, double max_shift_px) {
  const Pair pair(live, mask, kCoarse.side);
  cv::Mat window;
  cv::createHanningWindow(window, pair.a.size(), CV_32F);
  const cv::Point2d phase = cv::phaseCorrelate(pair.b, pair.a, window);
  const Eigen::Vector2d shift(phase.x, phase.y), shift_px = shift.cwiseProduct(pair.scale);
  const bool better =
      shift_px.norm() <= max_shift_px && disagreement(pair.a, shifted(pair.b, shift)) < disagreement(pair.a, pair.b);
  return better ? shift_px : Eigen::Vector2d::Zero();
}

Eigen::Vector2d refined(const cv::Mat& live, const cv::Mat& mask, const Round& round, const Eigen::Vector2d& from_px,
                        double max_shift_px) {
  const Pair pair(live, mask, round.side);
  Eigen::Vector2d shift = from_px.cwiseQuotient(pair.scale);
  for (int i = 0; i < round.steps; ++i) {
    const cv::Mat moved = shifted(pair.b, shift);
    const Eigen::Vector2d d = step(pair.a, moved, kPerDeviation * disagreement(pair.a, moved));
    if (!d.allFinite() || (shift + d).cwiseProduct(pair.scale).norm() > max_shift_px) break;
    shift += d;
    if (d.norm() < kStill) break;
  }
  const bool better = disagreement(pair.a, shifted(pair.b, shift)) < disagreement(pair.a, pair.b);
  return better ? Eigen::Vector2d(shift.cwiseProduct(pair.scale)) : Eigen::Vector2d::Zero();
}

}  // namespace

Eigen::Vector2d maskShift(const cv::Mat& live, const cv::Mat& mask, double max_shift_px) {
  requirePair(live, mask);
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  if (!(max_shift_px > 0) || std::min(live.cols, live.rows) < kMinSubtractedSide) return shift_px;
  shift_px = refined(live, mask, kCoarse, phaseShift(live, mask, max_shift_px), max_shift_px);
  if (std::min(live.cols, live.rows) > kCoarse.side) {
    shift_px = refined(live, mask, kFine, shift_px, max_shift_px);
  }
  return shift_px;
}

cv::Mat subtracted(const cv::Mat& live, const cv::Mat& mask, const SubtractionSettings& settings) {
  checkSettings("subtraction", settings);
  const Eigen::Vector2d shift = maskShift(live, mask, settings.max_shift_px);
  cv::Mat above, below;
  live.convertTo(above, CV_32F);
  mask.convertTo(below, CV_32F);
  if (!shift.isZero(0)) below = shifted(below, shift);
  const double dark = kSubtractedDarkLevel * cv::mean(above)[0] + 1e-3;
  above += dark;
  below += dark;
  cv::Mat result;
  cv::divide(above, below, below, kSubtractedLevel);
  below.convertTo(result, CV_16U);
  return result;
}

}  // namespace angio::imaging
