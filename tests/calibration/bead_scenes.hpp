// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/imgproc.hpp>
#include <random>

#include "angio/calibration/bead_phantom.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {

/// Rotation of the phantom as C-arms see it, or any.
inline Pose phantomView(const BeadPhantom& phantom, const Eigen::Matrix3d& R, const Eigen::Vector3d& center_camera_m) {
  Pose T = Pose::Identity();
  T.linear() = R;
  T.translation() = center_camera_m - R * phantom.center_m();
  return T;
}

inline Eigen::Matrix3d anyRotation(Random& random) {
  const double angle_rad = random.uniform(0, kPi);
  return expSO3(angle_rad * random.direction());
}

/// Two parallel plates of beads, 120 mm wide and 60 mm apart, one over the gaps of the other, large and small in an
/// order without a pattern: a flat phantom that still shows depth and handedness.
inline BeadPhantom platePhantom() {
  BeadPhantom phantom;
  phantom.name = "plate";
  constexpr int kSide = 7;
  std::mt19937 engine(1);
  for (const int plate : {0, 1}) {
    const int count = kSide - plate;
    for (int i = 0; i < count * count; ++i) {
      const double x = 0.02 * (i % count - 0.5 * (count - 1)), y = 0.02 * (i / count - 0.5 * (count - 1));
      phantom.beads.push_back({{x, y, 0.06 * (plate - 0.5)}, (engine() & 1U) ? 1.6e-3 : 0.8e-3});
    }
  }
  return phantom;
}

/// How a simulated exposure looks.
struct BeadExposure {
  double attenuation_per_m = 500;  ///< Steel, behind a patient's spectrum.
  double scatter = 0.25;           ///< Over the primary beam in the open field.
  double quanta = 2500;            ///< In an open pixel; 0: no noise.
  double blur_px = 0.7;
  double unevenness = 0.3;  ///< Of the ground's logarithm, over the detector.
};

/// An X-ray image of the balls, 16 bits: exact chords through each ball, three by three rays a pixel, Beer-Lambert's
/// law, even scatter, blur, and normal noise of the quanta's variance.
inline cv::Mat beadImage(const BeadPhantom& phantom, const XrayCamera& camera, const Pose& T_camera_phantom,
                         const BeadExposure& exposure, Random& random) {
  constexpr int kRays = 3;
  cv::Mat fine(camera.height_px(), camera.width_px(), CV_32F, cv::Scalar(0));
  cv::Mat primary(fine.size(), CV_32F, cv::Scalar(1));
  for (const Bead& bead : phantom.beads) {
    const Eigen::Vector3d c = T_camera_phantom * bead.position_m;
    const Eigen::Vector2d px = *camera.project(c);
    const int reach = static_cast<int>(1.2 * bead.radius_m / c.z() * camera.parameters().fx_px) + 2;
    const int cx = static_cast<int>(std::lround(px.x())), cy = static_cast<int>(std::lround(px.y()));
    for (int y = std::max(0, cy - reach); y <= std::min(fine.rows - 1, cy + reach); ++y) {
      for (int x = std::max(0, cx - reach); x <= std::min(fine.cols - 1, cx + reach); ++x) {
        double passed = 0;
        for (int k = 0; k < kRays * kRays; ++k) {
          const Eigen::Vector2d at(x + (k % kRays - 1.0) / kRays, y + (k / kRays - 1.0) / kRays);
          const Eigen::Vector3d ray = camera.ray(at).normalized();
          const double off2 = (c - ray.dot(c) * ray).squaredNorm();
          const double half2 = bead.radius_m * bead.radius_m - off2;
          passed += std::exp(-exposure.attenuation_per_m * 2 * std::sqrt(std::max(0.0, half2)));
        }
        primary.at<float>(y, x) *= static_cast<float>(passed / (kRays * kRays));
      }
    }
  }
  cv::Mat quanta(fine.size(), CV_32F), image(fine.size(), CV_16U);
  for (int y = 0; y < fine.rows; ++y) {
    for (int x = 0; x < fine.cols; ++x) {
      const double u = static_cast<double>(x) / fine.cols - 0.5, v = static_cast<double>(y) / fine.rows - 0.5;
      const double ground = std::exp(exposure.unevenness * (u + std::sin(6 * v) / 3 - 2 * u * v));
      quanta.at<float>(y, x) =
          static_cast<float>(ground * (primary.at<float>(y, x) + exposure.scatter) / (1 + exposure.scatter));
    }
  }
  cv::GaussianBlur(quanta, quanta, {0, 0}, exposure.blur_px);
  for (int y = 0; y < fine.rows; ++y) {
    for (int x = 0; x < fine.cols; ++x) {
      double value = quanta.at<float>(y, x);
      if (exposure.quanta > 0) value += std::sqrt(value / exposure.quanta) * random.normal();
      image.at<unsigned short>(y, x) = cv::saturate_cast<unsigned short>(25000 * value);
    }
  }
  return image;
}

}  // namespace angio::test
