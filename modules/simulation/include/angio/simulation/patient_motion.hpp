// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/simulation/motion_settings.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// How a patient's inside moves: a smooth field of displacement, known at every point and time, and the same whenever
/// it is asked. At time 0 nothing has moved, but for what deforms the tree at all times.
class PatientMotion {
 public:
  /// @param center_model  The tree's centroid, model frame [m]. @param R_lps_model  Axes L, P, S from the model's.
  /// Throws InputError when a setting is out of its range.
  PatientMotion(const MotionSettings& settings, const Eigen::Vector3d& center_model, const Eigen::Matrix3d& R_lps_model,
                std::uint64_t seed);

  /// Displacement by breathing, heartbeat and deformation of what is at `p_model` [m] when nothing moves, model axes
  /// [m].
  Eigen::Vector3d displacement(const Eigen::Vector3d& p_model, double time_s) const;

  /// The same of 3 x N points.
  Eigen::Matrix3Xd displacements(const Eigen::Matrix3Xd& points_model, double time_s) const;

  /// Drift and sudden shift of the whole patient: where the model frame has gone, seen from where it was at time 0 [m].
  Pose shift(double time_s) const;

  /// Whether anything ever moves.
  bool moves() const;

 private:
  // How far the diaphragm is towards the feet and to the front [m].
  struct Breath {
    double down_m, forward_m;
  };
  Breath breath(double time_s) const;
  double lung(double time_s) const;
  double systole(double time_s) const;

  MotionSettings settings_;
  Eigen::Vector3d center_model_;
  Eigen::Matrix3d R_lps_model_;
  std::uint64_t seed_;
  struct Wave {
    Eigen::Vector3d amplitude_m, number_per_m;
    double phase_rad;
  };
  std::vector<Wave> deformation_;
};

}  // namespace angio::simulation
