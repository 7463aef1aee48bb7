// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/perception/catheter_registration.hpp"
#include "angio/perception/depth_window.hpp"
#include "angio/perception/frame_geometry.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/perception/perception.hpp"
#include "angio/perception/reading_search.hpp"
#include "angio/perception/registration_gate.hpp"
#include "angio/perception/resolved_tree.hpp"

namespace angio::perception {

/// What a frame shows, and whether it may be used.
struct GatedObservation {
  Observation observation;
  std::optional<std::string> rejection;       ///< Why it may not be used; nothing when it may.
  std::optional<PatientObservation> patient;  ///< Where the model is; nothing when the observation was rejected.
  /// Of a frame that was registered by its catheter: how. The observation's registration is then ofWholeTree() of it.
  std::optional<RegisteredByCatheter> by_catheter;

  /// Whether it is rejected for no more than that the target is not known well enough for the task.
  bool too_unsure = false;

  /// Whether a sound registration says what cannot be: it converged, far from calibration or prediction. A target that
  /// is not known well enough is a doubt, which later frames may end.
  bool contradicts() const {
    return rejection && !too_unsure && observation.registration.status == RegistrationStatus::kConverged;
  }
};

/// Where the target was in a frame, by that and the frames before it, from other places of the C-arm.
struct ResolvedDepth {
  Eigen::Vector3d target_camera = Eigen::Vector3d::Zero();  ///< [m].
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();  ///< Of it, camera axes.
  Pose T_camera_patient = Pose::Identity();                 ///< Where the camera was.
  DepthFromMotion fit;

  /// Returns the standard deviation of the target in its worst direction [m].
  double worstStd_m() const { return angio::perception::worstStd_m(covariance_m2); }
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
/// tracked, one that does not is counted as missed. A frame that is registered by its catheter is as well: what it
/// knows of the target may be used, but the whole tree is not looked for by it.
class GatedPerception {
 public:
  /// @param point  A place that is observed for itself besides the tree.
  /// Throws InputError when a setting is out of its range.
  GatedPerception(const GatedPerceptionSettings& settings, const VesselTree& tree,
                  const std::optional<PointOfInterest>& point = std::nullopt);

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
  /// as long as one search while ReadingSearch looks at frames none of which has registered yet, or as
  /// CatheterRegistration::learn().
  /// Where depth is being found (TargetNeed::kResolvingDepth) also resolveDepth(), when the C-arm has come to rest
  /// after a turn that says more than what is known.
  void learn();

  /// Asks all frames of the last seconds together for the depth. Takes about a second. From then on a frame's
  /// observation goes by it (ResolvedTree), until frames contradict it or it is outdated.
  void resolveDepth();

  /// What that said last; nothing before, or where it did not tell.
  const std::optional<ResolvedDepth>& resolved() const { return resolved_; }

  ModelId modelId() const { return perception_.modelId(); }

  /// Where the model is with these joints: by calibration alone, and by all frames that were accepted.
  Pose calibrated_T_camera_model(const CArmJoints& joints) const {
    return perception_.calibrated_T_camera_model(joints);
  }
  Pose tracked_T_camera_model(const CArmJoints& joints) const { return perception_.tracked_T_camera_model(joints); }

 private:
  void look(const XrayViews& views, const CameraPlace& place, GatedObservation& result);
  void gate(const XrayView* view, const CameraPlace& place, GatedObservation& result);
  void goByCatheter(RegisteredByCatheter by, const CameraPlace& place, GatedObservation& result);
  std::optional<std::string> placeByTurn(PatientObservation& patient, const RegistrationResult& seen,
                                         const CameraPlace& place);
  void forgetDepth();

  CArmGeometry carm_;
  Eigen::Vector3d target_;
  Perception perception_;
  RegistrationGate gate_;
  TargetNeed need_;
  VesselTree tree_;
  std::optional<CatheterRegistration> catheter_;
  DepthWindow window_;
  Matrix6d prior_;  // Of the calibrated pose.
  std::optional<ResolvedDepth> resolved_;
  std::shared_ptr<const ResolvedTree> resolved_tree_;
  int contradicted_in_a_row_ = 0;  // By frames, of what was resolved.
  FocalLengthMonitor focal_length_;
  ReadingSearch reading_;
};

}  // namespace angio::perception
