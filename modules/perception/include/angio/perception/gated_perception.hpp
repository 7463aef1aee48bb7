// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/perception/frame_geometry.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/perception/perception.hpp"
#include "angio/perception/reading_search.hpp"
#include "angio/perception/registration_gate.hpp"

namespace angio::perception {

/// What a frame shows, and whether it may be used.
struct GatedObservation {
  Observation observation;
  std::optional<std::string> rejection;       ///< Why it may not be used; nothing when it may.
  std::optional<PatientObservation> patient;  ///< Where the model is; nothing when the observation was rejected.

  /// Whether a sound registration says what cannot be: it converged, far from calibration or prediction.
  bool contradicts() const { return rejection && observation.registration.status == RegistrationStatus::kConverged; }
};

/// What frames are observed with, and which observations are used. The same settings track the same frames alike.
struct GatedPerceptionSettings {
  PerceptionSettings perception;
  RegistrationGateSettings gate;
  CArmGeometry carm;
  Pose T_dsa_cb = Pose::Identity();             ///< Calibrated: model frame in the patient frame.
  std::optional<Eigen::Vector3d> target_model;  ///< The point whose place matters [m]; the tree's centroid.
  TargetNeed need = TargetNeed::kEverywhere;    ///< The directions in which it matters.
};

/// Perception behind the gate: every loop and node observes frames through this. An observation that passes the gate is
/// tracked, one that does not is counted as missed.
class GatedPerception {
 public:
  /// @param point  A place that is observed for itself besides the tree.
  /// Throws InputError when a setting is out of its range.
  GatedPerception(const GatedPerceptionSettings& settings, const VesselTree& tree,
                  const std::optional<PointOfInterest>& point = std::nullopt)
      : carm_(settings.carm),
        target_(settings.target_model.value_or(tree.centroid())),
        perception_(settings.perception, settings.carm, settings.T_dsa_cb, tree, point),
        gate_(settings.gate, target_, settings.need) {}

  /// Why a frame must not be read with these joints, or contradicts the calibrated geometry; nothing when it may.
  std::optional<std::string> rejection(const XrayFrame& frame, const CArmState& state) const {
    if (auto why = gate_.rejection(frame, state)) return why;
    return contradiction(frame.camera, carm_);
  }

  /// What all accepted observations together say against the focal length of the frames; nothing: nothing.
  std::optional<std::string> focalLengthWarning() const { return focal_length_.warning(); }

  /// Observes a frame that was exposed while the joints were as in `state`. A rejection says also in which reading the
  /// frames would match, once learn() has found that.
  GatedObservation observe(const XrayFrame& frame, const CArmState& state);

  /// Observes what was found in the views of one moment, whose first camera stood at `place`.
  GatedObservation observe(const XrayViews& views, const CameraPlace& place);

  /// Uses another program's registration of the frame.
  GatedObservation adopt(const RegistrationResult& registration, const CArmState& state);

  /// Learns how the patient moves, when what a frame was wanted for is out. Takes some milliseconds now and then, and
  /// as long as one search while ReadingSearch looks at frames none of which has registered yet.
  void learn() {
    perception_.learn();
    reading_.tryNext(perception_, gate_);
  }

  ModelId modelId() const { return perception_.modelId(); }

  /// Where the model is with these joints: by calibration alone, and by all frames that were accepted.
  Pose calibrated_T_camera_model(const CArmJoints& joints) const {
    return perception_.calibrated_T_camera_model(joints);
  }
  Pose tracked_T_camera_model(const CArmJoints& joints) const { return perception_.tracked_T_camera_model(joints); }

 private:
  GatedObservation gated(Observation observation, const CameraPlace& place);

  CArmGeometry carm_;
  Eigen::Vector3d target_;
  Perception perception_;
  RegistrationGate gate_;
  FocalLengthMonitor focal_length_;
  ReadingSearch reading_;
};

}  // namespace angio::perception
