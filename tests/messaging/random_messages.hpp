// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/descriptions.hpp>

#include "angio/messaging/codec.hpp"
#include "angio/test/namespace.hpp"
#include "field_visitors.hpp"

namespace angio::test {

inline std::int64_t randomInt64(Random& random) { return static_cast<std::int64_t>(random.uniform(-9e18, 9e18)); }

/// Any message whose members are its fields.
template <typename T>
T randomMessage(Random& random) {
  T message;
  RandomFields fields(random);
  wire::Description<T>::fields(fields, message);
  return message;
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
  const auto time_us = static_cast<std::int64_t>(random.uniform(wire::kUtime.low, wire::kUtime.high));
  return {time_us, randomInt64(random), wide.colRange(1, width + 1), XrayCamera(p)};
}

template <>
inline XrayFrame randomMessage(Random& random) {
  return randomFrame(random, 7, 5, random.uniform(0, 1) < 0.5 ? CV_8UC1 : CV_16UC1);
}

}  // namespace angio::test
