// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/image_reading.hpp"

#include <cmath>

namespace angio::perception {
namespace {

// Where a reading takes a direction of the image as it was sent.
Eigen::Matrix2d turnOf(ImageReading reading) {
  // By rows. Turned right, what was up is to the right: (0, -1) becomes (1, 0).
  constexpr double kTurns[][4] = {{1, 0, 0, 1},  {-1, 0, 0, 1}, {1, 0, 0, -1}, {-1, 0, 0, -1},
                                  {0, -1, 1, 0}, {0, 1, -1, 0}, {0, 1, 1, 0},  {0, -1, -1, 0}};
  return Eigen::Map<const Eigen::Matrix<double, 2, 2, Eigen::RowMajor>>(kTurns[static_cast<int>(reading)]);
}

}  // namespace

const char* nameOf(ImageReading reading) {
  constexpr const char* kNames[] = {"as sent",
                                    "mirrored left to right",
                                    "mirrored top to bottom",
                                    "turned by 180 deg",
                                    "turned by 90 deg clockwise",
                                    "turned by 90 deg anticlockwise",
                                    "mirrored about its falling diagonal",
                                    "mirrored about its rising diagonal"};
  return kNames[static_cast<int>(reading)];
}

std::vector<ImageReading> otherReadings(const XrayCamera& camera) {
  std::vector<ImageReading> others;
  for (const ImageReading reading : kImageReadings) {
    const bool swaps = reading >= ImageReading::kTurnedRight;
    if (reading == ImageReading::kAsSent || (swaps && camera.width_px() != camera.height_px())) continue;
    others.push_back(reading);
  }
  return others;
}

Centerline2d readAs(ImageReading reading, const Centerline2d& curves, const XrayCamera& camera) {
  const Eigen::Matrix2d M = turnOf(reading);
  const Eigen::Vector2d middle(0.5 * (camera.width_px() - 1), 0.5 * (camera.height_px() - 1));
  Centerline2d read = curves;
  read.points_px = (M * (curves.points_px.colwise() - middle)).colwise() + middle;
  for (Eigen::Index i = 0; i < curves.tangent_rad.size(); ++i) {
    const Eigen::Vector2d along = M * Eigen::Vector2d(std::cos(curves.tangent_rad[i]), std::sin(curves.tangent_rad[i]));
    read.tangent_rad[i] = undirected(std::atan2(along.y(), along.x()));
  }
  return read;
}

}  // namespace angio::perception
