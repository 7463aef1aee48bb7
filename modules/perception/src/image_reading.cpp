// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/image_reading.hpp"

#include <cmath>

namespace angio::perception {
namespace {

// Where a reading takes a direction of the image as it was sent.
Eigen::Matrix2d turnOf(ImageReading reading) {
  const auto rows = [](double xx, double xy, double yx, double yy) {
    return Eigen::Matrix2d((Eigen::Matrix2d() << xx, xy, yx, yy).finished());
  };
  switch (reading) {
    case ImageReading::kAsSent:
      return rows(1, 0, 0, 1);
    case ImageReading::kMirrored:
      return rows(-1, 0, 0, 1);
    case ImageReading::kUpsideDown:
      return rows(1, 0, 0, -1);
    case ImageReading::kTurnedHalf:
      return rows(-1, 0, 0, -1);
    case ImageReading::kTurnedRight:  // What was up is to the right: (0, -1) becomes (1, 0).
      return rows(0, -1, 1, 0);
    case ImageReading::kTurnedLeft:
      return rows(0, 1, -1, 0);
    case ImageReading::kTransposed:
      return rows(0, 1, 1, 0);
    case ImageReading::kAntiTransposed:
      return rows(0, -1, -1, 0);
  }
  return Eigen::Matrix2d::Identity();
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
    const bool swaps = static_cast<int>(reading) >= static_cast<int>(ImageReading::kTurnedRight);
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
