// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core.hpp>

#include "angio/simulation/fluoroscopy.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

inline XrayCamera smallCamera() { return XrayCamera::centered(512, 512, 0.3e-3, 1.1); }

inline Pose inView() {
  Pose T = Pose::Identity();
  T.translation() << 0, 0, 0.75;
  return T;
}

/// One straight vessel.
inline VesselTree segment(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_m) {
  Eigen::Matrix3Xd points(3, 2);
  points << a, b;
  return VesselTree(points, {-1, 0}, {radius_m, radius_m});
}

/// One straight vessel across the image, its axis through the ray of pixel (255.5, 255.5).
inline VesselTree straight(double diameter_m) { return segment({-0.2, 0, 0}, {0.2, 0, 0}, 0.5 * diameter_m); }

/// A beam and a perfect detector: no anatomy, no scatter, no blur, no hardening.
inline FluoroscopySettings bare() {
  FluoroscopySettings settings;
  settings.anatomy.region = Region::kNone;
  settings.background_strength = 0;
  settings.beam_hardening = 0;
  settings.detector.scatter_to_primary = 0;
  settings.detector.psf_std_mm = 0;
  settings.detector.focal_spot_mm = 0;
  return settings;
}

inline FluoroscopySettings noiseOnly() {
  FluoroscopySettings settings = bare();
  settings.contrast_attenuation_per_mm = 0;
  return settings;
}

inline FluoroscopySettings withoutNoise(FluoroscopySettings settings) {
  settings.photons_per_pixel = 1e9;
  settings.electronic_noise_photons = 0;
  return settings;
}

inline cv::Mat asDouble(const cv::Mat& image) {
  cv::Mat result;
  image.convertTo(result, CV_64F);
  return result;
}

inline double correlation(const cv::Mat& a, const cv::Mat& b) {
  cv::Scalar mean_a, mean_b, std_a, std_b;
  cv::meanStdDev(a, mean_a, std_a);
  cv::meanStdDev(b, mean_b, std_b);
  return ((a.dot(b) / static_cast<double>(a.total())) - mean_a[0] * mean_b[0]) / (std_a[0] * std_b[0]);
}

inline XrayScene sceneAt(const Pose& T_camera_model) {
  XrayScene scene;
  scene.T_camera_model = T_camera_model;
  return scene;
}

}  // namespace angio::test
