// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheter_parts.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "line_profiles.hpp"

namespace angio::imaging {
namespace {

// Radius and contrast of a catheter stay within this part of their own median; the contrast changes with the
// background's scatter and with what crosses. Half of a dense one's points are as near to the median radius as that.
constexpr float kEvenRadius = 0.2f, kEvenContrast = 0.4f, kMostUneven = 0.15f;
// One whose width is seen has this radius at least [working px], and at most this part of `shortest`: the catheters of
// marked coronary angiograms have radii of 3.4 to 3.8 of 512 pixels, arteries of the neck, which come in at the border
// and end at a wider one too, 4.6 and more.
constexpr float kMinSteadyRadius = 2.2f, kMaxSteadyRadius = 0.0716f;
// The collimator's edge changes the width of the first points, and of some more: a steady part begins within so many
// steps of half a window.
constexpr std::size_t kEdgePoints = 12, kStarts = 4;
// What goes on is the catheter while it is not so much narrower.
constexpr float kNarrowest = 0.6f;
// Where within a window that vessel begins, so many points tell, by their width and their contrast.
constexpr std::size_t kPlace = 7;
constexpr float kVesselWider = 1.12f, kVesselDarker = 1.4f;

// Whether the radii of points [from, to) are those of a catheter of that width.
bool isAsWide(const CentreLine& line, std::size_t from, std::size_t to, float radius) {
  return std::abs(medianWithin(line.radius, from, to) - radius) <= kEvenRadius * std::max(radius, 1.0f);
}

// A tip in a vessel, told by what is like a catheter beside what is not.
class TipPlace {
 public:
  // `part` is surely the catheter.
  TipPlace(const std::vector<CentreLine>& lines, const BorderPath& path, const PathPart& part)
      : path_(path), width_(medianWithin(path.whole.radius, part.begin, part.end)), is_free_(endsFree(lines, path)) {}

  // How many points of the path are the catheter.
  std::size_t from(std::size_t part_end, std::size_t shortest) const {
    const std::size_t goes_on = alikeUntil(path_, part_end - kWindow, shortest, [&](std::size_t from, std::size_t to) {
      const float here = medianWithin(path_.whole.radius, from, to);
      return here > kNarrowest * width_ && here < kOstium * width_;
    });
    const std::size_t end = withoutVessel(std::max(part_end, goes_on));
    // What is left of a piece is a vessel only if it is like one.
    std::size_t piece_end = 0;
    for (const auto& piece : path_.pieces) {
      piece_end += piece.size;
      if (piece_end >= end && piece_end - end < kRest) return isVessel(end, piece_end, end) ? end : piece_end;
    }
    return end;
  }

 private:
  // Whether nothing else is at the path's end.
  static bool endsFree(const std::vector<CentreLine>& lines, const BorderPath& path) {
    const cv::Point2f tip = path.whole.line.back();
    const float reach = kTip + path.whole.radius.back();
    for (std::size_t other = 0; other < lines.size(); ++other) {
      if (path.has(other)) continue;
      const Polyline& line = lines[other].line;
      if (std::any_of(line.begin(), line.end(), [&](const auto& p) { return cv::norm(p - tip) < reach; })) return false;
    }
    return true;
  }

  // Whether points [from, to) are a vessel's: wider, or darker, than what lies before `end`. A tip that no vessel is at
  // may be darker by its direction.
  bool isVessel(std::size_t from, std::size_t to, std::size_t end) const {
    if (to <= from || end < 2 * kWindow) return false;
    const CentreLine& line = path_.whole;
    const std::size_t last = end - kWindow, first = last - std::min(last, 2 * kWindow);
    return medianWithin(line.radius, from, to) > kVesselWider * medianWithin(line.radius, first, last) ||
           (!(is_free_ && to + kRest > line.line.size()) &&
            medianWithin(line.contrast, from, to) > kVesselDarker * medianWithin(line.contrast, first, last));
  }

  // The last windows may hold the first points of the vessel.
  std::size_t withoutVessel(std::size_t end) const {
    std::size_t off = 0;
    while (off < kWindow && end > off + kPlace && isVessel(end - off - kPlace, end - off, end)) ++off;
    return end - off;
  }

  const BorderPath& path_;
  float width_;
  bool is_free_;
};

}  // namespace

std::size_t firstPoint(const BorderPath& path) { return std::max(path.begin, kEdgePoints); }

float radiusScatter(const CentreLine& line, const PathPart& part) {
  const float radius = medianWithin(line.radius, part.begin, part.end);
  std::vector<float> off;
  for (std::size_t i = part.begin; i < part.end; ++i) off.push_back(std::abs(line.radius[i] / radius - 1));
  return medianOf(std::move(off));
}

std::size_t evenPart(const BorderPath& path, std::size_t shortest) {
  const CentreLine& line = path.whole;
  if (path.bend < std::max(shortest, kWindow)) return 0;
  const float radius = medianWithin(line.radius, 0, shortest), contrast = medianWithin(line.contrast, 0, shortest);
  const std::size_t end = evenUntil(path, 0, [&](std::size_t from, std::size_t to) {
    return isAsWide(line, from, to, radius) &&
           std::abs(medianWithin(line.contrast, from, to) - contrast) <= kEvenContrast * contrast;
  });
  return end < shortest || radiusScatter(line, {0, end}) > kMostUneven ? 0 : end;
}

PathPart steadyPart(const BorderPath& path, std::size_t shortest) {
  const CentreLine& line = path.whole;
  const float widest = kMaxSteadyRadius * static_cast<float>(shortest);
  PathPart longest;
  for (std::size_t k = 0; k < kStarts; ++k) {
    const std::size_t start = firstPoint(path) + k * (kWindow / 2);
    if (path.bend < start + std::max(shortest, kWindow)) break;
    const float radius = medianWithin(line.radius, start, start + shortest);
    const auto alike = [&](std::size_t from, std::size_t to) { return isAsWide(line, from, to, radius); };
    PathPart part{start, start};
    while (part.begin < start + shortest && part.begin + kWindow <= path.bend &&
           !alike(part.begin, part.begin + kWindow))
      part.begin += kWindowStep;
    part.end = alikeUntil(path, part.begin, shortest, alike);
    if (part.size() < std::max(shortest, longest.size() + 1)) continue;
    const float width = medianWithin(line.radius, part.begin, part.end);
    if (width >= kMinSteadyRadius && width <= widest) longest = part;
  }
  return longest;
}

std::size_t pointsToTip(const std::vector<CentreLine>& lines, const BorderPath& path, const PathPart& part,
                        std::size_t shortest) {
  return TipPlace(lines, path, part).from(part.end, shortest);
}

}  // namespace angio::imaging
