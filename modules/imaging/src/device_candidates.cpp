// SPDX-License-Identifier: GPL-2.0-or-later
#include "device_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "quantile.hpp"

namespace angio::imaging {
namespace {

// A line is seen again within so much of where it is expected [working px].
constexpr double kSeenAgain_px = 3;
// Shorter lines are no devices [working px], nor are wider ones [sides]: catheters have radii of 3.8 of 512 pixels and
// less (see catheters.cpp).
constexpr double kMinLength_px = 25, kMaxRadius = 0.0086;
// A device is in this part of the frames without contrast agent.
constexpr double kInMost = 0.6;
// With more frames than this the older half counts half as much; what is in less than this part of them goes.
constexpr double kMaxFrames = 32, kSeldom = 0.1;
// Lines that absorb so many times more than before have more contrast agent in them; noise and overlap change them by a
// third.
constexpr double kDarkened = 1.4;
// With less than this part in so many frames in a row they are lost.
constexpr double kLost = 0.25;
constexpr int kFramesLost = 3;
// From frame to frame lines move by no more than this along either axis; shifts are tried at this step [working px].
constexpr int kMaxShift_px = 12, kShiftStep_px = 3;
// Points that shifts are tried with, at most, and what a shift costs at the reach, in points that match.
constexpr std::size_t kMaxTried = 200;
constexpr double kShiftCost = 0.05;

// The shift that brings points nearest to lines.
Eigen::Vector2d shiftOnto(const SeenLines& seen, const std::vector<LinePoint>& points) {
  const std::size_t step = points.size() / kMaxTried + 1;
  const double cost = kShiftCost * static_cast<double>(points.size() / step) / kMaxShift_px;
  double best = -1;
  Eigen::Vector2d best_shift = Eigen::Vector2d::Zero();
  for (int y = -kMaxShift_px; y <= kMaxShift_px; y += kShiftStep_px) {
    for (int x = -kMaxShift_px; x <= kMaxShift_px; x += kShiftStep_px) {
      const Eigen::Vector2d shift(x, y);
      double score = -cost * shift.norm();
      for (std::size_t i = 0; i < points.size(); i += step) {
        const LinePoint moved{points[i].at + shift, points[i].direction};
        const int near = seen.along(moved, kSeenAgain_px);
        if (near < 0) continue;
        const double off = (seen.points()[static_cast<std::size_t>(near)].at - moved.at).norm() / kSeenAgain_px;
        score += 1 - off * off;
      }
      if (score > best) {
        best = score;
        best_shift = shift;
      }
    }
  }
  return best_shift;
}

}  // namespace

void DeviceCandidates::clear() {
  candidates_.clear();
  frames_ = 0;
  frames_lost_ = 0;
}

bool DeviceCandidates::lost() const { return frames_lost_ >= kFramesLost; }

bool DeviceCandidates::isSteady(const Candidate& candidate) const { return candidate.times_seen >= kInMost * frames_; }

void DeviceCandidates::follow(const SeenLines& seen) {
  const std::vector<SeenPoint> before = std::exchange(before_, seen.points());
  std::vector<LinePoint> tried(before.begin(), before.end());
  for (const Candidate& candidate : candidates_) {
    if (isSteady(candidate)) tried.push_back(candidate);
  }
  if (candidates_.empty() || tried.empty()) return;
  const Eigen::Vector2d shift = shiftOnto(seen, tried);
  for (LinePoint& point : tried) point.at += shift;
  std::vector<Eigen::Vector2d> points;
  for (Candidate& candidate : candidates_) points.emplace_back(candidate.at += shift);
  const AffineMove move = AffineMove::onto(seen.placed(), tried, points);
  for (Candidate& candidate : candidates_) candidate.at += move.by(candidate.at);
  frames_lost_ = shareIn(seen) < kLost ? frames_lost_ + 1 : 0;
}

double DeviceCandidates::shareIn(const SeenLines& seen) const {
  double steady = 0, found = 0;
  for (const Candidate& candidate : candidates_) {
    if (!isSteady(candidate)) continue;
    ++steady;
    found += seen.along(candidate, kSeenAgain_px) >= 0 ? 1 : 0;
  }
  return steady > 0 ? found / steady : 1;
}

void DeviceCandidates::addNew(const SeenLines& seen, double side) {
  PlacedLines known;
  for (const Candidate& candidate : candidates_) known.add(candidate);
  known.place();
  for (const SeenLines::Range& line : seen.lines()) {
    if (seen.length(line) < kMinLength_px || seen.radius(line) > kMaxRadius * side) continue;
    ++lines_;
    for (std::size_t i = line.begin; i < line.end; ++i) {
      Candidate candidate{seen.points()[i]};
      candidate.line = lines_;
      if (known.along(candidate, kSeenAgain_px) < 0) candidates_.push_back(candidate);
    }
  }
}

void DeviceCandidates::forgetOld() {
  frames_ *= 0.5;
  for (Candidate& candidate : candidates_) candidate.times_seen *= 0.5;
  const auto seldom = [&](const Candidate& candidate) { return candidate.times_seen < kSeldom * frames_; };
  candidates_.erase(std::remove_if(candidates_.begin(), candidates_.end(), seldom), candidates_.end());
}

void DeviceCandidates::learn(const SeenLines& seen, double side) {
  addNew(seen, side);
  for (Candidate& candidate : candidates_) {
    const int near = seen.along(candidate, kSeenAgain_px);
    if (near < 0) continue;
    const SeenPoint& point = seen.points()[static_cast<std::size_t>(near)];
    const double part = 1 / ++candidate.times_seen;
    candidate.contrast += part * (point.contrast - candidate.contrast);
    candidate.radius += part * (point.radius - candidate.radius);
  }
  if (++frames_ > kMaxFrames) forgetOld();
}

void DeviceCandidates::dropDarkened(const SeenLines& seen) {
  std::map<int, std::vector<float>> ratios;
  for (const Candidate& candidate : candidates_) {
    const int near = seen.along(candidate, kSeenAgain_px);
    if (near < 0) continue;
    const SeenPoint& point = seen.points()[static_cast<std::size_t>(near)];
    ratios[candidate.line].push_back(static_cast<float>(point.absorbed() / candidate.absorbed()));
  }
  std::set<int> darkened;
  for (const auto& [line, of_line] : ratios) {
    if (medianOf(of_line) > kDarkened) darkened.insert(line);
  }
  const auto hasDarkened = [&](const Candidate& candidate) { return darkened.count(candidate.line) > 0; };
  candidates_.erase(std::remove_if(candidates_.begin(), candidates_.end(), hasDarkened), candidates_.end());
}

std::vector<SeenPoint> DeviceCandidates::steady() const {
  std::vector<SeenPoint> steady;
  for (const Candidate& candidate : candidates_) {
    if (isSteady(candidate)) steady.push_back(candidate);
  }
  return steady;
}

}  // namespace angio::imaging
