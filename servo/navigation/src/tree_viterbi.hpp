// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "angio/imaging/device_contrast.hpp"
#include "angio/localisation/tip_belief.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

/// Places about a millimetre apart all over a tree, parents first.
struct WalkPlaces {
  explicit WalkPlaces(const VesselTree& tree);

  int nearest(int of_branch, double at_m) const;  ///< Index of the place at an arc length, or the next one.

  std::vector<Eigen::Vector3d> points_m;
  std::vector<TreeFrame> frames;
  std::vector<double> path_m, arc_m, radius_m;
  std::vector<int> branch, parent, branch_first, branch_last;  ///< First and last place of each branch.
};

/// The places near a tip, parents first, and the path behind it.
struct WalkArea {
  std::vector<int> places;         ///< Indices of WalkPlaces.
  std::vector<int> parent;         ///< Indices into `places`, -1 where the area begins.
  std::vector<double> from_tip_m;  ///< Along the vessels, from the believed tip or an alternative of it.
};

/// All places within `ahead_m` of a believed tip, and the path back from it for `behind_m`.
WalkArea areaAround(const WalkPlaces& places, const TipBelief& expected, double behind_m, double ahead_m);

/// All paths of a dark line through an area at once: for each place and each displacement of its image, the best score
/// of a line that comes there from where the area begins (Viterbi over a tree).
class TreeViterbi {
 public:
  static constexpr double kStep_m = 0.35e-3;  ///< Between displacements, in the patient.
  static constexpr int kMaxReach = 48;        ///< Largest displacement of all, in steps: 17 mm, for an aorta.
  /// Over displacements: rows x, columns y, from -reach() to reach() steps each.
  using Scores = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic>;

  /// Borrows the places. A line may lie `slack_m` beside a lumen.
  TreeViterbi(const WalkPlaces& places, double slack_m) : places_(places), slack_m_(slack_m) {}

  /// Borrows the area and `px`: 2 x N, where its places are in the image. A catheter has the contrast `level`.
  void run(const WalkArea& area, const Eigen::Matrix2Xf& px, double px_per_m, const DeviceContrast& seen, double level);

  /// The largest displacement along each axis of the image, in steps: the radius of the area's widest vessel and the
  /// slack, between 8 steps and kMaxReach.
  int reach(const WalkArea& area) const;

  const Scores& score(int k) const { return scores_[k]; }
  const Scores& dark(int k) const { return dark_[k]; }  ///< The image's contrast there.

  /// What the best line to a place and a displacement [px] lacks of a perfect one; nothing for one out of reach.
  std::optional<double> lack(int k, const Eigen::Vector2f& off_px) const;

  /// The best line to a place and a displacement (index into Scores) [px].
  std::vector<Eigen::Vector2d> backFrom(int k, int u) const;

 private:
  Eigen::Vector2f at(int k, int u) const;

  const WalkPlaces& places_;
  const WalkArea* area_ = nullptr;
  const Eigen::Matrix2Xf* px_ = nullptr;
  float step_px_ = 1;
  int reach_ = 0, side_ = 1;  // Steps; displacements along an axis.
  bool wide_ = false;         // A vessel of the area is so wide that a tip lies across it.
  double slack_m_;
  std::vector<Scores> scores_, dark_;
  Eigen::MatrixXd beside_m_;  // Of each displacement, its length.
  Scores across_;
  Eigen::ArrayXf best_;     // Of a column.
  std::vector<int> steps_;  // Places from where the area begins.
};

}  // namespace angio::navigation
