// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "angio/evaluation/simulation.hpp"
#include "angio/simulation/fluoroscopy.hpp"

namespace angio::evaluation {

/// What an X-ray image of a trial shows.
struct TrialTruth {
  Centerline2d visible;  ///< Vessels that can be seen at the dose, and devices.
  Centerline2d all;      ///< Those that cannot be seen as well.
};

/// Makes the X-ray images of simulated trials: contrast agent in the filled branches, the patient around them, wires
/// where the trial has curves that are no vessel.
class TrialImages {
 public:
  /// Throws InputError when a setting is out of its range, or `settings` asks for noise of points, which images do not
  /// have.
  TrialImages(const std::vector<VesselTree>& trees, const SimulationSettings& settings);
  ~TrialImages();

  /// One view of a trial of one of the trees. Noise is that of the trial's `index` and view.
  cv::Mat render(const SimulatedTrial& trial, std::size_t tree, std::size_t view, int index);

  /// What that image shows.
  TrialTruth truth(const SimulatedTrial& trial, std::size_t tree, std::size_t view);

 private:
  XrayScene sceneOf(const SimulatedTrial& trial, std::size_t view) const;

  SimulationSettings settings_;
  std::vector<std::unique_ptr<FluoroscopyRenderer>> renderers_;  // By tree.
};

}  // namespace angio::evaluation
