// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/servo/best_view.hpp"

namespace angio::servo {

/// A segment and the tree around it, laid out so that one view costs some ten microseconds.
class SegmentViews {
 public:
  SegmentViews(const VesselTree& tree, const TreeSegment& segment, const BestViewScene& scene,
               const BestViewSettings& settings);

  ViewCost cost(const ViewAngles& angles) const;

  const Eigen::Vector3d& middle_model() const { return middle_; }

 private:
  struct Tube {  // One point of a vessel in the image, scaled to the isocentre's distance [m].
    float x, y, r;
    Eigen::Index point;
  };
  float covered(Eigen::Index sample, const Tube& image, const std::vector<Tube>& near) const;

  double source_isocenter_distance_m_;
  Eigen::Vector3d middle_;
  Eigen::Matrix3Xf samples_, tangents_;  // Of the segment, patient axes about its middle [m].
  Eigen::ArrayXf lengths_m_, radii_m_;   // Of what each sample stands for; its radius.
  Eigen::Matrix3Xf others_;              // The tree's points, the same axes.
  Eigen::ArrayXf other_radii_m_;
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> joined_;  // By sample and point.
};

}  // namespace angio::servo
