// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracks.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace angio::imaging {

Polyline smoothed(const Polyline& line, float sigma, bool closed) {
  const int n = static_cast<int>(line.size()), reach = static_cast<int>(std::ceil(2.5f * sigma));
  if (n < 3 || reach < 1) return line;
  std::vector<float> weight(static_cast<std::size_t>(reach) + 1);
  for (int k = 0; k <= reach; ++k) {
    weight[k] = std::exp(-0.5f * static_cast<float>(k * k) / (sigma * sigma));
  }
  const auto beyond = [&](int i) -> cv::Point2f {
    if (closed) return line[((i % n) + n) % n];
    if (i < 0) return 2 * line.front() - line[std::min(-i, n - 1)];
    if (i >= n) return 2 * line.back() - line[std::max(2 * (n - 1) - i, 0)];
    return line[i];
  };
  Polyline result(line.size());
  for (int i = 0; i < n; ++i) {
    cv::Point2f sum = weight[0] * line[i];
    float total = weight[0];
    for (int k = 1; k <= reach; ++k) {
      sum += weight[k] * (beyond(i - k) + beyond(i + k));
      total += 2 * weight[k];
    }
    result[i] = sum * (1 / total);
  }
  return result;
}

std::vector<float> equalSteps(const Polyline& line, float spacing) {
  std::vector<float> length(line.size(), 0);
  for (std::size_t i = 1; i < line.size(); ++i) {
    length[i] = length[i - 1] + static_cast<float>(cv::norm(line[i] - line[i - 1]));
  }
  const int pieces = std::max(1, static_cast<int>(std::lround(length.back() / spacing)));
  std::vector<float> places;
  std::size_t edge = 0;
  for (int p = 0; p <= pieces; ++p) {
    const float wanted = length.back() * static_cast<float>(p) / static_cast<float>(pieces);
    while (edge + 2 < line.size() && length[edge + 1] < wanted) ++edge;
    const float step = edge + 1 < line.size() ? length[edge + 1] - length[edge] : 0;
    places.push_back(static_cast<float>(edge) +
                     (step > 0 ? std::clamp((wanted - length[edge]) / step, 0.0f, 1.0f) : 0));
  }
  return places;
}

cv::Point2f at(const Polyline& line, float place) {
  const std::size_t i = std::min(static_cast<std::size_t>(place), line.size() - 1);
  const std::size_t next = std::min(i + 1, line.size() - 1);
  const float w = place - static_cast<float>(i);
  return (1 - w) * line[i] + w * line[next];
}

cv::Point2f directionAt(const Polyline& line, std::size_t i, std::size_t reach) {
  const cv::Point2f chord = line[std::min(i + reach, line.size() - 1)] - line[i - std::min(i, reach)];
  const float length = static_cast<float>(cv::norm(chord));
  return length > 0 ? chord * (1 / length) : cv::Point2f(0, 0);
}

namespace {

void straighten(Polyline& line, std::size_t reach, const cv::Point2f& place) {
  const cv::Point2f from = line[reach];
  for (std::size_t i = 0; i < reach; ++i) {
    const float w = static_cast<float>(i) / static_cast<float>(reach);
    line[i] = (1 - w) * place + w * from;
  }
  if (reach == 0) line.front() = place;
}

// Nearest to all lines that end in the node, within reason.
cv::Point2f meetingPlace(const SkeletonGraph& graph, int node, const std::vector<Track>& tracks,
                         const std::vector<int>& ends) {
  const cv::Point2f old = graph.nodes[node].position;
  // The old place counts as well, or two parallel branches would meet anywhere.
  cv::Matx22f A = 0.1f * cv::Matx22f::eye();
  cv::Vec2f b = 0.1f * cv::Vec2f(old.x, old.y);
  const auto extend = [&](const Polyline& line, std::size_t i) {
    const cv::Point2f along = directionAt(line, i, 3);
    const cv::Matx22f across(1 - along.x * along.x, -along.x * along.y, -along.x * along.y, 1 - along.y * along.y);
    A += across;
    b += across * cv::Vec2f(line[i].x, line[i].y);
  };
  for (const int t : ends) {
    const Track& track = tracks[t];
    const std::size_t size = track.line.size(), middle = (size - 1) / 2;
    if (track.begin == node) extend(track.line, std::min(track.begin_reach + 3, middle));
    if (track.end == node) extend(track.line, size - 1 - std::min(track.end_reach + 3, middle));
  }
  const cv::Vec2f best = A.inv() * b;
  const cv::Point2f place(best[0], best[1]);
  const float moved = static_cast<float>(cv::norm(place - old)), allowed = 1.5f * graph.nodes[node].radius + 1;
  return moved > allowed ? old + (place - old) * (allowed / moved) : place;
}

// Where a track that ends in a node meets the one that passes there: the point of the latter that is nearest to the
// former's straight extension, near the node.
cv::Point2f placeOn(const SkeletonGraph& graph, int node, const Track& passing, const Track& ending) {
  const bool at_begin = ending.begin == node;
  const std::size_t i = at_begin ? ending.begin_reach : ending.line.size() - 1 - ending.end_reach;
  const cv::Point2f from = ending.line[i], along = directionAt(ending.line, i, 4);
  const cv::Point2f outwards = at_begin ? -along : along, old = graph.nodes[node].position;
  const float allowed = 2 * graph.nodes[node].radius + 2;
  cv::Point2f best = old;
  float least = 1e9f;
  for (const cv::Point2f& p : passing.line) {
    const float away = static_cast<float>(cv::norm(p - old));
    if (away > allowed) continue;
    const cv::Point2f d = p - from;
    const float ahead = d.dot(outwards);
    const float cost = std::abs(d.x * along.y - d.y * along.x) + 0.1f * away + std::max(0.0f, -ahead);
    if (cost >= least) continue;
    least = cost;
    best = p;
  }
  return best;
}

}  // namespace

Track trackOf(const SkeletonGraph& graph, const SkeletonGraph::Branch& branch, float sigma) {
  Polyline line;
  if (branch.begin >= 0) line.push_back(graph.nodes[branch.begin].position);
  line.insert(line.end(), branch.line.begin(), branch.line.end());
  if (branch.end >= 0) line.push_back(graph.nodes[branch.end].position);
  line = smoothed(line, sigma, branch.closed);
  Track track{{}, {}, branch.begin, branch.end, branch.closed};
  for (const float place : equalSteps(line, 1)) track.line.push_back(at(line, place));
  track.begin_reach = reachOf(graph, track.begin, track.line.size());
  track.end_reach = reachOf(graph, track.end, track.line.size());
  return track;
}

std::size_t reachOf(const SkeletonGraph& graph, int node, std::size_t size) {
  if (node < 0) return 0;
  const auto reach = static_cast<std::size_t>(std::lround(graph.nodes[node].radius + 1.5f));
  return std::min(reach, (size - 1) / 2);
}

void meet(const SkeletonGraph& graph, std::vector<Track>& tracks) {
  std::vector<std::vector<int>> ends(graph.nodes.size());
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const Track& track = tracks[t];
    if (track.begin >= 0) ends[track.begin].push_back(static_cast<int>(t));
    if (track.end >= 0 && track.end != track.begin) ends[track.end].push_back(static_cast<int>(t));
  }
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    const int node = static_cast<int>(n);
    if (ends[n].empty()) continue;
    cv::Point2f place;
    if (graph.nodes[n].through >= 0) {
      const auto passing = std::find_if(tracks.begin(), tracks.end(),
                                        [&](const Track& t) { return t.branch == graph.nodes[n].through; });
      if (passing == tracks.end()) continue;
      place = placeOn(graph, node, *passing, tracks[ends[n].front()]);
    } else if (graph.nodes[n].degree >= 3) {
      place = meetingPlace(graph, node, tracks, ends[n]);
    } else {
      continue;
    }
    for (const int t : ends[n]) {
      Track& track = tracks[t];
      if (track.begin == node) straighten(track.line, track.begin_reach, place);
      if (track.end != node) continue;
      std::reverse(track.line.begin(), track.line.end());
      straighten(track.line, track.end_reach, place);
      std::reverse(track.line.begin(), track.line.end());
    }
  }
}

}  // namespace angio::imaging
