// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/seen_catheter.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "angio/geometry/se3.hpp"

namespace angio::localisation {
namespace {

constexpr double kLever_px = 20;  // Of a direction at an end.

using Points = std::vector<Eigen::Vector2d>;

double lengthOf(const Points& points) {
  double length = 0;
  for (std::size_t i = 1; i < points.size(); ++i) length += (points[i] - points[i - 1]).norm();
  return length;
}

// The direction out of the curve at its last or first point.
Eigen::Vector2d outward(const Points& points, bool at_last) {
  const auto at = [&](std::size_t i) { return at_last ? points[points.size() - 1 - i] : points[i]; };
  std::size_t i = 1;
  while (i + 1 < points.size() && (at(0) - at(i)).norm() < kLever_px) ++i;
  return (at(0) - at(i)).normalized();
}

// Branches of devices, cut where a step is too long to be one.
std::vector<Points> piecesOf(const Centerline2d& devices, double max_step_px) {
  std::vector<Points> pieces;
  for (int i = 0; i < devices.size(); ++i) {
    const Eigen::Vector2d point = devices.points_px.col(i);
    if (!point.allFinite()) continue;
    const bool goes_on = i > 0 && devices.branch[i] == devices.branch[i - 1] && !pieces.empty() &&
                         (point - pieces.back().back()).norm() <= max_step_px;
    if (!goes_on) pieces.emplace_back();
    pieces.back().push_back(point);
  }
  const auto is_point = [](const Points& piece) { return lengthOf(piece) <= 0; };
  pieces.erase(std::remove_if(pieces.begin(), pieces.end(), is_point), pieces.end());
  return pieces;
}

// One way to join two ends of two pieces.
struct Joint {
  std::size_t a = 0, b = 0;
  bool a_last = false, b_last = false;
  double gap_px = 0, price = 0;
};

std::vector<Joint> jointsOf(const std::vector<Points>& pieces, const SeenCatheterSettings& settings) {
  std::vector<Joint> joints;
  const double min_cosine = std::cos(degToRad(settings.max_turn_deg));
  for (std::size_t a = 0; a < pieces.size(); ++a) {
    for (std::size_t b = a + 1; b < pieces.size(); ++b) {
      for (const bool a_last : {false, true}) {
        for (const bool b_last : {false, true}) {
          const Eigen::Vector2d from = a_last ? pieces[a].back() : pieces[a].front();
          const Eigen::Vector2d to = b_last ? pieces[b].back() : pieces[b].front();
          const Eigen::Vector2d across = to - from, out_a = outward(pieces[a], a_last),
                                out_b = outward(pieces[b], b_last);
          const double gap = across.norm();
          if (gap > settings.max_gap_px || -out_a.dot(out_b) < min_cosine) continue;
          // Ends a few pixels apart say nothing about the direction of the gap.
          double straight = -out_a.dot(out_b);
          if (gap > 5) straight = std::min({straight, out_a.dot(across) / gap, -out_b.dot(across) / gap});
          if (straight < min_cosine) continue;
          joints.push_back({a, b, a_last, b_last, gap, gap + kLever_px * (1 - straight)});
        }
      }
    }
  }
  std::stable_sort(joints.begin(), joints.end(), [](const Joint& x, const Joint& y) { return x.price < y.price; });
  return joints;
}

// Joins the pieces, cheapest joints first. A short piece at an end, across a gap that is longer than it, is noise: it
// would move the tip.
std::vector<Points> joined(std::vector<Points> pieces, const SeenCatheterSettings& settings) {
  for (;;) {
    const auto joints = jointsOf(pieces, settings);
    const auto worth = [&](const Joint& joint) {
      const double shorter = std::min(lengthOf(pieces[joint.a]), lengthOf(pieces[joint.b]));
      return shorter >= std::min(settings.min_piece_px, joint.gap_px) && shorter >= 0.5 * joint.gap_px;
    };
    const auto joint = std::find_if(joints.begin(), joints.end(), worth);
    if (joint == joints.end()) return pieces;
    Points a = pieces[joint->a], b = pieces[joint->b];
    if (!joint->a_last) std::reverse(a.begin(), a.end());
    if (joint->b_last) std::reverse(b.begin(), b.end());
    a.insert(a.end(), b.begin(), b.end());
    pieces[joint->a] = std::move(a);
    pieces.erase(pieces.begin() + static_cast<std::ptrdiff_t>(joint->b));
  }
}

bool leaves(const Eigen::Vector2d& end, const XrayCamera& camera, double border_px) {
  return end.minCoeff() < border_px || end.x() > camera.width_px() - 1 - border_px ||
         end.y() > camera.height_px() - 1 - border_px;
}

double sigmaOf(const Centerline2d& devices, double otherwise) {
  if (devices.std_px.size() == 0) return otherwise;
  std::vector<double> sigmas(devices.std_px.begin(), devices.std_px.end());
  std::nth_element(sigmas.begin(), sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2), sigmas.end());
  const double median = sigmas[sigmas.size() / 2];
  return std::isfinite(median) && median > 0 ? median : otherwise;
}

}  // namespace

std::optional<SeenCatheter> seenCatheter(const Centerline2d& seen, const XrayCamera& camera,
                                         const SeenCatheterSettings& settings,
                                         const std::optional<CatheterHint>& hint) {
  checkSettings("seen catheter", settings);
  const Centerline2d devices = ofKind(seen, CurveKind::kDevice);
  if (devices.size() == 0 || !devices.ordered()) return std::nullopt;
  const auto curves = joined(piecesOf(devices, settings.max_gap_px), settings);
  const auto shorter = [](const Points& a, const Points& b) { return lengthOf(a) < lengthOf(b); };
  const auto longest = std::max_element(curves.begin(), curves.end(), shorter);
  if (longest == curves.end() || lengthOf(*longest) < settings.min_curve_px) return std::nullopt;

  SeenCatheter result;
  const bool first_leaves = leaves(longest->front(), camera, settings.border_px);
  const bool last_leaves = leaves(longest->back(), camera, settings.border_px);
  bool tip_is_last = first_leaves;
  if (first_leaves == last_leaves) {
    result.tip_end = hint ? TipEnd::kLast : TipEnd::kUnknown;
    tip_is_last = !hint || (longest->back() - hint->tip_px).norm() <= (longest->front() - hint->tip_px).norm();
  }
  result.points_px.resize(2, longest->size());
  for (std::size_t i = 0; i < longest->size(); ++i) {
    result.points_px.col(tip_is_last ? i : longest->size() - 1 - i) = (*longest)[i];
  }
  result.std_px = sigmaOf(devices, settings.std_px);
  return result;
}

}  // namespace angio::localisation
