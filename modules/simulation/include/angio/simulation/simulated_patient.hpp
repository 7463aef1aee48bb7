// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/simulation/bolus.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/simulation/patient_motion.hpp"
#include "angio/simulation/patient_settings.hpp"
#include "angio/simulation/tree_deformation.hpp"

namespace angio::simulation {

/// A patient over time: vessels, contrast agent, motion and a device, and X-ray images of them.
class SimulatedPatient {
 public:
  /// Radii that `tree` does not know are filled in by withPlausibleRadii. Throws InputError when a setting is out of
  /// its range, the device's end is none of the tree's, or the volume cannot be.
  SimulatedPatient(const VesselTree& tree, const SimulatedPatientSettings& settings,
                   const Surroundings& surroundings = {});

  /// The tree at rest, all radii known.
  const VesselTree& tree() const { return tree_; }

  /// Begin and end an injection at a time [s] from the first frame on, as Bolus does.
  void beginInjection(double time_s) { bolus_.beginInjection(time_s); }
  void endInjection(double time_s) { bolus_.endInjection(time_s); }

  /// What there is in front of a camera at a time [s] from the first frame on.
  /// @param T_camera_rest  The model frame in the camera as it would be if the patient had not shifted.
  XrayScene scene(const Pose& T_camera_rest, double time_s) const;

  /// Where a point of the model at rest [m] has gone by then: model frame of the patient who has not shifted [m].
  Eigen::Vector3d moved(const Eigen::Vector3d& p_model, double time_s) const {
    Eigen::Vector3d p = p_model + motion_.displacement(p_model, time_s);
    if (deformation_) p += deformation_->at(p_model);
    return motion_.shift(time_s) * p;
  }

  /// As FluoroscopyRenderer's.
  cv::Mat render(const XrayCamera& camera, const XrayScene& scene, std::uint64_t frame) {
    return renderer_.render(camera, scene, frame);
  }
  FrameTruth truth(const XrayCamera& camera, const XrayScene& scene) {
    return renderer_.truth(camera, scene, settings_.truth);
  }

 private:
  SimulatedPatientSettings settings_;
  VesselTree tree_;
  FluoroscopyRenderer renderer_;
  Bolus bolus_;
  Eigen::VectorXd filled_;  // 1 at the tree's points that contrast agent reaches, 0 at the others; empty: all are.
  PatientMotion motion_;
  std::optional<TreeDeformation>
      deformation_;  // By a measured motion, at all times, of the tree's points: deformed_m_.
  Eigen::Matrix3Xd deformed_m_;
  std::vector<int> device_path_;  // Points of the tree from its root to where the device goes.
};

}  // namespace angio::simulation
