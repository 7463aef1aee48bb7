// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "angio/evaluation/namespace.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::evaluation {

/// A branch as a person chooses it.
struct NumberedBranch {
  int number = 0;  ///< TreeLocation::branch: what a catheter's loop takes for the branch to go to.
  std::string name;
  std::optional<int> parent;  ///< None where a root is.
  double length_m = 0;
  std::optional<double> mean_radius_m;  ///< Over its length, where the tree knows both ends of an edge.
};

/// All branches of a tree in the order of their numbers. `names` has one for each, or is empty.
std::vector<NumberedBranch> numberedBranches(const VesselTree& tree, const std::vector<std::string>& names = {});

/// What a picture of branches shows: two parallel projections of the tree, antero-posterior (0, 0) and lateral (LAO
/// 90), as an X-ray image shows them, with branches in colours, their numbers, roots, where in the patient the sides
/// are, and a scale.
struct BranchPicture {
  std::vector<Plot> views;
  int side_px = 0;  ///< Of each view, which is a square; large trees get large ones.
};

/// @param R_lps_model  Patient axes L, P, S from the model's axes.
/// @param note         A line below the first view.
BranchPicture branchPicture(const VesselTree& tree, const std::vector<NumberedBranch>& branches,
                            const Eigen::Matrix3d& R_lps_model, const std::string& note);

/// Writes such a picture: .svg, or what writeImage takes. Throws InputError for another extension or when the file
/// cannot be written.
void writeBranchPicture(const std::string& path, const BranchPicture& picture);

}  // namespace angio::evaluation
