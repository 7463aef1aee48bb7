// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_matching.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "bead_orientation.hpp"

namespace angio::calibration {
namespace {

constexpr std::size_t kFewest = 12;
constexpr std::size_t kRefined = 80;        // Orientations that are refined, those with most votes.
constexpr double kConclusive = 0.8;         // Share of agreement that ends the search.
constexpr double kNeighbourhood_rad = 0.7;  // Around likely orientations.
constexpr std::size_t kLikely = 4;

std::vector<double> radiiOf(const std::string& place, const std::vector<BeadDetection>& detections) {
  std::vector<double> radii;
  for (const BeadDetection& seen : detections) {
    if (!seen.radius_px)
      throw InputError(place, "radius_px", "", "is missing: neither numbers nor sizes tell the beads apart");
    radii.push_back(*seen.radius_px);
  }
  if (radii.size() < kFewest) {
    throw InputError(place, "beads", std::to_string(radii.size()),
                     "must be at least " + std::to_string(kFewest) + " to be told apart");
  }
  return radii;
}

}  // namespace

BeadMatch matchBeads(const std::string& place, const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                     const std::vector<Eigen::Matrix3d>& likely, const BeadMatchingSettings& settings) {
  checkSettings("bead matching", settings);
  const std::vector<double> radii = radiiOf(place, detections);
  Refinement best;
  std::vector<BeadScale> scales = likelyScales(phantom, radii);
  for (const BeadScale& scale : scales) {
    const OrientationVotes votes(phantom, detections, scale, degToRad(settings.rotation_step_deg));
    const auto search = [&](const std::vector<Eigen::Matrix3d>& orientations) {
      for (const OrientationVote& vote : votes.best(orientations, kRefined)) {
        Refinement refined = refinedMatch(phantom, detections, scale, vote, votes.bin_px(), settings.tolerance_px);
        if (refined.share > best.share) best = std::move(refined);
        if (best.share >= kConclusive) return true;
      }
      return false;
    };
    const std::vector<Eigen::Matrix3d> grid = orientationGrid(degToRad(settings.rotation_step_deg));
    bool done = false;
    for (std::size_t k = 0; k < std::min(kLikely, likely.size()) && !done; ++k) {
      std::vector<Eigen::Matrix3d> near;
      for (const auto& R : grid) {
        if (rotationAngle(R * likely[k].transpose()) < kNeighbourhood_rad) near.push_back(R);
      }
      done = search(near);
    }
    if (done || search(grid)) break;
  }
  if (!(best.share >= settings.min_share)) {
    throw InputError(place, "beads", std::to_string(best.matched) + " of " + std::to_string(detections.size()),
                     "cannot be told apart: no orientation of " + phantom.name +
                         " explains them; is it the right phantom, and most of it in the image?");
  }
  return {best.bead, best.matched, best.R_camera_phantom};
}

}  // namespace angio::calibration
