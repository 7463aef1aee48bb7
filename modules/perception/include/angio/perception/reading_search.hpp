// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "angio/perception/image_reading.hpp"
#include "angio/perception/perception.hpp"
#include "angio/perception/registration_gate.hpp"

namespace angio::perception {

/// Finds how frames have been mirrored or turned when none of them has registered since the beginning: the curves of
/// one frame are registered in each of the other readings, and what passes the gate and agrees best is told.
///
/// It begins with the fifth frame that shows curves and is not accepted, and again with the tenth, the twentieth and so
/// on, for a contrast agent that comes late. After the first frame that is accepted it never begins again. One call
/// tries one reading, which takes as long as one search does. The same frames give the same advice.
class ReadingSearch {
 public:
  /// A frame that was not accepted.
  void reject(const Observation& seen, const XrayCamera& camera, const CameraPlace& place);

  /// A frame that was accepted: frames come as they should.
  void accept();

  /// Tries the next reading of the frame that is looked at; nothing when none is.
  void tryNext(Perception& perception, const RegistrationGate& gate);

  /// The reading that matches; nothing when none does, or it is not known yet.
  std::optional<ImageReading> match() const { return match_; }

  /// "the image matches when mirrored left to right: send it as xray_frame_t wants it"; nothing without a match.
  std::optional<std::string> advice() const;

 private:
  struct Trial {
    Centerline2d curves;
    XrayCamera camera;
    CameraPlace place;
    std::vector<ImageReading> readings;
    std::size_t next = 0;
    double best_score = 0;
    std::optional<ImageReading> best = std::nullopt;
  };

  bool settled_ = false;
  int rejected_ = 0;
  std::optional<Trial> trial_;
  std::optional<ImageReading> match_;
};

}  // namespace angio::perception
