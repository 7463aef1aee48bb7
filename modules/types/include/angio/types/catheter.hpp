// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "angio/types/model_id.hpp"

namespace angio::types {

/// The drive of a catheter as its encoders and its force sensor read it, all at the base.
struct CatheterState {
  std::int64_t time_us = 0;            ///< When it was read, sender's monotonic clock [us].
  std::int64_t sequence = 0;           ///< Rises by one per message.
  double insertion_m = 0;              ///< Length that the drive has pushed in, from its zero.
  double roll_rad = 0;                 ///< Clockwise as seen from the base towards the tip, not wrapped.
  double bend_rad = 0;                 ///< Of a steerable tip, from straight.
  double insertion_speed_m_per_s = 0;  ///< [m/s]
  double roll_speed_rad_per_s = 0;     ///< [rad/s]
  double bend_speed_rad_per_s = 0;     ///< [rad/s]
  double insertion_force_n = 0;        ///< With which the drive pushes (+) or pulls (-) [N].
};

/// Velocity command for a catheter's drive. The default stands still.
struct CatheterCommand {
  std::int64_t time_us = 0;            ///< Exposure time of the frame behind this command [us].
  std::int64_t sequence = 0;           ///< Rises by one per command.
  std::int64_t frame_sequence = 0;     ///< The frame it answers.
  std::int64_t valid_for_us = 0;       ///< How long it may be obeyed after it arrives [us]; silence means stop.
  double insertion_speed_m_per_s = 0;  ///< + pushes in [m/s].
  double roll_speed_rad_per_s = 0;     ///< + clockwise as seen from the base towards the tip [rad/s].
  double bend_speed_rad_per_s = 0;     ///< + bends a steerable tip further [rad/s].
};

enum class CatheterTipStatus : std::int8_t { kLost = 0, kAmbiguous = 1, kLocated = 2 };
constexpr int kCatheterTipStatusCount = 3;

/// Where a catheter's tip was seen in one frame. When it is lost, nothing but the reason counts.
struct CatheterTip {
  std::int64_t time_us = 0;              ///< Exposure time of the frame [us].
  std::int64_t frame_sequence = 0;       ///< The frame.
  ModelId model_id = ModelId::kUnknown;  ///< Of the tree that holds it.
  CatheterTipStatus status = CatheterTipStatus::kLost;
  Eigen::Vector3d tip_model = Eigen::Vector3d::Zero();   ///< In the model frame [m].
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Of the tip, model axes [m^2].
  std::int32_t branch = 0;                               ///< Index of VesselTree::branches().
  std::int32_t tree_point = 0;                           ///< Index of the tree's point nearest before the tip.
  double arc_length_m = 0;                               ///< From the tree's root, along the vessels.
  double probability = 0;                                ///< That the tip is in this branch.
  std::string reason;                                    ///< Why it is not located; empty when it is.
};

}  // namespace angio::types
