// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/localisation/catheter_localiser.hpp"
#include "path_match.hpp"
#include "place_grid.hpp"

namespace angio::localisation {

/// A place and how probable it is.
struct Reach {
  int place = 0;
  double probability = 0;
};

/// How far a tip gets from one frame to the next.
class TipMotion {
 public:
  /// A `motion` whose numbers are not finite, or whose period is not positive, is taken as one of the longest doubt: a
  /// second without news.
  TipMotion(const LocaliserSettings& settings, const PlaceGrid& grid, const CatheterMotion& motion);

  /// Where a tip may be that was at `from`; adds up to 1. Ahead, each branch of a bifurcation is as likely as the
  /// others. Borrowed until the next call.
  const std::vector<Reach>& from(int from);

 private:
  void descend(int place, double back_m, double ahead_m, double share, int except);
  void add(int place, double back_m, double ahead_m, double share);

  const PlaceGrid& grid_;
  double mean_m_ = 0, std_m_ = 0, lowest_m_ = 0, highest_m_ = 0;
  std::vector<Reach> reached_;
};

/// How the curve of one frame looks from one place.
struct Candidate {
  int place = 0;
  bool tip_is_last = true;
  PathMatch match;
};

/// What became of one frame.
struct FrameOutcome {
  bool used = false;                  ///< Its curve has changed the probabilities.
  std::string why;                    ///< What was wrong with it, or empty.
  std::optional<double> residual_px;  ///< Of the most probable place, where the curve could be compared at all.
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  double log_evidence = 0;  ///< Of a curve given all before it, up to a constant of its own; 0 when it is not used.
};

/// The forward pass over places: a probability and the image's shift for each.
class TipFilter {
 public:
  /// `centroid_m`: where in the model pixels per metre are taken.
  TipFilter(const LocaliserSettings& settings, PlaceGrid grid, const Eigen::Vector3d& centroid_m);

  void reset();
  void reset(int branch, double arc_m, double std_m);

  /// Time passes; the tip and the shift move.
  void predict(const CatheterMotion& motion);

  /// One frame is seen, after predict().
  FrameOutcome observe(const SeenCatheter& seen, const SeenPose& pose);

  /// The same by evidence that is there already.
  FrameOutcome observe(const TipEvidence& evidence);

  /// A belief over places whose probabilities add up to 1.
  TipBelief summarised(const std::vector<double>& probability) const;
  const std::vector<double>& probability() const { return probability_; }

  /// Of the last frame that said something; empty before.
  const std::vector<Candidate>& candidates() const { return candidates_; }
  const PlaceGrid& grid() const { return grid_; }
  const LocaliserSettings& settings() const { return settings_; }

 private:
  // The image's shift with the patient, without the registration's error [px].
  struct Shift {
    Eigen::Vector2d mean_px = Eigen::Vector2d::Zero();
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  };
  // What is known of a place's misfit before a frame is looked at.
  struct Expected {
    MisfitPrior prior;
    Eigen::Matrix2d total;  // Covariance of the shift, the registration's error included.
  };

  static void carry(Shift& to, double weight, const Shift& from);
  std::optional<std::string> project(const SeenPose& pose);
  void rescale(double px_per_m);
  Expected expected(int place, const SeenPose& pose) const;
  void collect(const SeenCatheter& seen, const SeenPose& pose, bool tip_is_last);
  double weigh(const SeenPose& pose);
  Eigen::Matrix2d stationary() const;
  void beginAtForks(std::vector<std::vector<std::pair<double, double>>>& known) const;

  LocaliserSettings settings_;
  PlaceGrid grid_;
  PathMatcher matcher_;
  Eigen::Vector3d centroid_m_;
  std::vector<double> branch_length_m_;
  std::vector<int> fork_of_branch_;  // The place in front of its first one; -1 where a root is.

  std::vector<double> probability_, next_probability_;
  std::vector<Shift> shift_, next_shift_;
  double px_per_m_ = 0;  // Of the last frame, about the tree's middle; 0 before the first.
  Eigen::Matrix2Xd projected_px_;
  Eigen::Matrix3Xd in_camera_m_;
  std::vector<Candidate> candidates_, collected_;
};

}  // namespace angio::localisation
