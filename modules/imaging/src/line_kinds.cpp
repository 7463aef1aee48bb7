// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_kinds.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "line_density.hpp"
#include "quantile.hpp"

namespace angio::imaging {
namespace {

// A line begins at the border when its end is so near to it [working px].
constexpr float kAtBorder = 9;

// Whether a point is so near to the border of the open part that a line which ends there comes in from outside.
bool atBorder(const cv::Point2f& p, const std::vector<RowRange>& open) {
  const int y = std::clamp(static_cast<int>(p.y + 0.5f), 0, static_cast<int>(open.size()) - 1);
  const auto lit = [&](int row) {
    return row >= 0 && row < static_cast<int>(open.size()) && open[row].begin < open[row].end &&
           p.x >= static_cast<float>(open[row].begin) && p.x < static_cast<float>(open[row].end);
  };
  const int reach = static_cast<int>(kAtBorder);
  return p.x - static_cast<float>(open[y].begin) < kAtBorder || static_cast<float>(open[y].end) - p.x < kAtBorder ||
         !lit(y - reach) || !lit(y + reach);
}

// Guidewires (0.36 mm) have fitted radii of 0.9 to 1.5 working pixels in 99 of 100 simulated images, the coronary
// arteries and livers beside them 1.6 and more in all that is longer than 30.
constexpr float kThin = 1.55f;
// Steel absorbs 1.9 to 6 times what contrast agent does, blur included; vessels beside wider ones are up to 1.7 times
// as dense, if they do not run along the beam, which changes along them.
constexpr float kWireDensity = 1.9f;
// Vessels as thin as that absorb less, also with undiluted contrast agent.
constexpr float kWireContrast = 0.07f;
// Lines that are this much wider tell what contrast agent absorbs.
constexpr float kWider = 1.3f;
// Shorter lines are pieces of anything [points].
constexpr std::size_t kMinWire = 33;
// So many of a wire's points have a radius, and a contrast, within this part of its median: a line that goes on along a
// vessel is not lost with it.
constexpr float kMaxShareOfWire = 0.7f, kEvenWire = 0.4f;

// A catheter's wall and the contrast agent in it, which no blood dilutes.
constexpr float kCatheterDensity = 1.5f;
// Radius and contrast of a catheter stay within this part of their own median; the contrast changes with the
// background's scatter and with what crosses.
constexpr float kEvenRadius = 0.2f, kEvenContrast = 0.4f;
// Values are medians over so many points, so that a crossing vessel does not end a catheter.
constexpr std::size_t kWindow = 33;
// Lines may end at a catheter, which touches the wall somewhere, or where it hides what it crosses.
constexpr int kMaxBranches = 3;
// What is left of a line after its catheter is a vessel if it is so long, else it belongs to the catheter.
constexpr std::size_t kRest = 22;

float medianWithin(const std::vector<float>& values, std::size_t from, std::size_t to) {
  return medianOf(std::vector<float>(values.begin() + static_cast<std::ptrdiff_t>(from),
                                     values.begin() + static_cast<std::ptrdiff_t>(to)));
}

bool isEven(const std::vector<float>& values, float median) {
  const auto near =
      std::count_if(values.begin(), values.end(), [&](float v) { return std::abs(v - median) <= kEvenWire * median; });
  return static_cast<float>(near) >= kMaxShareOfWire * static_cast<float>(values.size());
}

// A line's middling values.
struct LineProfile {
  float radius = 0, contrast = 0, density = 0;
  std::size_t length = 0;
};

LineProfile profileOf(const CentreLine& line, std::size_t count) {
  return {medianWithin(line.radius, 0, count), medianWithin(line.contrast, 0, count),
          medianOf(densitiesAlong(line, count)), count};
}

// Median density, by length, of the profiles that take part; 0 when they bring less than `length`.
template <typename TakesPart>
float densityOf(const std::vector<LineProfile>& profiles, std::size_t length, const TakesPart& takes_part) {
  std::vector<std::pair<float, std::size_t>> others;
  std::size_t total = 0;
  for (std::size_t l = 0; l < profiles.size(); ++l) {
    if (!takes_part(l)) continue;
    others.emplace_back(profiles[l].density, profiles[l].length);
    total += profiles[l].length;
  }
  if (total < std::max<std::size_t>(1, length)) return 0;
  std::sort(others.begin(), others.end());
  std::size_t passed = 0;
  for (const auto& [density, own] : others) {
    passed += own;
    if (2 * passed >= total) return density;
  }
  return 0;
}

bool isWire(const CentreLine& line, const LineProfile& own, const std::vector<LineProfile>& profiles) {
  if (own.length < kMinWire || own.radius > kThin || own.contrast < kWireContrast) return false;
  if (!isEven(line.radius, own.radius) || !isEven(line.contrast, own.contrast)) return false;
  const float wider =
      densityOf(profiles, own.length, [&](std::size_t other) { return profiles[other].radius > kWider * own.radius; });
  return wider > 0 && own.density > kWireDensity * wider;
}

void reverse(CentreLine& line) {
  std::reverse(line.line.begin(), line.line.end());
  for (auto* values : {&line.radius, &line.sigma, &line.contrast}) std::reverse(values->begin(), values->end());
}

// Points from the line's beginning on over which it is as even as a catheter.
std::size_t evenPart(const CentreLine& line, std::size_t shortest) {
  const std::size_t n = line.line.size();
  if (n < shortest || n < 2 * kWindow) return 0;
  const float radius = medianWithin(line.radius, 0, shortest), contrast = medianWithin(line.contrast, 0, shortest);
  std::size_t end = 0;
  for (std::size_t from = 0; from + kWindow <= n; from += kWindow / 4) {
    const std::size_t to = from + kWindow;
    if (std::abs(medianWithin(line.radius, from, to) - radius) > kEvenRadius * std::max(radius, 1.0f)) break;
    if (std::abs(medianWithin(line.contrast, from, to) - contrast) > kEvenContrast * contrast) break;
    end = to;
  }
  return n - end < kRest ? n : end;
}

// Lines that end at the side of the first `count` points.
int branchesOff(const std::vector<CentreLine>& lines, std::size_t own, std::size_t count) {
  const CentreLine& line = lines[own];
  int found = 0;
  for (std::size_t other = 0; other < lines.size(); ++other) {
    if (other == own || lines[other].kind == CurveKind::kDevice) continue;
    for (const cv::Point2f& end : {lines[other].line.front(), lines[other].line.back()}) {
      // Near the device's tip vessels begin.
      const std::size_t side = count - std::min(count, kWindow);
      for (std::size_t i = 0; i < side; ++i) {
        if (cv::norm(line.line[i] - end) > line.radius[i] + 2) continue;
        ++found;
        break;
      }
    }
  }
  return found;
}

// A catheter that is no denser than the vessels is told by its shape: as wide all along, over this many times the
// length that a dense one needs, with hardly anything that ends at it, and wide enough for its width to be seen
// [working px].
constexpr float kSteadyLength = 1.2f, kMinSteadyRadius = 2.2f;
// Nor is one wider than this part of `shortest`: the catheters of marked coronary angiograms have radii of 3.4 to 3.8
// of 512 pixels, arteries of the neck, which come in at the border and end at a wider one too, 4.6 and more.
constexpr float kMaxSteadyRadius = 0.0716f;
constexpr int kMaxCrossings = 1;
// The collimator's edge changes the width of the first points.
constexpr std::size_t kEdgePoints = 12;
// At its tip begins a vessel that is so much wider.
constexpr float kOstium = 1.25f;
// A vessel begins at a tip where its own end is so near [working px], beyond the radius.
constexpr float kTip = 5;

// Points from the line's beginning on over which it is as wide as a catheter: vessels taper.
std::size_t steadyPart(const CentreLine& line, std::size_t shortest) {
  const std::size_t n = line.line.size();
  if (n < kEdgePoints + shortest || n < kEdgePoints + 2 * kWindow) return 0;
  const float radius = medianWithin(line.radius, kEdgePoints, kEdgePoints + shortest);
  if (radius < kMinSteadyRadius || radius > kMaxSteadyRadius * static_cast<float>(shortest)) return 0;
  std::size_t end = 0;
  for (std::size_t from = kEdgePoints; from + kWindow <= n; from += kWindow / 4) {
    if (std::abs(medianWithin(line.radius, from, from + kWindow) - radius) > kEvenRadius * radius) break;
    end = from + (from + kWindow + kWindow / 4 <= n ? kWindow / 2 : kWindow);
  }
  return n - end < kRest ? n : end;
}

// Whether a wider vessel begins at the end of a line's first `part` points: the line's own rest, or another line, which
// ends there as well. What a branch ends at goes on to both sides.
bool endsAtOstium(const std::vector<CentreLine>& lines, std::size_t own, std::size_t part) {
  const CentreLine& line = lines[own];
  const float width = medianWithin(line.radius, part - std::min(part, 2 * kWindow), part);
  // The tip lies some way within the vessel.
  const auto widens = [&](const std::vector<float>& radius, std::size_t from) {
    for (std::size_t i = 0; i < 3 && from + kRest <= radius.size(); ++i, from += kWindow) {
      if (medianWithin(radius, from, std::min(radius.size(), from + kWindow)) > kOstium * width) return true;
    }
    return false;
  };
  if (part < line.line.size()) return widens(line.radius, part + kWindow / 2);
  const cv::Point2f tip = line.line.back();
  for (std::size_t other = 0; other < lines.size(); ++other) {
    const float reach = kTip + width, begin = static_cast<float>(cv::norm(lines[other].line.front() - tip)),
                end = static_cast<float>(cv::norm(lines[other].line.back() - tip));
    if (other == own || std::min(begin, end) > reach) continue;
    std::vector<float> radius = lines[other].radius;
    if (end < begin) std::reverse(radius.begin(), radius.end());
    if (widens(radius, 0)) return true;
  }
  return false;
}

// How much of a line from the border on is a catheter [points].
std::size_t catheterPart(std::vector<CentreLine>& lines, std::size_t own, const std::vector<LineProfile>& profiles,
                         const std::vector<RowRange>& open, std::size_t shortest) {
  CentreLine& line = lines[own];
  if (!atBorder(line.line.front(), open) && atBorder(line.line.back(), open)) reverse(line);
  if (!atBorder(line.line.front(), open)) return 0;
  const std::size_t part = evenPart(line, shortest), steady = steadyPart(line, shortest);
  if (std::max(part, steady) < shortest) return 0;
  const float others = densityOf(profiles, std::max(part, steady), [&](std::size_t other) {
    return other != own && lines[other].kind == CurveKind::kVessel;
  });
  if (!(others > 0)) return 0;
  const bool dense = part >= shortest && branchesOff(lines, own, part) <= kMaxBranches &&
                     profileOf(line, part).density > kCatheterDensity * others;
  if (dense) return part;
  const bool shaped = static_cast<float>(steady) > kSteadyLength * static_cast<float>(shortest) &&
                      branchesOff(lines, own, steady) <= kMaxCrossings && endsAtOstium(lines, own, steady);
  return shaped ? steady : 0;
}

CentreLine cut(CentreLine& line, std::size_t at) {
  CentreLine rest = line;
  const auto before = static_cast<std::ptrdiff_t>(at) - 1;
  rest.line.erase(rest.line.begin(), rest.line.begin() + before);
  for (auto* values : {&rest.radius, &rest.sigma, &rest.contrast}) {
    values->erase(values->begin(), values->begin() + before);
  }
  line.line.resize(at);
  for (auto* values : {&line.radius, &line.sigma, &line.contrast}) values->resize(at);
  return rest;
}

}  // namespace

void dropAlongBorder(std::vector<CentreLine>& lines, const std::vector<RowRange>& open) {
  const auto follows = [&](const CentreLine& line) {
    const auto near =
        std::count_if(line.line.begin(), line.line.end(), [&](const auto& p) { return atBorder(p, open); });
    return 2 * static_cast<std::size_t>(near) > line.line.size();
  };
  lines.erase(std::remove_if(lines.begin(), lines.end(), follows), lines.end());
}

void tellDevices(std::vector<CentreLine>& lines, const std::vector<RowRange>& open, float shortest) {
  std::vector<LineProfile> profiles;
  for (const CentreLine& line : lines) profiles.push_back(profileOf(line, line.line.size()));
  for (std::size_t l = 0; l < lines.size(); ++l) {
    if (isWire(lines[l], profiles[l], profiles)) lines[l].kind = CurveKind::kDevice;
  }
  std::vector<std::size_t> part(lines.size(), 0);
  for (std::size_t l = 0; l < lines.size(); ++l) {
    if (lines[l].kind == CurveKind::kDevice) continue;
    part[l] = catheterPart(lines, l, profiles, open, static_cast<std::size_t>(shortest));
  }
  for (std::size_t l = 0; l < part.size(); ++l) {
    if (part[l] == 0) continue;
    if (part[l] < lines[l].line.size()) lines.push_back(cut(lines[l], part[l]));
    lines[l].kind = CurveKind::kDevice;
  }
}

}  // namespace angio::imaging
