// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "angio/io/vessel_files.hpp"
#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// What keeps a shape from being one clean tree. The first five are found in skeletons, the next in masks, the others
/// in surfaces.
enum class Flaw {
  kCycle,           ///< A loop of vessels. Length: once round it; radius: where it is cut.
  kSelfTouch,       ///< A vessel touches itself, or another of its tree. As of kCycle.
  kKissing,         ///< Vessels of two trees touch. Length: from one centreline to the other; radius: at the contact.
  kStub,            ///< A side branch too short for a vessel. Length: out of its parent; radius: the parent's.
  kSmallTree,       ///< Length: of the tree; radius: the largest.
  kSmallPiece,      ///< Pieces too small for a vessel, with the place of the largest. Length: 0; radius: of a ball as
                    ///< large.
  kOpenEnd,         ///< A hole of a surface. Length: of its border; radius: of the circle with this border.
  kJoinedPoints,    ///< Points nearer than a hundredth of a voxel to others. Length: the farthest that one is moved.
  kDoubleTriangle,  ///< Triangles that the surface has already. Length, radius: 0, as of those that follow.
  kShell,           ///< One of several pieces of a surface.
  kInwardNormals,   ///< A piece whose triangles turn their front inwards.
  kMixedNormals,    ///< Edges whose two triangles turn their fronts to different sides.
  kInnerWall,       ///< Edges at which more than two triangles meet.
};

/// One flaw, or several that have no place of their own, and what was done about it.
struct Repair {
  Flaw flaw = Flaw::kCycle;
  Eigen::Vector3d at_m = Eigen::Vector3d::Zero();  ///< Where it is, or the first of them; the patient's L, P, S [m].
  double length_m = 0, radius_m = 0;               ///< See Flaw [m].
  int count = 1;
  std::string done = {};  ///< In words: "cut where it is thinnest".
};

/// "12.0,3.1,-8.2 (75.4 mm round, radius 1.2 mm)": the place in the frame [mm], and what the flaw's kind measures.
std::string repairPlace(const Repair& repair, io::PatientFrame frame);

/// A line for each kind of flaw, with how many there are, what was done, and the places of the largest `most` [mm of
/// the frame].
std::vector<std::string> repairLines(const std::vector<Repair>& repairs, io::PatientFrame frame, std::size_t most);

/// All of them: `kind`, `count`, `at_mm` in the frame, `length_mm`, `radius_mm`, `done`.
nlohmann::ordered_json repairsAsJson(const std::vector<Repair>& repairs, io::PatientFrame frame);

}  // namespace angio::volume
