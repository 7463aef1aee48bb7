// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/imaging/extractor.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/registration/starts.hpp"
#include "angio/servo/patient_tracker.hpp"
#include "angio/servo/watched_place.hpp"

namespace angio {

class LocalShift;

/// How frames are looked at. The parts are chosen by the type of their settings.
struct PerceptionSettings {
  ExtractorSettings extractor = RidgeSettings{};
  RegistrationSettings search = OrientedKernelSettings{};  ///< While nothing is tracked ...
  StartSettings search_starts;
  RegistrationSettings tracking = OrientedKernelSettings{};  ///< ... and from frame to frame.
  PatientTrackerSettings tracker;

  /// With the paper's method in place of the default: iterative_pnp with the prior that calibration gives, from a dozen
  /// starts; and from a start that is a few pixels off small scales only, and an end to its iterations that fits the
  /// frame rate.
  void useIterativePnp();
  static IterativePnpSettings iterativePnpForSearch();
  static IterativePnpSettings iterativePnpForTracking();
};

/// What one frame shows of where the model is. Whether it may be believed is for others to say.
struct Sight {
  Centerline2d curves;      ///< All that was found, devices too.
  Centerline2d centerline;  ///< What the registration went by.
  PosePrior predicted;      ///< Where the model was looked for.
  bool tracked = false;     ///< Whether that was what trusted frames before had said, or calibration alone.
  ModelId model_id = ModelId::kUnknown;  ///< The tree that was looked for.

  /// Of a frame that only a deformed tree explains: pose of the rigid tree, which is the nearest one to it as a whole,
  /// with its covariance, in depth no smaller than the deformed fit's; agreement and displacements, counted from that
  /// pose, of the deformed one.
  RegistrationResult registration;
  std::optional<PlaceSight> place;         ///< The watched place, in a frame whose registration has converged.
  double image_s = 0, registration_s = 0;  ///< Wall time of the stages [s].
};

/// Eyes and memory: from a frame and the joints of its exposure to where the model is. The same frames, joints and
/// judgements give the same sights, bit for bit.
class Perception {
 public:
  /// @param T_dsa_cb  Calibrated: the model frame in the patient frame (C-arm frame with the table at zero).
  /// @param place     What is seen for itself besides the tree.
  /// Throws InputError when a setting is out of its range.
  Perception(const PerceptionSettings& settings, const CArmGeometry& carm, const Pose& T_dsa_cb, const VesselTree& tree,
             const std::optional<WatchedPlace>& place = std::nullopt);
  Perception(Perception&&) noexcept;
  Perception& operator=(Perception&&) noexcept;
  ~Perception();

  /// Looks at one frame of 8 or 16 bit that was exposed while the joints were as in `state`. Changes nothing that is
  /// believed: trust() or doubt() does.
  Sight look(const XrayFrame& frame, const CArmState& state);

  /// The sight of somebody else, who has registered the frame: no curves, and no watched place. Changes nothing either.
  Sight take(const RegistrationResult& registration, const CArmState& state) const;

  /// Believes a sight: the patient lies where it says.
  void trust(const Sight& sight, const CArmState& state);

  /// A frame that could not be believed.
  void doubt();

  /// Learns how the patient moves, from the sights that were believed: when what a frame was wanted for is out.
  void learn();

  /// The tree that is looked for.
  ModelId modelId() const { return model_id_; }

  /// Where the model is with these joints: by calibration alone ...
  Pose calibrated_T_camera_model(const CArmJoints& joints) const;
  /// ... and by all frames that were trusted.
  Pose tracked_T_camera_model(const CArmJoints& joints) const;

 private:
  void bend(const XrayCamera& camera, Sight& sight);
  PlaceSight seen(const WatchedPlace& place, const XrayCamera& camera, const Sight& sight) const;

  ModelId model_id_;
  CArmGeometry carm_;
  Pose T_dsa_cb_;
  StartSettings search_starts_;
  double most_bend_m_;
  std::unique_ptr<CenterlineExtractor> extractor_;
  std::unique_ptr<Registration> search_, tracking_;
  std::unique_ptr<Registration> bending_;  // Nothing for a patient who does not move.
  PatientTracker tracker_;
  std::optional<WatchedPlace> place_;
  Eigen::Index place_point_ = 0;        // The tree's point that is nearest to the place.
  std::unique_ptr<LocalShift> nearby_;  // Nothing where the image around the place is not asked.
};

}  // namespace angio
