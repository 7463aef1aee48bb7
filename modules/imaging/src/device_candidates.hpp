// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "seen_lines.hpp"

namespace angio::imaging {

/// Lines that a run shows without contrast agent, and where they are now: devices, as a patient's breath, heartbeat and
/// bending move them.
class DeviceCandidates {
 public:
  /// Forgets all.
  void clear();

  /// Moves the candidates with the lines of the next frame: by a shift, and by the affine map that brings them and what
  /// the frame before showed nearest to what this one shows.
  void follow(const SeenLines& seen);

  /// Whether the last frames showed hardly any of what most showed without contrast agent: the C-arm or the table has
  /// moved, or the device is gone.
  bool lost() const;

  /// Takes note of a frame without contrast agent, after it has been followed: what it shows again, and what for the
  /// first time. Lines that are short, or wider than a catheter, are none. `side` is the image's [working px].
  void learn(const SeenLines& seen, double side);

  /// Drops lines that absorb more in this frame than they did without contrast agent: vessels with a rest of it. It is
  /// for frames after an injection, in which a rest is the same all along a vessel. Before one, vessels fill around a
  /// device, and all of it may be darker when much shows.
  void dropDarkened(const SeenLines& seen);

  /// The points that most frames without contrast agent have shown, line by line, where they are now; radius and
  /// contrast are means over those frames.
  std::vector<SeenPoint> steady() const;

 private:
  struct Candidate : SeenPoint {
    double times_seen = 0;
  };

  bool isSteady(const Candidate& candidate) const;
  void addNew(const SeenLines& seen, double side);
  void forgetOld();
  double shareIn(const SeenLines& seen) const;

  std::vector<Candidate> candidates_;
  std::vector<SeenPoint> before_;  // What the last frame showed.
  double frames_ = 0;              // Without contrast agent; old ones count less.
  int lines_ = 0, frames_lost_ = 0;
};

}  // namespace angio::imaging
