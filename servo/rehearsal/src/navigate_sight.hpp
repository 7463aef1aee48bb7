// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <random>

#include "angio/imaging/extractor.hpp"
#include "angio/navigation/catheter_loop.hpp"
#include "angio/navigation/view_planner.hpp"
#include "angio/registration/starts.hpp"
#include "angio/rehearsal/navigate_study.hpp"

namespace angio {

/// The X-ray of a journey: where the C-arm stands, and what a frame shows of catheter and vessels.
class NavigateSight {
 public:
  /// Stands nowhere before the first turnTo().
  NavigateSight(const VesselTree& tree, const NavigateStudySettings& study, const NavigateParts& parts,
                std::uint64_t seed);
  ~NavigateSight();

  /// Views that the C-arm can reach.
  static BestViewScene reachable();

  /// Turns the C-arm, and the table with it; until the next roadmap only calibration says where the model is.
  /// @return  How long that takes [s].
  double turnTo(const PlannedView& view);

  /// The catheter in frame `k` at a time [s], as `loop` sees it; nothing when it is not seen, as on a roadmap.
  std::optional<CatheterTrace> look(const SimulatedCatheter& catheter, CatheterLoop& loop, std::int64_t k,
                                    double time_s);

  /// The last frame; empty without images.
  const cv::Mat& image() const { return image_; }

  /// Where the model is, as the last roadmap says.
  const SeenPose& pose() const { return pose_; }

 private:
  double normal();
  std::optional<CatheterTrace> projected(const SimulatedCatheter& catheter);
  std::optional<CatheterTrace> traced(const SimulatedCatheter& catheter, CatheterLoop& loop, std::int64_t k,
                                      double time_s);
  void registerRoadmap(const Centerline2d& seen);

  const VesselTree& tree_;
  NavigateStudySettings study_;
  std::uint64_t seed_;
  int views_ = 0;
  ViewAngles view_;
  Pose T_camera_model_ = Pose::Identity();  // The truth.
  SeenPose pose_;
  std::mt19937_64 random_;
  std::unique_ptr<SimulatedPatient> patient_;  // The rest with images only.
  std::unique_ptr<CenterlineExtractor> extractor_;
  std::unique_ptr<Registration> registration_;
  cv::Mat image_;
  std::optional<double> roadmap_at_s_;
  bool registered_ = false;
};

}  // namespace angio
