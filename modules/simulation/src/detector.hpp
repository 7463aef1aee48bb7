// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/namespace.hpp"
#include "blur.hpp"

namespace angio::simulation {

/// The finaliser of splitmix64: a bijection that leaves no bit of the input visible.
/// Source: Steele, Lea, Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
constexpr std::uint64_t mixed(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// Standard normal deviates by table, the same on every machine.
class NormalDeviates {
 public:
  NormalDeviates();

  /// Fills `out` with `count` deviates. Each key gives a stream of its own.
  void fill(std::uint64_t key, int count, float* out) const;

 private:
  // Quantiles of the normal distribution with variance 1/2: a deviate is the sum of two, which has 2^24 values and
  // reaches beyond five standard deviations, from a table that stays in the first cache.
  std::array<float, 4096> quantiles_;
};

/// What depends on the camera and on where the patient is.
struct Optics {
  double gain;          ///< Grey values, of 65535, for a quantum.
  double focal_std_px;  ///< Blur before the quanta are counted.
  double psf_std_px;    ///< Blur after it.
};

/// Quanta that arrive at a detector, to grey values: focal spot, the intensifier's optics, quantum noise, the spread of
/// light, afterglow, electronic noise, gain and rounding.
class Detector {
 public:
  explicit Detector(const FluoroscopySettings& settings);

  /// @param quanta  Expected in each pixel, CV_32FC1; used up. @param stream  Of the noise: each frame has its own.
  cv::Mat expose(cv::Mat& quanta, const Optics& optics, std::uint64_t stream);

 private:
  void distort(const cv::Mat& in, cv::Mat& out);
  void count(cv::Mat& quanta, std::uint64_t stream) const;
  void glow(cv::Mat& signal);
  cv::Mat digitise(const cv::Mat& signal, float gain, std::uint64_t stream) const;

  DetectorSettings settings_;
  IntensifierSettings intensifier_;
  int threads_;
  float electronic_noise_;
  NormalDeviates normal_;
  cv::Mat spare_, before_;
  cv::Mat ideal_px_;  // Of each pixel, where the flat image has what is seen there; CV_32FC2.
};

}  // namespace angio::simulation
