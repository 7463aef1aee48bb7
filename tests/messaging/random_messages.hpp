// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/codec.hpp"
#include "angio/test/random.hpp"

namespace angio::test {

inline std::int64_t randomInt64(Random& random) { return static_cast<std::int64_t>(random.uniform(-9e18, 9e18)); }

inline CArmJoints randomJoints(Random& random) {
  return CArmJoints::NullaryExpr([&](Eigen::Index) { return random.normal(); });
}

template <typename T>
T randomMessage(Random& random);

template <>
inline CArmState randomMessage(Random& random) {
  return {randomInt64(random), randomInt64(random), randomJoints(random), randomJoints(random)};
}

template <>
inline ServoInput randomMessage(Random& random) {
  return {randomInt64(random), randomInt64(random), randomMessage<CArmState>(random),
          static_cast<ServoVerdict>(static_cast<int>(random.uniform(0, 3)))};
}

template <>
inline CArmCommand randomMessage(Random& random) {
  return {randomInt64(random), randomInt64(random), randomInt64(random),
          static_cast<std::int64_t>(random.uniform(0, 9e18)), randomJoints(random)};
}

template <>
inline RegistrationMessage randomMessage(Random& random) {
  RegistrationMessage m;
  m.time_us = randomInt64(random);
  m.frame_sequence = randomInt64(random);
  m.model_id = static_cast<ModelId>(randomInt64(random));
  m.status = static_cast<std::int8_t>(random.uniform(0, 128));
  m.status_text = std::string(static_cast<std::size_t>(random.uniform(0, 20)), 'x') + "\xc3\xa4\n";
  m.T_camera_model = expSE3(random.twist(1, 1));
  m.covariance = Matrix6d::NullaryExpr([&](Eigen::Index, Eigen::Index) { return random.normal(); });
  m.covariance.diagonal() =
      m.covariance.diagonal().cwiseAbs().eval();  // Unsymmetric, so that a swap of rows and columns shows.
  m.mean_residual_px = random.uniform(0, 10);
  m.points_3d = static_cast<std::int32_t>(random.uniform(0, 2e9));
  m.points_2d = static_cast<std::int32_t>(random.uniform(0, 2e9));
  return m;
}

template <>
inline ServoStatus randomMessage(Random& random) {
  ServoStatus m;
  m.time_us = randomInt64(random);
  m.frame_sequence = randomInt64(random);
  m.state = static_cast<ServoState>(random.uniform(0, 6));
  m.cause = static_cast<ServoCause>(random.uniform(0, 16));
  m.transitions = static_cast<std::int64_t>(random.uniform(0, 9e18));
  m.transition_time_us = randomInt64(random);
  m.reason = std::string(static_cast<std::size_t>(random.uniform(0, 20)), 'r');
  m.view_error_rad = random.normal();
  m.target_error_m = random.normal();
  m.image_us = randomInt64(random);
  m.registration_us = randomInt64(random);
  m.control_us = randomInt64(random);
  return m;
}

template <>
inline CatheterState randomMessage(Random& random) {
  return {randomInt64(random), randomInt64(random), random.normal(), random.normal(), std::abs(random.normal()),
          random.normal(),     random.normal(),     random.normal(), random.normal()};
}

template <>
inline CatheterCommand randomMessage(Random& random) {
  return {
      randomInt64(random), randomInt64(random), randomInt64(random), static_cast<std::int64_t>(random.uniform(0, 9e18)),
      random.normal(),     random.normal(),     random.normal()};
}

template <>
inline CatheterTip randomMessage(Random& random) {
  CatheterTip m;
  m.time_us = randomInt64(random);
  m.frame_sequence = randomInt64(random);
  m.model_id = static_cast<ModelId>(randomInt64(random));
  m.status = static_cast<CatheterTipStatus>(random.uniform(0, 3));
  m.tip_model = Eigen::Vector3d::NullaryExpr([&](Eigen::Index) { return random.normal(); });
  m.covariance = Eigen::Matrix3d::NullaryExpr([&](Eigen::Index, Eigen::Index) { return random.normal(); });
  m.covariance.diagonal() = m.covariance.diagonal().cwiseAbs().eval();
  m.branch = static_cast<std::int32_t>(random.uniform(0, 2e9));
  m.tree_point = static_cast<std::int32_t>(random.uniform(0, 2e9));
  m.arc_length_m = random.uniform(0, 1);
  m.probability = random.uniform(0, 1);
  m.reason = std::string(static_cast<std::size_t>(random.uniform(0, 20)), 'r');
  return m;
}

template <>
inline ServoRequest randomMessage(Random& random) {
  return {randomInt64(random), randomInt64(random), randomInt64(random),
          static_cast<std::int64_t>(random.uniform(0, 9e18)), static_cast<ServoRequestKind>(random.uniform(0, 5))};
}

template <>
inline CatheterInput randomMessage(Random& random) {
  return {randomInt64(random), randomInt64(random), static_cast<ServoVerdict>(static_cast<int>(random.uniform(0, 3))),
          randomMessage<CArmState>(random), randomMessage<CatheterState>(random)};
}

inline XrayFrame randomFrame(Random& random, int width, int height, int type) {
  XrayCamera::Parameters p;
  p.width_px = width;
  p.height_px = height;
  p.fx_px = random.uniform(1, 5000);
  p.fy_px = random.uniform(1, 5000);
  p.cx_px = random.normal();
  p.cy_px = random.normal();
  if (random.uniform(0, 1) < 0.5) p.pixel_spacing_m = random.uniform(1e-4, 1e-3);
  if (random.uniform(0, 1) < 0.5) p.source_detector_distance_m = random.uniform(0.5, 2);
  cv::Mat wide(height, width + 3, type);
  for (int y = 0; y < height; ++y) {
    for (std::size_t i = 0; i < wide.step[0]; ++i) wide.ptr(y)[i] = static_cast<std::uint8_t>(random.uniform(0, 256));
  }
  // A window into a wider image: its rows do not follow each other in memory.
  return {randomInt64(random), randomInt64(random), wide.colRange(1, width + 1), XrayCamera(p)};
}

template <>
inline XrayFrame randomMessage(Random& random) {
  return randomFrame(random, 7, 5, random.uniform(0, 1) < 0.5 ? CV_8UC1 : CV_16UC1);
}

}  // namespace angio::test
