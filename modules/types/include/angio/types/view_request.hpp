// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "angio/types/model_id.hpp"

namespace angio::types {

/// A view that a catheter's controller asks the C-arm for. It is repeated until the C-arm says that it is there.
struct ViewRequest {
  std::int64_t time_us = 0;              ///< Exposure time of the frame behind it [us]; names the request. 0: none.
  std::int64_t sequence = 0;             ///< Rises by one per request.
  ModelId model_id = ModelId::kUnknown;  ///< Of the tree in whose frame it is asked.
  Eigen::Vector3d beam_model = Eigen::Vector3d::UnitZ();  ///< From the source to the detector, model axes, unit length.
  Eigen::Vector3d target_model = Eigen::Vector3d::Zero();  ///< The point that belongs at the isocentre [m].
  double within_rad = 0;                                   ///< The view is reached when the beam is as near as this ...
  double within_m = 0;                                     ///< ... and the target.
  std::string reason;                                      ///< Why it is asked for, in words.
};

}  // namespace angio::types
