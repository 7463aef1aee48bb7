// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_image.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace angio::registration {
namespace {

// A uniform cubic B-spline and its derivatives at 0 <= t < 1 after the second of its four coefficients.
std::array<double, 4> splineWeights(double t) {
  const double s = 1 - t;
  return {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6, t * t * t / 6};
}
std::array<double, 4> splineSlopes(double t) {
  const double s = 1 - t;
  return {-s * s / 2, (3 * t - 4) * t / 2, (4 - 3 * s) * s / 2, t * t / 2};
}
std::array<double, 4> splineCurvatures(double t) { return {1 - t, 3 * t - 2, 1 - 3 * t, t}; }

// Four rows of four coefficients around a place.
struct Patch {
  std::array<std::array<double, 4>, 4> at;
  double u, v;  // The place after the second coefficient, 0 to 1.
};

Patch patchAround(const RidgeImage::Samples& samples, const Eigen::Vector2d& place) {
  const double column = std::floor(place.x()), row = std::floor(place.y());
  Patch patch;
  patch.u = place.x() - column;
  patch.v = place.y() - row;
  const auto c = static_cast<Eigen::Index>(column) - 1, r = static_cast<Eigen::Index>(row) - 1;
  if (c >= 0 && r >= 0 && c + 4 <= samples.cols() && r + 4 <= samples.rows()) {
    for (int j = 0; j < 4; ++j) {
      const float* line = samples.data() + (r + j) * samples.cols() + c;
      for (int i = 0; i < 4; ++i) patch.at[j][i] = line[i];
    }
    return patch;
  }
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      const bool inside = c + i >= 0 && c + i < samples.cols() && r + j >= 0 && r + j < samples.rows();
      patch.at[j][i] = inside ? samples(r + j, c + i) : 0.0;
    }
  }
  return patch;
}

double dot4(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

// A line is drawn with a Gaussian of this standard deviation across, cut off at 2 px [px]. Less would make its strength
// depend on its direction among the pixels.
constexpr double kDrawn_px = 0.6, kDrawnReach_px = 2;
// Variance of a cubic B-spline, in strides^2.
constexpr double kSplineVariance = 1.0 / 3;
// So many samples at least stand within a standard deviation of the blur, where that is 2 px or more; less than twice
// as many.
constexpr double kMinSamplesPerScale = 2;

// Draws a line, 1 at its middle. Where lines meet the stronger one holds, so that a place is drawn once however many
// curves go through it.
void drawLine(const Eigen::Vector2d& a, const Eigen::Vector2d& b, cv::Mat1f& image) {
  const auto from = [](double x, double y) {
    return static_cast<int>(std::max(0.0, std::ceil(std::min(x, y) - kDrawnReach_px)));
  };
  const auto to = [](double x, double y, int size) {
    return static_cast<int>(std::min(size - 1.0, std::floor(std::max(x, y) + kDrawnReach_px)));
  };
  const int left = from(a.x(), b.x()), right = to(a.x(), b.x(), image.cols), bottom = to(a.y(), b.y(), image.rows);
  const Eigen::Vector2d along = b - a;
  const double length2 = along.squaredNorm();
  for (int y = from(a.y(), b.y()); y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const Eigen::Vector2d from_a = Eigen::Vector2d(x, y) - a;
      const double share = length2 > 0 ? std::clamp(from_a.dot(along) / length2, 0.0, 1.0) : 0.0;
      const double distance2_px2 = (from_a - share * along).squaredNorm();
      if (distance2_px2 > kDrawnReach_px * kDrawnReach_px) continue;
      const auto value = static_cast<float>(std::exp(-distance2_px2 / (2 * kDrawn_px * kDrawn_px)));
      if (value > image(y, x)) image(y, x) = value;
    }
  }
}

cv::Mat1f drawn(const Centerline2d& centerline, double max_step_px, const XrayCamera& camera) {
  cv::Mat1f image(camera.height_px(), camera.width_px(), 0.0f);
  for (int j = 0; j < centerline.size(); ++j) {
    const Eigen::Vector2d b = centerline.points_px.col(j);
    if (!camera.sees(b)) continue;
    const bool goes_on = j > 0 && centerline.ordered() && centerline.branch[j] == centerline.branch[j - 1];
    const Eigen::Vector2d a = goes_on ? centerline.points_px.col(j - 1) : b;
    drawLine(camera.sees(a) && (b - a).norm() <= max_step_px ? a : b, b, image);
  }
  return image;
}

double strideOf(double scale_px) {
  double stride_px = 1;
  while (scale_px / (2 * stride_px) >= kMinSamplesPerScale) stride_px *= 2;
  return stride_px;
}

// A blurred image whose samples stand some pixels apart.
class Blurred {
 public:
  explicit Blurred(cv::Mat1f drawn) : samples_(std::move(drawn)) {}

  // Blurs until the spline over samples `stride_px` apart has a standard deviation of `scale_px` in all.
  void to(double scale_px, double stride_px) {
    while (stride_px_ < stride_px) {
      // A blur of nearly a sample's distance leaves nothing that half of the samples could not show.
      blurTo(0.9 * 4 * stride_px_ * stride_px_);
      takeHalf();
    }
    blurTo(scale_px * scale_px - kSplineVariance * stride_px * stride_px);
  }

  // Coefficients for an image that is 1 on a straight line, whose integral across was drawn as sqrt(2 pi) kDrawn_px.
  RidgeImage::Samples normalized(double scale_px) const {
    const Eigen::Map<const RidgeImage::Samples> values(samples_.ptr<float>(), samples_.rows, samples_.cols);
    return values * static_cast<float>(scale_px / kDrawn_px);
  }

 private:
  void blurTo(double variance_px2) {
    if (!(variance_px2 > variance_px2_)) return;
    const double by = std::sqrt(variance_px2 - variance_px2_) / stride_px_;
    cv::GaussianBlur(samples_, samples_, cv::Size(), by, by, cv::BORDER_CONSTANT);
    variance_px2_ = variance_px2;
  }

  // Every other sample, from the first on.
  void takeHalf() {
    cv::Mat1f half((samples_.rows + 1) / 2, (samples_.cols + 1) / 2);
    for (int y = 0; y < half.rows; ++y) {
      for (int x = 0; x < half.cols; ++x) half(y, x) = samples_(2 * y, 2 * x);
    }
    samples_ = half;
    stride_px_ *= 2;
  }

  cv::Mat1f samples_;
  double stride_px_ = 1;
  double variance_px2_ = kDrawn_px * kDrawn_px;
};

}  // namespace

RidgeImage::Reading RidgeImage::read(const Eigen::Vector2d& pixel) const {
  const Patch patch = patchAround(samples_, per_px_ * pixel);
  const auto bu = splineWeights(patch.u), du = splineSlopes(patch.u), ddu = splineCurvatures(patch.u);
  const auto bv = splineWeights(patch.v), dv = splineSlopes(patch.v), ddv = splineCurvatures(patch.v);
  std::array<double, 4> value, slope, curvature;  // Along each of the four rows.
  for (int j = 0; j < 4; ++j) {
    value[j] = dot4(bu, patch.at[j]);
    slope[j] = dot4(du, patch.at[j]);
    curvature[j] = dot4(ddu, patch.at[j]);
  }
  Reading reading;
  reading.value = dot4(bv, value);
  reading.gradient = per_px_ * Eigen::Vector2d(dot4(bv, slope), dot4(dv, value));
  const double mixed = dot4(dv, slope);
  reading.hessian << dot4(bv, curvature), mixed, mixed, dot4(ddv, value);
  reading.hessian *= per_px_ * per_px_;
  return reading;
}

double RidgeImage::valueAt(const Eigen::Vector2d& pixel) const {
  const Patch patch = patchAround(samples_, per_px_ * pixel);
  const auto bu = splineWeights(patch.u), bv = splineWeights(patch.v);
  double value = 0;
  for (int j = 0; j < 4; ++j) value += bv[j] * dot4(bu, patch.at[j]);
  return value;
}

std::vector<RidgeImage> ridgeImages(const Centerline2d& centerline, double max_step_px, const XrayCamera& camera,
                                    const std::vector<double>& scales_px) {
  // Each image is blurred from the next finer one.
  std::vector<RidgeImage> fine_to_coarse;
  Blurred blurred(drawn(centerline, max_step_px, camera));
  for (auto scale = scales_px.rbegin(); scale != scales_px.rend(); ++scale) {
    const double stride_px = strideOf(*scale);
    blurred.to(*scale, stride_px);
    fine_to_coarse.emplace_back(blurred.normalized(*scale), stride_px, *scale);
  }
  std::reverse(fine_to_coarse.begin(), fine_to_coarse.end());
  return fine_to_coarse;
}

}  // namespace angio::registration
