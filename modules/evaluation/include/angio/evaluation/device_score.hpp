// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/evaluation/namespace.hpp"
#include "angio/results/record_row.hpp"
#include "angio/results/statistics.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::evaluation {

/// How well devices are told from vessels, over frames that show a device. Lengths are counted every pixel.
class DeviceScore {
 public:
  /// Adds a frame. Points of `found` within `tolerance_px` of a true line are that line's.
  /// @param shown  The lines of the devices and of the vessels that can be seen, by kind.
  void add(const Centerline2d& found, const Centerline2d& shown, double tolerance_px);
  void add(const DeviceScore& other);

  bool any() const { return frames_ > 0; }

  /// Frames that show a device over kMinShown_px at least ("frames"), the part of them in which at least half of that
  /// is told as one ("named"), the part of the devices' length that is ("told"), that is found and taken for a vessel
  /// ("taken_for_vessel"), and of what is found of vessels away from devices the part that is called a device
  /// ("vessels_called_device").
  Json asJson() const;

  static constexpr double kMinShown_px = 40;

  template <typename Fields>
  friend void visitRow(Fields& f, RecordOf<Fields, DeviceScore>& score) {
    f("frames", score.frames_);
    f("named", score.named_);
    f("shown", score.shown_);
    f("told", score.told_);
    f("taken_for_vessel", score.taken_);
    f("vessels", score.vessels_);
    f("vessels_called_device", score.called_);
  }

 private:
  int frames_ = 0, named_ = 0;
  double shown_ = 0, told_ = 0, taken_ = 0, vessels_ = 0, called_ = 0;
};

}  // namespace angio::evaluation
