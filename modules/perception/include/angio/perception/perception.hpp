// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/imaging/extractor.hpp"
#include "angio/perception/patient_tracker.hpp"
#include "angio/perception/point_of_interest.hpp"
#include "angio/types/any_message.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio::perception {

class LocalOffsetEstimator;

/// How frames are looked at. The parts are chosen by the type of their settings.
struct PerceptionSettings {
  ExtractorSettings extractor = RidgeSettings{};
  RegistrationSettings search = OrientedKernelSettings{};  ///< While nothing is tracked ...
  StartSettings search_starts;
  /// ... and from frame to frame. A breath deforms a tree more smoothly than what makes a tree differ from its CT: of
  /// `oriented_kernel` deformations are taken to go together over twice the length.
  RegistrationSettings tracking = OrientedKernelSettings{};
  PatientTrackerSettings tracker;
  /// Whether frames that show a catheter alone, and that no pose explains, are registered by it (CatheterRegistration),
  /// by the method that searches, which must be `oriented_kernel`. GatedPerception does that.
  bool by_catheter = false;
  int catheter_rounds_at_once = 2;  ///< Of learning its run, after each frame; 0: as many as it takes.

  /// With the paper's method in place of the default: iterative_pnp with the prior that calibration gives, from a dozen
  /// starts; and from a start that is a few pixels off small scales only, and an end to its iterations that fits the
  /// frame rate.
  void useIterativePnp();
  static IterativePnpSettings iterativePnpForSearch();
  static IterativePnpSettings iterativePnpForTracking();
};

/// What one frame shows of where the model is. Whether it may be believed is for others to say.
struct Observation {
  Centerline2d curves;  ///< All that was found, devices too.
  /// What the registration went by: the vessels, and where they alone leave a tracked tree open, lines of devices that
  /// lie along it as well.
  Centerline2d centerline;
  PosePrior predicted;   ///< Where the model was looked for.
  bool tracked = false;  ///< Whether that was what trusted frames before had said, or calibration alone.
  ModelId model_id = ModelId::kUnknown;  ///< The tree that was looked for.

  /// Of a frame that only a deformed tree explains: pose of the rigid tree, which is the nearest one to it as a whole,
  /// with its covariance, in depth no smaller than the deformed fit's; agreement and displacements, counted from that
  /// pose, of the deformed one.
  RegistrationResult registration;
  std::optional<PointObservation> place;   ///< The watched place, in a frame whose registration has converged.
  double image_s = 0, registration_s = 0;  ///< Wall time of the stages [s].
};

/// Estimates the model's pose from a frame and the joints at its exposure, and tracks it from frame to frame. The same
/// frames, joints and decisions give the same observations, bit for bit.
class Perception {
 public:
  /// @param T_dsa_cb  Calibrated: the model frame in the patient frame (C-arm frame with the table at zero).
  /// @param place     What is seen for itself besides the tree.
  /// Throws InputError when a setting is out of its range.
  Perception(const PerceptionSettings& settings, const CArmGeometry& carm, const Pose& T_dsa_cb, const VesselTree& tree,
             const std::optional<PointOfInterest>& place = std::nullopt);

  /// Observes one frame of 8 or 16 bit that was exposed while the joints were as in `state`. Does not change what is
  /// tracked: accept() or reject() does.
  Observation observe(const XrayFrame& frame, const CArmState& state);

  /// Observes what was found in the views of one moment, whose first camera stood at `place`: curves are the first
  /// view's. A frame is observed so, once its curves have been found.
  Observation observe(const XrayViews& views, const CameraPlace& place);

  /// observe() in two parts: what a frame shows, or the first of several views, and where the model was looked for ...
  Observation see(const XrayFrame& frame, const CArmState& state);
  Observation see(const XrayViews& views, const CameraPlace& place) const;
  /// ... and its registration. `seen` is of the first of the views.
  void registerViews(const XrayViews& views, Observation& seen);

  /// Returns the observation that another program's registration of the frame gives: no curves, and no point of
  /// interest. Does not change what is tracked.
  Observation adopt(const RegistrationResult& registration, const CArmState& state) const;

  /// Tracks the patient where the observation has it.
  void accept(const Observation& observation, const CArmState& state) { accept(observation, placeOf(state)); }
  void accept(const Observation& observation, const CameraPlace& place) {
    accept(observation.registration.T_camera_model, observation.registration.covariance, place);
  }
  /// ... or where it is known to be better, with the covariance of its registration: PatientTracker::update().
  void accept(const Pose& T_camera_model, const std::optional<Matrix6d>& covariance, const CameraPlace& place,
              double shared_depth_m2 = 0) {
    tracker_.update(T_camera_model, place, covariance, shared_depth_m2);
  }

  /// Counts a frame that could not be trusted.
  void reject() { tracker_.miss(); }

  /// Learns how the patient moves from the observations that were accepted, when what a frame was wanted for is out.
  void learn() { tracker_.learn(); }

  /// The tree that is looked for.
  ModelId modelId() const { return model_id_; }

  /// Where the joints have the camera.
  CameraPlace placeOf(const CArmState& state) const { return tracker_.placeOf(state); }

  /// Where the model is from there, or with these joints: by calibration alone ...
  Pose calibrated_T_camera_model(const CameraPlace& place) const { return place.T_camera_patient * T_dsa_cb_; }
  Pose calibrated_T_camera_model(const CArmJoints& joints) const { return carm_.T_camera_patient(joints) * T_dsa_cb_; }
  /// ... and by all frames that were trusted.
  Pose tracked_T_camera_model(const CArmJoints& joints) const { return tracker_.predict(joints).T_camera_model; }

 private:
  Observation lookedFor(const CameraPlace& place) const;
  void takeBackVessels(const XrayViews& views, Observation& observation);
  void fitDeformed(const XrayViews& views, Observation& observation);
  void compareAlternatives(const XrayViews& views, Observation& observation);
  PointObservation seen(const PointOfInterest& place, const XrayCamera& camera, const Observation& observation) const;

  ModelId model_id_;
  CArmGeometry carm_;
  Pose T_dsa_cb_;
  StartSettings search_starts_;
  double max_deformation_m_;
  std::unique_ptr<CenterlineExtractor> extractor_;
  std::unique_ptr<Registration> search_, tracking_;
  std::unique_ptr<Registration> deformable_;  // Nothing for a patient who does not move.
  PatientTracker tracker_;
  std::optional<PointOfInterest> place_;
  Eigen::Index place_point_ = 0;                        // The tree's point that is nearest to the place.
  std::shared_ptr<const LocalOffsetEstimator> nearby_;  // Nothing where the image around the place is not asked.
};

}  // namespace angio::perception
