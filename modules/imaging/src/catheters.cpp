// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheters.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>

#include "catheter_parts.hpp"
#include "line_profiles.hpp"
#include "tracks.hpp"

namespace angio::imaging {
namespace {

// A catheter's wall and the contrast agent in it, which no blood dilutes, absorb so much more than vessels;
// what has branches must be denser.
constexpr float kCatheterDensity = 1.35f, kDensityPerBranch = 0.05f;
// Lines may end at a catheter, which touches the wall somewhere.
constexpr int kMaxBranches = 3;
// Directions at such an end are taken over so many points; what crosses a catheter leaves it within so many radii.
constexpr std::size_t kBranchReach = 8;
constexpr float kAcross = 4;
// A catheter that is hardly denser than the vessels is told by its shape as well: as wide all along, over this many
// times the length that a dense one needs.
constexpr float kSteadyLength = 1.2f;
// Log odds that it is one: the constant; each doubling of its density over that of the vessels (no blood dilutes its
// content); each doubling of its length; a tip in an ostium; lines that end at it; each doubling, from the first half
// to the second, of its radius (an artery that comes in at the border widens on its way to the trunk) and of its
// contrast (which grows with it; a catheter's falls over the heart and the spine, whose scatter lies over it); each
// doubling of the scatter of its radii (those of a vessel are less alike than a tube's). Fitted on five marked
// angiograms in nine variants, with a penalty on what differs from weights that were set by hand.
constexpr float kCatheterOdds = -7.78f, kPerDensity = 3.04f, kPerLength = 1.64f, kLongest = 4, kPerOstium = 0.73f,
                kPerBranch = -0.63f, kPerWidening = -12.6f, kPerBrightening = -1.05f, kPerScatter = -2.13f,
                kLeastScatter = 0.08f;
// A vessel begins at a tip where its own end is at it, or not so many of its radii away, where the tip lies in it:
// contrast agent flows back past the tip.
constexpr float kBackflow = 3;
// A line whose ends are so many times that distance from a tip goes on past it.
constexpr float kSideReach = 2;

// Where a line ends at the side of another one: the place, and on which side.
struct SideEnd {
  std::size_t at = 0;
  bool left = false;
};

// Lines that end at the side of the first `count` points. Vessels that cross the line may end on both of its sides: two
// ends across each other are none.
int branchesOff(const std::vector<CentreLine>& lines, const BorderPath& path, std::size_t count) {
  const CentreLine& line = path.whole;
  const std::size_t side = count - std::min(count, kWindow);  // Near the device's tip vessels begin.
  std::vector<SideEnd> ends;
  for (std::size_t other = 0; other < lines.size(); ++other) {
    if (path.has(other) || lines[other].kind == CurveKind::kDevice) continue;
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

// Whether a line is wider than that at one of its first windows from a point on: the tip lies some way within.
bool widens(const std::vector<float>& radius, std::size_t from, float width) {
  for (std::size_t i = 0; i < 3 && from + kRest <= radius.size(); ++i, from += kWindow) {
    if (medianWithin(radius, from, std::min(radius.size(), from + kWindow)) > kOstium * width) return true;
  }
  return false;
}

// Whether a wider vessel begins at the end of a path's first `part` points: the path's own rest, or another line, which
// ends there as well, or not far from there. What a branch ends at goes on to both sides.
bool endsAtOstium(const std::vector<CentreLine>& lines, const BorderPath& path, std::size_t part) {
  const CentreLine& own = path.whole;
  const float width = medianWithin(own.radius, part - std::min(part, 2 * kWindow), part);
  if (part < own.line.size()) return widens(own.radius, part, width);
  const cv::Point2f tip = own.line.back();
  for (std::size_t other = 0; other < lines.size(); ++other) {
    if (path.has(other)) continue;
    const CentreLine& line = lines[other];
    std::vector<float> radius = line.radius;
    const float begin = static_cast<float>(cv::norm(line.line.front() - tip)),
                end = static_cast<float>(cv::norm(line.line.back() - tip));
    if (std::min(begin, end) < kTip + width) {
      if (end < begin) std::reverse(radius.begin(), radius.end());
      if (widens(radius, 0, width)) return true;
      continue;
    }
    for (std::size_t i = 0; i < line.line.size(); ++i) {
      if (line.radius[i] < kOstium * width || cv::norm(line.line[i] - tip) > kTip + line.radius[i]) continue;
      if (std::min(begin, end) < kBackflow * line.radius[i]) return true;
    }
  }
  return false;
}

// Whether a path's first `part` points end at the side of another line, which goes on to both sides: a branch does.
bool endsAtSide(const std::vector<CentreLine>& lines, const BorderPath& path, std::size_t part) {
  const cv::Point2f tip = path.whole.line[part - 1];
  const float reach = kTip + path.whole.radius[part - 1];
  for (std::size_t other = 0; other < lines.size(); ++other) {
    const Polyline& line = lines[other].line;
    if (path.has(other) || cv::norm(line.front() - tip) < kSideReach * reach ||
        cv::norm(line.back() - tip) < kSideReach * reach)
      continue;
    if (std::any_of(line.begin(), line.end(), [&](const auto& p) { return cv::norm(p - tip) < reach; })) return true;
  }
  return false;
}

// The median of values in a part's second half over that in its first.
float growth(const std::vector<float>& values, const PathPart& part) {
  const std::size_t middle = part.begin + part.size() / 2;
  return medianWithin(values, middle, part.end) / std::max(medianWithin(values, part.begin, middle), 1e-9f);
}

// Log odds that a part of a path, as wide as a catheter, is one; none for what cannot be. `others` is the density of
// vessels.
std::optional<float> oddsOf(const std::vector<CentreLine>& lines, const BorderPath& path, const PathPart& steady,
                            std::size_t shortest, float others) {
  const CentreLine& line = path.whole;
  const float length = static_cast<float>(steady.end) / static_cast<float>(shortest);
  const int branches = branchesOff(lines, path, steady.end);
  const bool in_ostium = endsAtOstium(lines, path, steady.end);
  if (length <= kSteadyLength || branches > kMaxBranches || (!in_ostium && endsAtSide(lines, path, steady.end))) {
    return std::nullopt;
  }
  const PathPart seen{firstPoint(path), steady.end};
  const float scatter = std::max(radiusScatter(line, steady), kLeastScatter);
  return kCatheterOdds + kPerDensity * std::log2(profileOf(line, steady.end).density / others) +
         kPerLength * std::log2(std::min(length, kLongest)) + (in_ostium ? kPerOstium : 0) +
         kPerBranch * static_cast<float>(branches) +
         kPerWidening * std::max(0.0f, std::log2(growth(line.radius, seen))) +
         kPerBrightening * std::max(0.0f, std::log2(growth(line.contrast, seen))) + kPerScatter * std::log2(scatter);
}

// Whether the first `part` points of a path, as even as a catheter, are too dense for blood.
bool isDense(const std::vector<CentreLine>& lines, const BorderPath& path, std::size_t part, float others) {
  const int branches = branchesOff(lines, path, part);
  const float least = kCatheterDensity + kDensityPerBranch * static_cast<float>(branches);
  return branches <= kMaxBranches && profileOf(path.whole, part).density > least * others;
}

// A path's first `count` points that are a catheter.
struct Catheter {
  BorderPath path;
  std::size_t count = 0;
  float odds = 0;  // Of one that its shape tells.
  bool is_dense = false;
};

std::optional<Catheter> catheterOn(const std::vector<CentreLine>& lines, BorderPath path,
                                   const std::vector<LineProfile>& profiles, const std::vector<RowRange>& open,
                                   std::size_t shortest) {
  const std::size_t even = evenPart(path, shortest);
  const PathPart steady = steadyPart(path, shortest);
  if (even + steady.size() == 0) return std::nullopt;
  const float others = densityOf(profiles, std::max(even, steady.end), [&](std::size_t other) {
    return !path.has(other) && lines[other].kind == CurveKind::kVessel;
  });
  if (!(others > 0)) return std::nullopt;
  if (even > 0 && isDense(lines, path, even, others)) {
    const std::size_t count = pointsToTip(lines, path, {0, even}, shortest);
    return Catheter{std::move(path), count, 0, true};
  }
  if (steady.size() == 0 || atBorder(path.whole.line[steady.end - 1], open)) return std::nullopt;
  const std::optional<float> odds = oddsOf(lines, path, steady, shortest, others);
  if (!odds || !(*odds > 0)) return std::nullopt;
  const std::size_t count = pointsToTip(lines, path, steady, shortest);
  return Catheter{std::move(path), count, *odds, false};
}

// Takes points [at, end) off a line.
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

// Marks the first `count` points of a path, as far as no other catheter's mark has cut its lines.
void markDevice(std::vector<CentreLine>& lines, const BorderPath& path, std::size_t count) {
  for (const auto& [own, size, reversed] : path.pieces) {
    if (lines[own].kind == CurveKind::kDevice || lines[own].line.size() != size || count < 2) return;
    if (count < size) {
      CentreLine rest = cut(lines[own], reversed ? size - count + 1 : count);
      (reversed ? rest : lines[own]).kind = CurveKind::kDevice;
      lines.push_back(std::move(rest));
      return;
    }
    lines[own].kind = CurveKind::kDevice;
    count -= size;
  }
}

}  // namespace

void tellCatheters(std::vector<CentreLine>& lines, const std::vector<RowRange>& open, float shortest) {
  std::vector<LineProfile> profiles;
  for (const CentreLine& line : lines) profiles.push_back(profileOf(line, line.line.size()));
  std::vector<Catheter> told;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    if (lines[l].kind == CurveKind::kDevice) continue;
    BorderPath path = pathFromBorder(lines, l, open);
    if (path.pieces.empty()) continue;
    auto catheter = catheterOn(lines, std::move(path), profiles, open, static_cast<std::size_t>(shortest));
    if (catheter) told.push_back(std::move(*catheter));
  }
  // Contrast agent comes through one catheter: of those that only their shape tells, the likeliest is it.
  std::stable_sort(told.begin(), told.end(), [](const Catheter& a, const Catheter& b) {
    return std::make_pair(a.is_dense, a.odds) > std::make_pair(b.is_dense, b.odds);
  });
  for (std::size_t i = 0; i < told.size() && (i == 0 || told[i].is_dense); ++i) {
    markDevice(lines, told[i].path, told[i].count);
  }
}

}  // namespace angio::imaging
