// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_patient.hpp"

#include "angio/base/checked.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/shuffled.hpp"
#include "angio/simulation/contrast_filling.hpp"
#include "angio/vessel/resample.hpp"
#include "uniform.hpp"

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

// 1 at the points that contrast agent reaches; empty where it reaches all.
Eigen::VectorXd reached(const VesselTree& tree, const FillingSettings& settings, std::uint64_t seed) {
  if (settings.filled >= 1 && settings.missing <= 0) return {};
  Uniform uniform(seed ^ 0x66696c6c);  // Numbers of its own: no other draw is shifted by a filling.
  std::vector<double> length_m;
  for (const auto& branch : tree.branches()) length_m.push_back(arcLengths(tree, branch).back());
  FillingDraws draws;
  draws.emptying_order = shuffled(static_cast<int>(length_m.size()), [&] { return uniform(0, 1); });
  draws.first_site = uniform(0, 1);
  return filledPoints(tree, filledBranches(tree, length_m, settings, draws));
}

// The motion that PatientMotion makes: without the deformation that is measured.
MotionSettings withoutMeasured(MotionSettings motion) {
  if (motion.deformation.measured) motion.deformation.rms_mm = 0;
  return motion;
}

}  // namespace

SimulatedPatient::SimulatedPatient(const VesselTree& tree, const SimulatedPatientSettings& settings,
                                   const Surroundings& surroundings)
    : settings_(checked("simulation settings", settings)),
      tree_(withPlausibleRadii(tree, settings.fluoroscopy.end_radius_mm * 1e-3)),
      renderer_(tree_, settings.fluoroscopy, surroundings),
      bolus_(tree_, settings.bolus),
      filled_(reached(tree_, settings.filling, static_cast<std::uint64_t>(settings.fluoroscopy.seed))),
      motion_(withoutMeasured(settings.motion), tree_.centroid(), surroundings.R_lps_model,
              static_cast<std::uint64_t>(settings.fluoroscopy.seed)),
      device_path_(devicePath(tree_, settings.device)) {
  const TreeDeformationSettings& deformation = settings.motion.deformation;
  if (!deformation.measured || deformation.rms_mm <= 0) return;
  Uniform uniform(static_cast<std::uint64_t>(settings.fluoroscopy.seed) ^ 0x6d65);
  const double u = uniform(0, 1), v = uniform(0, 1), w = uniform(0, 1);
  deformation_.emplace(tree_, carriedOver(*deformation.measured, tree_, uniformRotation(u, v, w)),
                       1e-3 * deformation.rms_mm);
  deformed_m_ = deformation_->at(tree_.points());
}

XrayScene SimulatedPatient::scene(const Pose& T_camera_rest, double time_s) const {
  XrayScene scene;
  scene.T_camera_model = T_camera_rest * motion_.shift(time_s);
  if (motion_.moves()) scene.displacements_m = motion_.displacements(tree_.points(), time_s);
  if (deformation_) scene.displacements_m = scene.displacements_m ? *scene.displacements_m + deformed_m_ : deformed_m_;
  if (settings_.bolus.enabled) scene.densities = bolus_.densities(time_s);
  if (filled_.size() > 0) {
    scene.densities = scene.densities ? Eigen::VectorXd(scene.densities->cwiseProduct(filled_)) : filled_;
  }
  if (device_path_.empty()) return scene;
  const DeviceSettings& d = settings_.device;
  scene.devices =
      deviceInTree(d, scene.pointsOf(tree_), device_path_, 1e-3 * (d.inserted_mm + d.speed_mm_per_s * time_s));
  return scene;
}

}  // namespace angio::simulation
