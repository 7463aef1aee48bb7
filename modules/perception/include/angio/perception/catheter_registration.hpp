// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "angio/localisation/sequence_localiser.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/registration/registration.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::perception {

/// A frame's registration by the catheter that it shows.
struct RegisteredByCatheter {
  /// Of `vessels`. Its displacements are of the whole tree: where the run has bent it, and this frame.
  RegistrationResult result;
  VesselTree vessels;            ///< From where the curve comes in to its tip, as the run has bent them, model frame.
  std::vector<int> tree_points;  ///< Of each point of `vessels`, its index in the tree.
  std::optional<std::string> rejection;  ///< Why the result must not be followed; nothing when it may.
};

/// Registers a tree by a catheter inside its vessels, frame by frame.
///
/// One curve explains little of a dense tree, and fits it in several places: no single frame says where the tree is.
/// The frames of a run do together, since their curves must all lead from a root through connected vessels
/// (localiseSequence()). From 4 frames on they are localised, and again whenever they have doubled, the newest 32 of
/// them at most; of frames that follow each other within 0.4 s the first counts. The answer is kept when it explains
/// all frames and no other place nearby, of those that shifted starts lead to, explains them nearly as well. From then
/// on a frame is registered to the vessels that its curve lies in, alone, pose and deformation in one posterior
/// (`oriented_kernel`, nonrigid): the image's directions are known then, and the depth as well as the covariance says.
/// Of a place beside these vessels the frame says the less the further off it is, and its covariance says so.
class CatheterRegistration {
 public:
  /// @param rounds_at_once  How many rounds of localising the run learn() goes through in a call; 0: as many as it
  ///                        takes. All of them took 1.1 s for four frames of the clinical run, whose poses are 35 mm
  ///                        off, 0.6 s for each start aside of the answer, and 4.5 s for 32 frames.
  /// Throws InputError when a setting is out of its range.
  CatheterRegistration(const OrientedKernelSettings& method, const VesselTree& tree, int rounds_at_once = 0);

  /// Takes the next frame of the run.
  ///
  /// @param T_camera_model  As joints and calibration say, or a nominal pose: what is wrong with it must be the same in
  ///                        all frames.
  /// @param time_us         Of the exposure. A run begins anew where time goes back.
  ///
  /// Returns nothing for a frame that shows more or less than one curve, whose tip is lost, or as long as what learn()
  /// has seen of the run leaves open where the catheter is.
  std::optional<RegisteredByCatheter> observe(const XrayView& view, const Pose& T_camera_model, std::int64_t time_us);

  /// Localises the frames of the run together, where that is due, or goes on with it. To be called after each
  /// observe(), when what the frame was wanted for is out: all rounds together may take some seconds.
  void learn();

  /// Whether the run has said which vessels the catheter lies in.
  bool pinned() const { return pinned_.has_value(); }

 private:
  // What the run so far has pinned.
  struct Pinned {
    Pose correction = Pose::Identity();  // On the right of a frame's pose.
    VesselTree bent;                     // The tree as its frames have it, model frame.
    TreeTopology map;                    // Of that.
    CatheterLocaliser localiser;         // In that.
  };

  // The run is being localised, and then from starts aside of the answer.
  struct Learning {
    std::vector<SequenceFrame> frames;
    SequenceLocaliser localiser;
    std::optional<SequenceResult> found = {};
    std::size_t aside = 0;  // How many of these have been gone through.
    int kept = 0;           // Frames that had been kept when it began.
  };

  bool learnRound();
  void pin(const Learning& learnt);
  std::optional<RegisteredByCatheter> registered(const XrayView& view, const SequenceFrame& frame,
                                                 const TipBelief& belief) const;

  OrientedKernelSettings method_;
  VesselTree tree_;
  int rounds_at_once_;
  std::deque<SequenceFrame> frames_;        // The newest of those that are localised together.
  int kept_ = 0;                            // Frames that have been among them.
  bool due_ = false;                        // Whether they are to be localised.
  std::int64_t kept_us_ = 0, last_us_ = 0;  // Times of the newest of them, and of the newest frame.
  std::optional<Learning> learning_;
  std::optional<Pinned> pinned_;
};

/// Returns the result for who goes by its pose alone, wherever in the tree: it says what it is of, with as much added
/// to the covariance of the translation as a tree may be bent by where no curve shows it (5 mm per axis).
RegistrationResult ofWholeTree(const RegisteredByCatheter& by);

/// Returns where a frame that its catheter registers shows the model: a pose that has `p_model` where the frame's bent
/// vessels have it, with what is known of that point. The result must have a covariance.
PatientObservation observationAt(const Eigen::Vector3d& p_model, const RegisteredByCatheter& by,
                                 const VesselTree& tree);

}  // namespace angio::perception
