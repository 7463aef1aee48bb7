// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheters.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "line_profiles.hpp"
#include "tracks.hpp"

namespace angio::imaging {
namespace {

// A catheter's wall and the contrast agent in it, which no blood dilutes, absorb so much more than vessels;
// what has branches must be denser.
constexpr float kCatheterDensity = 1.35f, kDensityPerBranch = 0.05f;
// Radius and contrast of a catheter stay within this part of their own median; the contrast changes with the
// background's scatter and with what crosses.
constexpr float kEvenRadius = 0.2f, kEvenContrast = 0.4f;
// Values are medians over so many points, so that a crossing vessel does not end a catheter.
constexpr std::size_t kWindow = 33;
// Lines may end at a catheter, which touches the wall somewhere.
constexpr int kMaxBranches = 3;
// Directions at such an end are taken over so many points; what crosses a catheter leaves it within so many radii.
constexpr std::size_t kBranchReach = 8;
constexpr float kAcross = 4;
// So much of a catheter at the border may have no line [working px].
constexpr float kUnseen = 8;
// What is left of a line after its catheter is a vessel if it is so long, else it belongs to the catheter.
constexpr std::size_t kRest = 22;

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

// Where a line ends at the side of another one: the place, and on which side.
struct SideEnd {
  std::size_t at = 0;
  bool left = false;
};

// Lines that end at the side of the first `count` points. Vessels that cross the line may end on both of its sides: two
// ends across each other are none.
int branchesOff(const std::vector<CentreLine>& lines, std::size_t own, std::size_t count) {
  const CentreLine& line = lines[own];
  const std::size_t side = count - std::min(count, kWindow);  // Near the device's tip vessels begin.
  std::vector<SideEnd> ends;
  for (std::size_t other = 0; other < lines.size(); ++other) {
    if (other == own || lines[other].kind == CurveKind::kDevice) continue;
    const Polyline& branch = lines[other].line;
    for (const bool first : {true, false}) {
      const cv::Point2f end = first ? branch.front() : branch.back();
      std::size_t i = 0;
      while (i < side && cv::norm(line.line[i] - end) > line.radius[i] + 2) ++i;
      if (i == side) continue;
      const std::size_t reach = std::min(kBranchReach, branch.size() - 1);
      const cv::Point2f from = first ? branch[reach] : branch[branch.size() - 1 - reach];
      ends.push_back({i, directionAt(line.line, i, kBranchReach).cross(from - line.line[i]) > 0});
    }
  }
  int alone = 0;
  while (!ends.empty()) {
    const SideEnd one = ends.back();
    ends.pop_back();
    const auto across = std::find_if(ends.begin(), ends.end(), [&](const SideEnd& end) {
      const std::size_t apart = std::max(end.at, one.at) - std::min(end.at, one.at);
      return end.left != one.left && static_cast<float>(apart) < kAcross * line.radius[one.at];
    });
    if (across == ends.end()) {
      ++alone;
    } else {
      ends.erase(across);
    }
  }
  return alone;
}

// A catheter that is hardly denser than the vessels is told by its shape as well: as wide all along, over this many
// times the length that a dense one needs, and wide enough for its width to be seen [working px].
constexpr float kSteadyLength = 1.2f, kMinSteadyRadius = 2.2f;
// What then speaks for it: each doubling of its density over that of the vessels (no blood dilutes its content), each
// doubling of its length, a tip in an ostium; and against it: lines that end at it, each doubling of its radius from
// the first half to the second (an artery that comes in at the border widens on its way to the trunk), and each
// doubling of its contrast, or halving. Set on five marked angiograms, mirrored, enlarged, and noisy.
constexpr float kPerDensity = 3, kPerLength = 1.5f, kLongest = 4, kPerOstium = 1, kPerBranch = -0.7f,
                kPerWidening = -12, kPerBrightening = -1, kLeastSigns = 1.1f;
// Nor is one wider than this part of `shortest`: the catheters of marked coronary angiograms have radii of 3.4 to 3.8
// of 512 pixels, arteries of the neck, which come in at the border and end at a wider one too, 4.6 and more.
constexpr float kMaxSteadyRadius = 0.0716f;
// The collimator's edge changes the width of the first points, and of some more.
constexpr std::size_t kEdgePoints = 12;
// At its tip begins a vessel that is so much wider.
constexpr float kOstium = 1.25f;
// A vessel begins at a tip where its own end is so near [working px], beyond the radius.
constexpr float kTip = 5;
// A line whose ends are so many times that distance from a tip goes on past it.
constexpr float kSideReach = 2;

// Points from the line's beginning on over which it is as wide as a catheter: vessels taper.
std::size_t steadyPart(const CentreLine& line, std::size_t shortest) {
  const std::size_t n = line.line.size();
  if (n < kEdgePoints + shortest || n < kEdgePoints + 2 * kWindow) return 0;
  const float radius = medianWithin(line.radius, kEdgePoints, kEdgePoints + shortest);
  if (radius < kMinSteadyRadius || radius > kMaxSteadyRadius * static_cast<float>(shortest)) return 0;
  std::size_t end = 0;
  for (std::size_t from = kEdgePoints; from + kWindow <= n; from += kWindow / 4) {
    if (std::abs(medianWithin(line.radius, from, from + kWindow) - radius) > kEvenRadius * radius) {
      if (end == 0 && from < shortest / 2) continue;
      break;
    }
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

// The median of a line's values in the second half of its first `count` points over that in the first half, without
// what the border changes.
float growth(const std::vector<float>& values, std::size_t count) {
  const std::size_t middle = kEdgePoints + (count - kEdgePoints) / 2;
  return medianWithin(values, middle, count) / std::max(medianWithin(values, kEdgePoints, middle), 1e-9f);
}

// Whether a line's first `part` points end at the side of another line, which goes on to both sides: a branch does.
bool endsAtSide(const std::vector<CentreLine>& lines, std::size_t own, std::size_t part) {
  const cv::Point2f tip = lines[own].line[part - 1];
  const float reach = kTip + lines[own].radius[part - 1];
  for (std::size_t other = 0; other < lines.size(); ++other) {
    const Polyline& line = lines[other].line;
    if (other == own || cv::norm(line.front() - tip) < kSideReach * reach ||
        cv::norm(line.back() - tip) < kSideReach * reach)
      continue;
    if (std::any_of(line.begin(), line.end(), [&](const auto& p) { return cv::norm(p - tip) < reach; })) return true;
  }
  return false;
}

// Whether the first `steady` points of a line, as wide as a catheter, are one. `others` is the density of vessels.
bool isShaped(const std::vector<CentreLine>& lines, std::size_t own, std::size_t steady, float length, float others) {
  const CentreLine& line = lines[own];
  const int branches = branchesOff(lines, own, steady);
  const bool in_ostium = endsAtOstium(lines, own, steady);
  if (length <= kSteadyLength || branches > kMaxBranches || (!in_ostium && endsAtSide(lines, own, steady)))
    return false;
  const float density = profileOf(line, steady).density / others;
  const float signs = kPerDensity * std::log2(density) + kPerLength * std::log2(std::min(length, kLongest)) +
                      (in_ostium ? kPerOstium : 0) + kPerBranch * static_cast<float>(branches) +
                      kPerWidening * std::max(0.0f, std::log2(growth(line.radius, steady))) +
                      kPerBrightening * std::abs(std::log2(growth(line.contrast, steady)));
  return signs > kLeastSigns;
}

// Whether the first `part` points of a line, as even as a catheter, are too dense for blood.
bool isDense(const std::vector<CentreLine>& lines, std::size_t own, std::size_t part, float others) {
  const int branches = branchesOff(lines, own, part);
  const float least = kCatheterDensity + kDensityPerBranch * static_cast<float>(branches);
  return branches <= kMaxBranches && profileOf(lines[own], part).density > least * others;
}

// Whether a line begins at the border, or would if it began a little earlier: its first points are the hardest to see.
bool comesIn(const Polyline& line, const std::vector<RowRange>& open) {
  const cv::Point2f along = directionAt(line, 0, kBranchReach);
  return atBorder(line.front(), open) || atBorder(line.front() - kUnseen * along, open);
}

// How much of a line from the border on is a catheter [points].
std::size_t catheterPart(std::vector<CentreLine>& lines, std::size_t own, const std::vector<LineProfile>& profiles,
                         const std::vector<RowRange>& open, std::size_t shortest) {
  CentreLine& line = lines[own];
  if (!comesIn(line.line, open)) {
    reverse(line);
    if (!comesIn(line.line, open)) return 0;
  }
  const std::size_t part = evenPart(line, shortest), steady = steadyPart(line, shortest);
  if (std::max(part, steady) < shortest) return 0;
  const float others = densityOf(profiles, std::max(part, steady), [&](std::size_t other) {
    return other != own && lines[other].kind == CurveKind::kVessel;
  });
  if (!(others > 0)) return 0;
  if (part >= shortest && isDense(lines, own, part, others)) return part;
  if (steady < shortest || atBorder(line.line[steady - 1], open)) return 0;
  const float length = static_cast<float>(steady) / static_cast<float>(shortest);
  return isShaped(lines, own, steady, length, others) ? steady : 0;
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

void tellCatheters(std::vector<CentreLine>& lines, const std::vector<RowRange>& open, float shortest) {
  std::vector<LineProfile> profiles;
  for (const CentreLine& line : lines) profiles.push_back(profileOf(line, line.line.size()));
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
