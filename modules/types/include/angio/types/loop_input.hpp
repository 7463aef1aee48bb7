// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/types/carm_motion.hpp"
#include "angio/types/catheter.hpp"
#include "angio/types/view_request.hpp"

namespace angio::types {

/// What a supervisor made of a frame and its answer. REFUSED: the frame was not even looked at; TAKEN_BACK: it was, but
/// no motion went out.
enum class ServoVerdict : std::int8_t { kPermitted = 0, kTakenBack = 1, kRefused = 2 };
constexpr int kServoVerdictCount = 3;

/// What the loop was given with one frame: a replay of a log asks for it.
struct ServoInput {
  std::int64_t time_us = 0;         ///< Exposure time of the frame [us].
  std::int64_t frame_sequence = 0;  ///< The frame.
  CArmState state;                  ///< The joints as the loop believed them to be at the exposure.
  ServoVerdict verdict = ServoVerdict::kPermitted;
  ViewRequest view = {};  ///< The view that was asked for by then.
};

/// What a catheter's loop was given with one frame: a replay of a log asks for it.
struct CatheterInput {
  std::int64_t time_us = 0;         ///< Exposure time of the frame [us].
  std::int64_t frame_sequence = 0;  ///< The frame.
  ServoVerdict verdict = ServoVerdict::kPermitted;
  CArmState arm;                     ///< The joints as the loop believed them to be at the exposure.
  CatheterState drive;               ///< The drive as it was then.
  std::int64_t view_reached_us = 0;  ///< ViewRequest::time_us of the request that the C-arm had reached; 0: none.
};

}  // namespace angio::types
