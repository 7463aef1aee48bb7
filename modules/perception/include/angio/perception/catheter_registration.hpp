// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "angio/localisation/sequence_localiser.hpp"
#include "angio/perception/namespace.hpp"
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
/// them at most. The answer is kept when it explains all frames and no other place nearby, of those that shifted starts
/// lead to, explains them nearly as well. From then on a frame is registered to the vessels that its curve lies in,
/// alone, pose and deformation in one posterior (`oriented_kernel`, nonrigid): the image's directions are known then,
/// and the depth as well as the covariance says.
class CatheterRegistration {
 public:
  /// Throws InputError when a setting is out of its range.
  CatheterRegistration(const OrientedKernelSettings& method, const VesselTree& tree);

  /// Takes the next frame of the run.
  ///
  /// @param T_camera_model  As joints and calibration say, or a nominal pose: what is wrong with it must be the same in
  ///                        all frames.
  /// @param period_s        Since the frame before [s].
  ///
  /// Returns nothing for a frame that shows more or less than one curve, whose tip is lost, or as long as the run
  /// leaves open where the catheter is.
  std::optional<RegisteredByCatheter> observe(const XrayView& view, const Pose& T_camera_model, double period_s);

 private:
  // What the run so far has pinned.
  struct Pinned {
    Pose correction = Pose::Identity();  // On the right of a frame's pose.
    VesselTree bent;                     // The tree as its frames have it, model frame.
    TreeTopology map;                    // Of that.
    CatheterLocaliser localiser;         // In that.
  };

  std::optional<TipBelief> learn();
  bool standsAlone(const std::vector<SequenceFrame>& frames, const SequenceResult& found) const;
  std::optional<RegisteredByCatheter> registered(const XrayView& view, const SequenceFrame& frame,
                                                 const TipBelief& belief) const;

  OrientedKernelSettings method_;
  VesselTree tree_;
  std::deque<SequenceFrame> frames_;  // The newest.
  int seen_ = 0;
  std::optional<Pinned> pinned_;
};

}  // namespace angio::perception
