// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::registration {

/// Where and in which directions an image explains a projected place, as bits of a raster, and the same for places that
/// are only known to within a radius.
///
/// A word has one bit for each of 32 directions of half a turn. Level 0 is the raster itself. A place whose pixel is
/// known to within `radius_px` in u and v may be explained in the directions of its word on that level, and in no
/// others: each word holds all bits of level 0 within the radius of any place of its cell.
class ExplainedRaster {
 public:
  static constexpr double kReach_px = 4, kReach_rad = 0.175;  ///< How far a point of the image explains.
  static constexpr int kDirections = 32, kLevels = 25;

  ExplainedRaster(const Centerline2d& image, const XrayCamera& camera);

  /// In order of radius, one array a quantity, as vector code reads them; the last is one cell for places that may be
  /// anywhere.
  struct Levels {
    float radius_px[kLevels], inverse_cell_px[kLevels], last_column[kLevels], last_row[kLevels];
    std::int32_t first[kLevels], columns[kLevels];  ///< Word of the first cell, and cells in a row.
  };
  const Levels& levels() const { return levels_; }
  const std::uint32_t* words() const { return words_.data(); }

  /// Position in cells of a pixel coordinate on a level is (pixel + kBefore_px) * inverse_cell_px, rounded down and
  /// kept on the level.
  static constexpr double kBefore_px = 64.5;

  /// Whether the image explains a place at a pixel whose vessel runs along (du, dv). One seen end-on has no direction,
  /// and any will do.
  bool explains(double u_px, double v_px, double du, double dv) const;

 private:
  // Sets all of a level but its words, which are the next to be added.
  void setLevel(int k, float radius_px, float inverse_cell_px, int columns, int rows);

  Levels levels_;
  std::vector<std::uint32_t> words_;
};

}  // namespace angio::registration
