// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_patient.hpp"

#include "angio/base/checked.hpp"
#include "angio/base/errors.hpp"

namespace angio::simulation {
namespace {

std::vector<int> devicePath(const VesselTree& tree, const DeviceSettings& settings) {
  if (settings.kind == DeviceKind::kNone) return {};
  const std::vector<int> ends = endsByDistance(tree);
  if (settings.tip_branch >= static_cast<int>(ends.size())) {
    throw InputError("device", "tip_branch", std::to_string(settings.tip_branch),
                     "must be below " + std::to_string(ends.size()) + ", the number of the tree's ends");
  }
  return pathFromRoot(tree, ends[settings.tip_branch]);
}

}  // namespace

SimulatedPatient::SimulatedPatient(const VesselTree& tree, const SimulatedPatientSettings& settings,
                                   const Surroundings& surroundings)
    : settings_(checked("simulation settings", settings)),
      tree_(withPlausibleRadii(tree, settings.fluoroscopy.end_radius_mm * 1e-3)),
      renderer_(tree_, settings.fluoroscopy, surroundings),
      bolus_(tree_, settings.bolus),
      motion_(settings.motion, tree_.centroid(), surroundings.R_lps_model,
              static_cast<std::uint64_t>(settings.fluoroscopy.seed)),
      device_path_(devicePath(tree_, settings.device)) {}

XrayScene SimulatedPatient::scene(const Pose& T_camera_rest, double time_s) const {
  XrayScene scene;
  scene.T_camera_model = T_camera_rest * motion_.shift(time_s);
  if (motion_.moves()) scene.displacements_m = motion_.displacements(tree_.points(), time_s);
  if (settings_.bolus.enabled) scene.densities = bolus_.densities(time_s);
  if (device_path_.empty()) return scene;
  const DeviceSettings& d = settings_.device;
  scene.devices =
      deviceInTree(d, scene.pointsOf(tree_), device_path_, 1e-3 * (d.inserted_mm + d.speed_mm_per_s * time_s));
  return scene;
}

}  // namespace angio::simulation
