// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

using Triangle = std::array<Eigen::Vector3f, 3>;

constexpr int kPipeSides = 48;

// Of a pipe of radius 3 mm along z through (20, 30, 0).
inline Eigen::Vector3f pipeCorner(int side, float z) {
  const double angle = 2 * kPi * (side % kPipeSides) / kPipeSides;
  return {static_cast<float>(20 + 3 * std::cos(angle)), static_cast<float>(30 + 3 * std::sin(angle)), z};
}

/// A pipe of radius 3 mm along z from (20, 30, z0) to z1 [mm], without lids, fronts outwards.
inline std::vector<Triangle> openPipe(float z0 = 0, float z1 = 40) {
  std::vector<Triangle> triangles;
  for (int s = 0; s < kPipeSides; ++s) {
    triangles.push_back({pipeCorner(s, z0), pipeCorner(s + 1, z0), pipeCorner(s, z1)});
    triangles.push_back({pipeCorner(s + 1, z0), pipeCorner(s + 1, z1), pipeCorner(s, z1)});
  }
  return triangles;
}

/// A disc across that pipe, front to +z.
inline std::vector<Triangle> pipeDisc(float z) {
  std::vector<Triangle> triangles;
  for (int s = 0; s < kPipeSides; ++s) {
    triangles.push_back({Eigen::Vector3f(20, 30, z), pipeCorner(s, z), pipeCorner(s + 1, z)});
  }
  return triangles;
}

inline std::vector<Triangle> turnedRound(std::vector<Triangle> triangles) {
  for (Triangle& t : triangles) std::swap(t[1], t[2]);
  return triangles;
}

inline std::vector<Triangle> together(std::vector<Triangle> a, const std::vector<Triangle>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

inline std::string binaryStl(const std::vector<Triangle>& triangles) {
  std::string bytes(84, '\0');
  const auto count = static_cast<std::uint32_t>(triangles.size());
  std::memcpy(&bytes[80], &count, 4);
  for (const Triangle& triangle : triangles) {
    bytes += std::string(12, '\0');
    for (const auto& corner : triangle) bytes.append(reinterpret_cast<const char*>(corner.data()), 12);
    bytes += std::string(2, '\0');
  }
  return bytes;
}

}  // namespace angio::test
