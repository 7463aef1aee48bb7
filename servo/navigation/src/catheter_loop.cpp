// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_loop.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/checked.hpp"

namespace angio::navigation {
namespace {

constexpr double kUsualPeriod_s = 1.0 / 15;
constexpr double kSpring_m = 0.4e-3, kSpringOfPush = 0.5;  // Of the tip of an elastic catheter: it sticks and springs.
constexpr double kLooseFaults = 0.14;                      // Of frames of such a tip; seeds 1-3 of the liver had 8 %.
constexpr double kLoose = 0.4;                             // Looseness from which frames may be wrong so.
constexpr double kMaxPeriod_s = 0.2;  // A longer gap is no time in which doubt could have been cleared up.

}  // namespace

CatheterLoop::CatheterLoop(const VesselTree& tree, const TreeLocation& start, const TreeLocation& target,
                           const CatheterLoopSettings& settings)
    : settings_(checked("catheter loop", settings)),
      navigator_(tree, target, settings.navigator),
      tracer_(tree, settings.tracer),
      localiser_(settings.localiser, tree) {
  localiser_.reset(start.branch, start.arc_m, 1e-3 * settings.start_std_mm);
}

std::optional<CatheterTrace> CatheterLoop::findCatheter(const cv::Mat& image, const SeenPose& pose) {
  return tracer_.trace(image, pose, belief(), navigator_.tipOffset());
}

CatheterReport CatheterLoop::step(const CatheterFrame& frame, const std::optional<CatheterTrace>& trace) {
  CatheterReport report;
  report.trace = trace;
  NavigationInput& input = report.input;
  input.time_us = frame.time_us;
  input.frame_sequence = frame.sequence;
  input.drive = frame.drive;
  const double passed_s = last_us_ ? 1e-6 * static_cast<double>(frame.time_us - *last_us_) : kUsualPeriod_s;
  input.period_s = std::clamp(passed_s, 0.0, kMaxPeriod_s);
  input.latency_s = 1e-3 * settings_.latency_ms;
  const double pushed_m = frame.drive.insertion_m - last_insertion_m_.value_or(frame.drive.insertion_m);
  const double loose = navigator_.looseness();
  const CatheterMotion motion{input.period_s, pushed_m, loose * (kSpring_m + kSpringOfPush * std::abs(pushed_m)),
                              kLooseFaults * std::max(loose - kLoose, 0.0) / (1 - kLoose)};
  last_us_ = frame.time_us;
  last_insertion_m_ = frame.drive.insertion_m;
  input.belief = !trace                           ? localiser_.predict(motion)
                 : trace->evidence.places.empty() ? localiser_.update(trace->seen, frame.pose, motion)
                                                  : localiser_.update(trace->evidence, motion);
  if (trace) {
    const TipPlace& tip = input.belief->tip;
    input.deflection = seenDeflection(trace->seen, frame.pose.camera, frame.pose.T_camera_model, navigator_.map(),
                                      {tip.branch, tip.arc_m}, 1e-3 * settings_.navigator.tip_length_mm);
  }
  report.answer = navigator_.step(input);
  return report;
}

}  // namespace angio::navigation
