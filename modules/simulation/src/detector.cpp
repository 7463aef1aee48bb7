// SPDX-License-Identifier: GPL-2.0-or-later
#include "detector.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "angio/base/row_bands.hpp"
#include "angio/simulation/intensifier.hpp"

namespace angio::simulation {
namespace {

constexpr std::uint64_t kElectronic = 0x5851f42d4c957f2dULL;  // Apart from the quantum noise of the same row.

// Adds the noise of counting to a row of expected quanta.
void addQuantumNoise(const float* __restrict deviates, int width, float* __restrict quanta) {
  for (int x = 0; x < width; ++x) quanta[x] += std::sqrt(quanta[x]) * deviates[x];
}

// Grey values of a row: signal and the detector's own noise, by gain, rounded and cut to the range.
template <typename Grey>
void round(const float* __restrict signal, const float* __restrict deviates, float noise, float gain, float highest,
           int width, Grey* __restrict out) {
  for (int x = 0; x < width; ++x) {
    const float grey = gain * (signal[x] + noise * deviates[x]) + 0.5F;
    const float cut = grey < 0.0F ? 0.0F : grey > highest ? highest : grey;
    out[x] = static_cast<Grey>(static_cast<std::int32_t>(cut));
  }
}

// The place below which a share p of the standard normal distribution lies, by bisection.
double normalQuantile(double p) {
  double low = -10, high = 10;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle * std::sqrt(0.5)) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

Detector::Detector(const FluoroscopySettings& settings)
    : settings_(settings.detector),
      intensifier_(settings.intensifier),
      threads_(settings.threads),
      electronic_noise_(static_cast<float>(settings.electronic_noise_photons)) {}

void Detector::distort(const cv::Mat& in, cv::Mat& out) {
  if (ideal_px_.size() != in.size()) {
    const DetectorDistortion map = intensifierDistortion(intensifier_, in.cols, in.rows);
    ideal_px_.create(in.size(), CV_32FC2);
    for (int y = 0; y < in.rows; ++y) {
      for (int x = 0; x < in.cols; ++x) {
        const Eigen::Vector2d p = *map.undistorted(Eigen::Vector2d(x, y));
        ideal_px_.at<cv::Vec2f>(y, x) = {static_cast<float>(std::clamp(p.x(), 0.0, in.cols - 1.0)),
                                         static_cast<float>(std::clamp(p.y(), 0.0, in.rows - 1.0))};
      }
    }
  }
  out.create(in.size(), CV_32FC1);
  forBands(threads_, in.rows, [&](const RowBand& band) {
    for (int y = band.top; y < band.bottom; ++y) {
      const cv::Vec2f* from = ideal_px_.ptr<cv::Vec2f>(y);
      float* result = out.ptr<float>(y);
      for (int x = 0; x < in.cols; ++x) {
        const int i = static_cast<int>(from[x][0]), j = static_cast<int>(from[x][1]);
        const int right = std::min(i + 1, in.cols - 1);
        const float u = from[x][0] - static_cast<float>(i), v = from[x][1] - static_cast<float>(j);
        const float *a = in.ptr<float>(j), *b = in.ptr<float>(std::min(j + 1, in.rows - 1));
        const float above = a[i] + u * (a[right] - a[i]), below = b[i] + u * (b[right] - b[i]);
        result[x] = above + v * (below - above);
      }
    }
  });
}

void Detector::count(cv::Mat& quanta, std::uint64_t stream) const {
  forBands(threads_, quanta.rows, [&](const RowBand& band) {
    std::vector<float> deviates(quanta.cols);
    for (int y = band.top; y < band.bottom; ++y) {
      normal_.fill(stream + static_cast<std::uint64_t>(y), quanta.cols, deviates.data());
      addQuantumNoise(deviates.data(), quanta.cols, quanta.ptr<float>(y));
    }
  });
}

void Detector::glow(cv::Mat& signal) {
  const float lag = static_cast<float>(settings_.lag);
  if (before_.size() == signal.size()) {
    for (int y = 0; y < signal.rows; ++y) {
      const float* before = before_.ptr<float>(y);
      float* now = signal.ptr<float>(y);
      for (int x = 0; x < signal.cols; ++x) now[x] = (1 - lag) * now[x] + lag * before[x];
    }
  }
  signal.copyTo(before_);
}

cv::Mat Detector::digitise(const cv::Mat& signal, float gain, std::uint64_t stream) const {
  const bool wide = settings_.bits == PixelDepth::k16;
  cv::Mat image(signal.size(), wide ? CV_16UC1 : CV_8UC1);
  forBands(threads_, signal.rows, [&](const RowBand& band) {
    std::vector<float> deviates(signal.cols, 0.0F);
    for (int y = band.top; y < band.bottom; ++y) {
      if (electronic_noise_ > 0) {
        normal_.fill((stream ^ kElectronic) + static_cast<std::uint64_t>(y), signal.cols, deviates.data());
      }
      const float* row = signal.ptr<float>(y);
      if (wide) {
        round(row, deviates.data(), electronic_noise_, gain, 65535.0F, signal.cols, image.ptr<std::uint16_t>(y));
      } else {
        round(row, deviates.data(), electronic_noise_, gain / 257, 255.0F, signal.cols, image.ptr<std::uint8_t>(y));
      }
    }
  });
  return image;
}

cv::Mat Detector::expose(cv::Mat& quanta, const Optics& optics, std::uint64_t stream) {
  Blur focal_spot(optics.focal_std_px), psf(optics.psf_std_px);
  const auto through = [&](auto&& stage) {
    stage(quanta, spare_);
    std::swap(quanta, spare_);
  };
  if (!focal_spot.idle()) through([&](const cv::Mat& in, cv::Mat& out) { focal_spot.apply(in, out, threads_); });
  if (intensifier_.pincushion != 0 || intensifier_.s_distortion_deg != 0) {
    through([&](const cv::Mat& in, cv::Mat& out) { distort(in, out); });
  }
  count(quanta, stream);
  if (!psf.idle()) through([&](const cv::Mat& in, cv::Mat& out) { psf.apply(in, out, threads_); });
  if (settings_.lag > 0) glow(quanta);
  return digitise(quanta, static_cast<float>(optics.gain), stream);
}

NormalDeviates::NormalDeviates() {
  const std::size_t n = quantiles_.size();
  std::array<double, 4096> exact{};
  double squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    exact[i] = normalQuantile((static_cast<double>(i) + 0.5) / static_cast<double>(n));
    squares += exact[i] * exact[i];
  }
  // Middles of classes vary a little less than the whole distribution.
  const double scale = std::sqrt(0.5 * static_cast<double>(n) / squares);
  for (std::size_t i = 0; i < n; ++i) quantiles_[i] = static_cast<float>(scale * exact[i]);
}

void NormalDeviates::fill(std::uint64_t key, int count, float* out) const {
  std::uint64_t counter = mixed(key);
  const auto deviate = [this](std::uint64_t bits) { return quantiles_[bits & 4095] + quantiles_[(bits >> 12) & 4095]; };
  int i = 0;
  for (; i + 1 < count; i += 2) {
    const std::uint64_t bits = mixed(counter += 0x9e3779b97f4a7c15ULL);
    out[i] = deviate(bits);
    out[i + 1] = deviate(bits >> 32);
  }
  if (i < count) out[i] = deviate(mixed(counter + 0x9e3779b97f4a7c15ULL));
}

}  // namespace angio::simulation
