// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/localisation/catheter_localiser.hpp"
#include "angio/navigation/catheter_tracer.hpp"
#include "angio/navigation/navigator.hpp"

namespace angio::navigation {

/// The parts of a catheter's loop.
struct CatheterLoopSettings {
  /// The drive says how far it has pushed: the tip hardly moves otherwise. A frame's errors (a deflection, a bend) stay
  /// for many frames, so that a tip which may wander follows them. Places must be as near to each other as it moves.
  static LocaliserSettings besideDrive() {
    LocaliserSettings localiser;
    localiser.spacing_mm = 0.25;
    localiser.backlash_mm = 0.1;
    localiser.min_probability = 0.8;
    return localiser;
  }

  NavigatorSettings navigator;
  CatheterTracerSettings tracer;
  LocaliserSettings localiser = besideDrive();
  static constexpr double start_std_mm = 5;  ///< Of the place where the tip is said to be at first.
  double latency_ms = 80;

  void visit(SettingsVisitor& v) {
    v.section("navigator", [this](SettingsVisitor& s) { navigator.visit(s); });
    v.section("tracer", [this](SettingsVisitor& s) { tracer.visit(s); });
    v.section("localiser", [this](SettingsVisitor& s) { localiser.visit(s); });
    v.number("latency_ms", latency_ms, 0, 1000, "Time from an exposure until its command moves the drive");
  }
};

/// One exposure, as the loop hears of it.
struct CatheterFrame {
  std::int64_t time_us = 0;  ///< Of the exposure, sender's monotonic clock.
  std::int64_t sequence = 0;
  SeenPose pose;        ///< Where the model is.
  CatheterState drive;  ///< At the exposure.
};

/// What the loop made of one frame.
struct CatheterReport {
  std::optional<CatheterTrace> trace;  ///< Nothing where no catheter was seen.
  NavigationInput input;               ///< The belief with all that the navigator decided by.
  NavigationAnswer answer;
};

/// One X-ray frame of a catheter becomes one command for its drive: trace, belief, decision. Knows neither clock nor
/// bus; the same frames give the same commands.
class CatheterLoop {
 public:
  /// Radii that the tree does not know count as 1 mm. Throws InputError when a setting is out of its range, or a place
  /// is none of the tree's.
  CatheterLoop(const VesselTree& tree, const TreeLocation& start, const TreeLocation& target,
               const CatheterLoopSettings& settings);

  /// The catheter in a frame, looked for where it is believed to be. Throws as CatheterTracer does.
  std::optional<CatheterTrace> findCatheter(const cv::Mat& image, const SeenPose& pose);

  /// Answers a frame in which the catheter was seen like that, or not. A trace without evidence is only a curve.
  CatheterReport step(const CatheterFrame& frame, const std::optional<CatheterTrace>& trace);

  const TipBelief& belief() const { return localiser_.belief(); }
  const Navigator& navigator() const { return navigator_; }

 private:
  CatheterLoopSettings settings_;
  Navigator navigator_;
  CatheterTracer tracer_;
  CatheterLocaliser localiser_;
  std::optional<std::int64_t> last_us_;
  std::optional<double> last_insertion_m_;
};

}  // namespace angio::navigation
