// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <random>

#include "angio/imaging/extractor.hpp"
#include "angio/localisation/catheter_localiser.hpp"
#include "angio/registration/starts.hpp"
#include "angio/rehearsal/navigate_study.hpp"

namespace angio {

/// The X-ray of a journey: where the C-arm stands, and what a frame shows of catheter and vessels.
class NavigateSight {
 public:
  NavigateSight(const VesselTree& tree, const TreeMap& map, const TreePlace& target, const NavigateStudySettings& study,
                const SimulatedPatientSettings& patient, std::uint64_t seed);
  ~NavigateSight();

  /// The catheter in frame `k` at a time [s]; nothing when it is not seen, as on a roadmap. `expected_tip` is where its
  /// tip was last believed, model frame [m].
  std::optional<SeenCatheter> look(const SimulatedCatheter& catheter, const Eigen::Vector3d& expected_tip,
                                   std::int64_t k, double time_s);

  /// Where the model is, as the last roadmap says.
  const SeenPose& pose() const { return pose_; }

 private:
  double normal();
  std::optional<SeenCatheter> projected(const SimulatedCatheter& catheter);
  std::optional<SeenCatheter> extracted(const SimulatedCatheter& catheter, const Eigen::Vector3d& expected_tip,
                                        std::int64_t k, double time_s);
  void registerRoadmap(const Centerline2d& seen);
  Centerline2d onRoadmap(const Centerline2d& seen) const;

  const VesselTree& tree_;
  NavigateStudySettings study_;
  Eigen::Matrix3Xd way_;  // Points of the way and of what leaves it, model frame [m].
  Pose T_camera_model_;   // The truth.
  SeenPose pose_;
  std::mt19937_64 random_;
  std::unique_ptr<SimulatedPatient> patient_;  // The rest with images only.
  std::unique_ptr<CenterlineExtractor> extractor_;
  std::unique_ptr<Registration> registration_;
  std::optional<double> roadmap_at_s_;
};

}  // namespace angio
