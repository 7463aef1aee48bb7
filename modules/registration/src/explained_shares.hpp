// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "oriented_frame.hpp"
#include "oriented_model.hpp"

namespace angio::registration {

/// How much of an image and of the model in view explain each other under a pose, roughly and quickly, for comparing
/// many poses of one view.
///
/// A raster has eight directions of half a turn in each cell. Model and image explain what lies in their cells and the
/// eight around, in their direction and the two beside. A model point explains a part of the image once, however many
/// others lie there: where most branches are empty of contrast agent, fields favour poses with many of them over a few
/// filled ones.
class ExplainedShares {
 public:
  /// Borrows both. @param cell_px  Side of a cell.
  ExplainedShares(const OrientedModel& model, const OrientedFrame& frame, double cell_px);

  /// Explained share of the image's length times that of the model's in view, in [0, 1].
  double of(const Pose& T_camera_centered);

 private:
  using Raster = std::vector<std::uint8_t>;  // A bit for each direction.
  int cellAt(double u_px, double v_px) const;
  void widen(Raster& raster);

  const OrientedModel& model_;
  const XrayView& view_;
  double cell_px_, total_px_ = 0;
  int columns_, rows_;  // With one around the detector's.
  Raster image_, shown_, work_;
  std::vector<int> cells_;  // Of the image's points.
  std::vector<std::uint8_t> directions_;
  std::vector<float> lengths_px_;
};

}  // namespace angio::registration
