// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "angio/imaging/extractor.hpp"

namespace angio::imaging {

/// Tells devices from vessels in the frames of one run by what came before: a vessel appears with the contrast agent, a
/// catheter or guidewire was there.
///
/// Lines that stand in most frames without contrast agent are followed from frame to frame, and once it has arrived,
/// what runs along them and absorbs no more per length than they did is a device. Where a vessel has filled around a
/// device, the line found is the vessel's, and the device gets one of its own, where it was followed to.
///
/// It knows nothing before contrast agent arrives, nor in a run that begins later, nor of a device that comes in later:
/// what is found then stays as it is. Frames may lie so far apart in time that lines move by a sixtieth of the image's
/// side. Where it loses what it follows, as when the C-arm or the table moves, it begins anew.
///
/// Memory: the points of one frame and of the lines without contrast agent, some hundred kilobytes. Time: some 2 ms a
/// frame.
class DeviceHistory {
 public:
  DeviceHistory();
  ~DeviceHistory();
  DeviceHistory(DeviceHistory&&) noexcept;
  DeviceHistory& operator=(DeviceHistory&&) noexcept;

  /// The lines of the run's next frame with what they are; branches are cut where that changes. `found` is what an
  /// extractor found [px]; what it names a device stays one. One without kinds, radii or contrasts comes back as it is.
  /// @param side_px  The image's shorter side.
  Centerline2d named(const Centerline2d& found, double side_px);

  /// Frames of the run from before contrast agent arrived, in their order, named by what is known now, when the last
  /// frame given to named() followed them. As they are where none has arrived.
  std::vector<Centerline2d> namedAgain(std::vector<Centerline2d> frames, double side_px) const;

  /// The frames of a run up to its end, in their order, named by what stands when contrast agent has gone, for runs in
  /// which none arrives: they begin while vessels fill or are full. `frames` as given to named(). They come back as
  /// they are where the run ends before contrast agent has gone.
  static std::vector<Centerline2d> namedFromEnd(std::vector<Centerline2d> frames, double side_px);

  /// Whether contrast agent has arrived in this run: before, nothing is named.
  bool knowsVessels() const;

 private:
  struct Memory;
  std::unique_ptr<Memory> memory_;
};

/// An extractor for the frames of one run, in their order: with a DeviceHistory. Throws as makeExtractor.
std::unique_ptr<CenterlineExtractor> makeRunExtractor(const ExtractorSettings& settings);

}  // namespace angio::imaging
