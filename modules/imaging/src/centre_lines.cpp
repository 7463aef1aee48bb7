// SPDX-License-Identifier: GPL-2.0-or-later
#include "centre_lines.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>

#include "tube_chord.hpp"

namespace angio::imaging {
namespace {

constexpr float kCentreLineStairFilter = 2.5f;  // Takes the staircase of the pixel grid out of a line [working px].
constexpr float kFinalFilter = 2.0f;            // Takes out what noise the profiles leave [working px].
constexpr float kOffsetFilter = 3.0f;           // Over how far profiles are averaged [working px].
constexpr float kTangentRadii = 0.4f;           // Half of the length that a result's tangent is taken over.

// A background that changes from one side of a line to the other by this much absorption, and by this part of the
// line's own, is the shadow of a collimator: soft tissue bends slowly. Looked at this far from the line's walls
// [working px], since the background is known on a coarser grid.
constexpr float kEdge = 0.5f, kEdgePart = 0.5f, kEdgeReach = 6;

struct Profile {
  float offset = 0;      // Centre of the vessel along the normal.
  float half_width = 0;  // Of the part above half of the peak.
  bool edge = false;     // Whether the background has a step here.
};

class Centring {
 public:
  Centring(const SkeletonGraph& graph, const SkeletonImages& images, float blur)
      : graph_(graph), images_(images), blur_(blur) {}

  std::vector<CentreLine> run() {
    std::vector<Track> tracks;
    for (const auto& branch : graph_.branches) {
      if (!branch.alive || (branch.line.size() < 2 && branch.begin < 0)) continue;
      if (auto track = recentered(trackOf(graph_, branch, kCentreLineStairFilter))) tracks.push_back(std::move(*track));
    }
    meet(graph_, tracks);
    std::vector<CentreLine> result;
    for (Track& track : tracks) {
      track.line = smoothed(track.line, kFinalFilter, track.closed);
      if (track.closed) {
        track.line.push_back(track.line.front());
        track.radius.push_back(track.radius.front());
      }
      clip(track, result);
    }
    return result;
  }

 private:
  // Bilinear; beyond the image its edge goes on.
  float valueAt(const cv::Mat& a, const cv::Point2f& p) const {
    const float x = std::clamp(p.x - static_cast<float>(images_.margin), 0.0f, static_cast<float>(a.cols - 1));
    const float y = std::clamp(p.y - static_cast<float>(images_.margin), 0.0f, static_cast<float>(a.rows - 1));
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const int x1 = std::min(x0 + 1, a.cols - 1), y1 = std::min(y0 + 1, a.rows - 1);
    const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
    const float *upper = a.ptr<float>(y0), *lower = a.ptr<float>(y1);
    return (1 - v) * ((1 - u) * upper[x0] + u * upper[x1]) + v * ((1 - u) * lower[x0] + u * lower[x1]);
  }

  // Nothing where the vessel's walls are not both seen, as next to another vessel.
  std::optional<Profile> profileAt(const cv::Point2f& p, const cv::Point2f& normal) const {
    const float depth = nearestPixel(images_.distance, p);
    const float step = depth > 4 ? 1.0f : 0.5f;
    const int reach = static_cast<int>((2 * depth + 2 + 2 * blur_) / step);
    std::vector<float>& value = profile_;
    value.resize(2 * static_cast<std::size_t>(reach) + 1);
    for (int k = -reach; k <= reach; ++k) {
      value[k + reach] = valueAt(images_.absorption, p + normal * (step * static_cast<float>(k)));
    }
    const int near = static_cast<int>((0.7f * depth + 1) / step);
    const auto peak = std::max_element(value.begin() + std::max(0, reach - near), value.begin() + reach + near + 1);
    const float level = 0.5f * *peak;
    if (!(level > 0)) return std::nullopt;
    int left = static_cast<int>(peak - value.begin()), right = left;
    while (left > 0 && value[left] > level) --left;
    while (right < 2 * reach && value[right] > level) ++right;
    if (value[left] > level || value[right] > level) return std::nullopt;
    float moment = 0, mass = 0;
    for (int k = left + 1; k < right; ++k) {
      moment += (value[k] - level) * static_cast<float>(k - reach);
      mass += value[k] - level;
    }
    const float from = static_cast<float>(left) + (level - value[left]) / (value[left + 1] - value[left]);
    const float to = static_cast<float>(right) - (level - value[right]) / (value[right - 1] - value[right]);
    const auto behind = [&](int k, float further) {
      return valueAt(images_.background, p + normal * (step * static_cast<float>(k - reach) + further));
    };
    const float rise = std::abs(behind(left, -kEdgeReach) - behind(right, kEdgeReach));
    const bool edge = rise > std::max(kEdge, kEdgePart * *peak);
    return Profile{step * moment / mass, 0.5f * step * (to - from), edge};
  }

  // Nothing for a line that follows an edge.
  std::optional<Track> recentered(Track track) const {
    const std::size_t n = track.line.size();
    const std::size_t first = track.begin_reach, last = n - track.end_reach;
    std::vector<std::optional<Profile>> profile(n);
    std::vector<cv::Point2f> normal(n);
    for (std::size_t i = 0; i < n; ++i) {
      const cv::Point2f along = directionAt(track.line, i, 2);
      normal[i] = {-along.y, along.x};
      if (i >= first && i < last) profile[i] = profileAt(track.line[i], normal[i]);
    }
    const auto edges = std::count_if(profile.begin(), profile.end(), [](const auto& p) { return p && p->edge; });
    const auto seen = std::count_if(profile.begin(), profile.end(), [](const auto& p) { return p.has_value(); });
    if (2 * edges > seen) return std::nullopt;
    track.radius.resize(n);
    const int reach = static_cast<int>(2.5f * kOffsetFilter);
    for (std::size_t i = 0; i < n; ++i) {
      float total = 0, offset = 0, width = 0;
      for (int k = -reach; k <= reach; ++k) {
        const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + k;
        if (j < 0 || j >= static_cast<std::ptrdiff_t>(n) || !profile[j]) continue;
        const float weight = std::exp(-0.5f * static_cast<float>(k * k) / (kOffsetFilter * kOffsetFilter));
        total += weight;
        offset += weight * profile[j]->offset;
        width += weight * profile[j]->half_width;
      }
      const float depth = nearestPixel(images_.distance, track.line[i]);
      if (total > 0) track.line[i] += normal[i] * std::clamp(offset / total, -depth, depth);
      track.radius[i] = total > 0 ? tubeRadius(width / total, blur_) : depth;
    }
    return track;
  }

  void clip(const Track& track, std::vector<CentreLine>& result) const {
    const float margin = static_cast<float>(images_.margin);
    const cv::Rect2f inside(-0.5f, -0.5f, static_cast<float>(images_.absorption.cols),
                            static_cast<float>(images_.absorption.rows));
    CentreLine piece;
    for (std::size_t i = 0; i <= track.line.size(); ++i) {
      const bool last = i == track.line.size();
      const cv::Point2f p = last ? cv::Point2f() : track.line[i] - cv::Point2f(margin, margin);
      if (!last && inside.contains(p)) {
        piece.line.push_back(p);
        piece.radius.push_back(track.radius[i]);
      } else if (!piece.line.empty()) {
        if (piece.line.size() > 1) result.push_back(std::move(piece));
        piece = CentreLine();
      }
    }
  }

  const SkeletonGraph& graph_;
  const SkeletonImages& images_;
  float blur_ = 0;
  mutable std::vector<float> profile_;
};

}  // namespace

std::vector<CentreLine> centreLines(const SkeletonGraph& graph, const SkeletonImages& images, float blur) {
  return Centring(graph, images, blur).run();
}

Centerline2d sampled(const std::vector<CentreLine>& lines, const WorkingGrid& grid, double spacing_px) {
  const float scale = grid.scale;
  std::vector<std::vector<float>> places;
  Eigen::Index count = 0;
  bool measured = !lines.empty();
  for (const CentreLine& center : lines) {
    places.push_back(equalSteps(center.line, static_cast<float>(spacing_px) / scale));
    count += static_cast<Eigen::Index>(places.back().size());
    measured = measured && !center.sigma.empty();
  }
  Centerline2d result;
  result.points_px.resize(2, count);
  result.tangent_rad.resize(count);
  result.radius_px.resize(count);
  result.branch.reserve(count);
  if (measured) {
    result.std_px.resize(count);
    result.contrast.resize(count);
    result.kind.reserve(count);
  }
  Eigen::Index point = 0;
  for (std::size_t b = 0; b < lines.size(); ++b) {
    const CentreLine& center = lines[b];
    for (const float place : places[b]) {
      const std::size_t i = std::min(static_cast<std::size_t>(place + 0.5f), center.line.size() - 1);
      // A wide vessel's line bends less than its noise does.
      const auto reach = static_cast<std::size_t>(std::max(2.0f, kTangentRadii * center.radius[i]));
      const cv::Point2f p = grid.toImage(at(center.line, place)), along = directionAt(center.line, i, reach);
      result.points_px.col(point) << p.x, p.y;
      result.tangent_rad[point] = undirected(std::atan2(along.y, along.x));
      result.radius_px[point] = scale * center.radius[i];
      result.branch.push_back(static_cast<int>(b));
      if (measured) {
        result.std_px[point] = scale * center.sigma[i];
        result.contrast[point] = center.contrast[i];
        result.kind.push_back(center.kind);
      }
      ++point;
    }
  }
  return result;
}

}  // namespace angio::imaging
