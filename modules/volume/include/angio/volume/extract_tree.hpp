// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>

#include "angio/vessel/vessel_tree.hpp"
#include "angio/volume/centreline_settings.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Centrelines of vessels, and what had to be done to get a tree.
struct ExtractedTree {
  VesselTree tree;        ///< In the patient's axes L, P, S [m], with radii; one tree per connected vessel.
  int cycles_cut = 0;     ///< Loops of vessels, each cut where it is thinnest.
  int trees_dropped = 0;  ///< Too small ones.
};

/// What is about to be done, for a progress bar; there are kExtractionStages.
using ExtractionProgress = std::function<void(int stages_done, const char* stage)>;
constexpr int kExtractionStages = 5;

/// The centrelines of vessels whose `shape` is positive inside and zero at the wall (vesselShape): thinned on equal
/// voxels in the order of the distance to the wall, linked to trees, freed of spurs, centred between voxels, smoothed,
/// brought to the wall at their ends. Radii are those of the largest sphere inside the vessel.
///
/// Roots are the thickest ends; of the tree nearest to `root_m` [m] it is the end nearest to it. Throws InputError for
/// settings that cannot be, and when no tree is long enough.
ExtractedTree extractTree(const Volume& shape, const CentrelineSettings& settings,
                          const std::optional<Eigen::Vector3d>& root_m = std::nullopt,
                          const ExtractionProgress& progress = {});

}  // namespace angio::volume
