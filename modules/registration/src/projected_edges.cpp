// SPDX-License-Identifier: GPL-2.0-or-later
#include "projected_edges.hpp"

#include <algorithm>
#include <cmath>

#include "raw_view.hpp"

// Compiled once for every vector target by the include below, which is chosen from at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "projected_edges.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::registration {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The nearest of the entries in several ranges [begin, end): as many of them at a time as there are lanes.
void nearestEntry(const EdgeEntries& entries, const int* ranges, int range_count, float u, float v, float cos2,
                  float sin2, float min_cos2, FoundEntry& best) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  auto best_distance2 = hn::Set(d, best.distance2), best_along = zero;
  auto best_entry = hn::Set(di, -1);
  for (int r = 0; r < range_count; ++r) {
    const int end = ranges[2 * r + 1];
    for (int k = ranges[2 * r]; k < end; k += lanes) {
      const auto x = hn::Sub(hn::Set(d, u), hn::LoadU(d, entries.u.data() + k));
      const auto y = hn::Sub(hn::Set(d, v), hn::LoadU(d, entries.v.data() + k));
      const auto du = hn::LoadU(d, entries.du.data() + k), dv = hn::LoadU(d, entries.dv.data() + k);
      const auto along = hn::Min(one, hn::Max(zero, hn::Mul(hn::MulAdd(x, du, hn::Mul(y, dv)),
                                                            hn::LoadU(d, entries.inverse_length2.data() + k))));
      const auto rx = hn::NegMulAdd(along, du, x), ry = hn::NegMulAdd(along, dv, y);
      const auto distance2 = hn::MulAdd(rx, rx, hn::Mul(ry, ry));
      const auto cosine = hn::MulAdd(hn::LoadU(d, entries.cos2.data() + k), hn::Set(d, cos2),
                                     hn::Mul(hn::LoadU(d, entries.sin2.data() + k), hn::Set(d, sin2)));
      const auto index = hn::Iota(di, k);
      auto wins = hn::And(hn::Lt(distance2, best_distance2), hn::Ge(cosine, hn::Set(d, min_cos2)));
      wins = hn::And(wins, hn::RebindMask(d, hn::Lt(index, hn::Set(di, end))));
      best_distance2 = hn::IfThenElse(wins, distance2, best_distance2);
      best_along = hn::IfThenElse(wins, along, best_along);
      best_entry = hn::IfThenElse(hn::RebindMask(di, wins), index, best_entry);
    }
  }
  HWY_ALIGN float distances[HWY_MAX_BYTES / sizeof(float)], alongs[HWY_MAX_BYTES / sizeof(float)];
  HWY_ALIGN std::int32_t entry[HWY_MAX_BYTES / sizeof(float)];
  const auto least = hn::MinOfLanes(d, best_distance2);
  const auto at = hn::FindFirstTrue(
      d, hn::And(hn::Eq(best_distance2, least), hn::RebindMask(d, hn::Gt(best_entry, hn::Set(di, -1)))));
  if (at < 0) return;
  hn::Store(best_distance2, d, distances);
  hn::Store(best_along, d, alongs);
  hn::Store(best_entry, di, entry);
  best = {entry[at], alongs[at], distances[at]};
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::registration
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::registration {
HWY_EXPORT(nearestEntry);

constexpr int kMaxRows = 64;
constexpr float kCell_px = 16;
constexpr float kMinLength_px = 0.05f;  // An edge seen shorter than this has no direction.

void EdgeEntries::resize(std::size_t size) {
  for (auto* values : {&u, &v, &du, &dv, &inverse_length2, &cos2, &sin2}) values->resize(size + kPadding);
  edge.resize(size + kPadding);
}

void ProjectedEdges::project(const Eigen::Matrix3Xd& points_centered, const std::vector<std::pair<int, int>>& edges,
                             const XrayCamera& camera, const Pose& T_view_centered) {
  const auto n = static_cast<std::size_t>(points_centered.cols());
  u_.resize(n);
  v_.resize(n);
  in_front_.resize(n);
  const Eigen::Matrix3d R = T_view_centered.linear();
  const Eigen::Vector3d t = T_view_centered.translation();
  const auto& c = camera.parameters();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d p = R * points_centered.col(i) + t;
    in_front_[i] = p.z() > 1e-3;
    const double inverse = in_front_[i] ? 1 / p.z() : 0;
    u_[i] = static_cast<float>(c.fx_px * p.x() * inverse + c.cx_px);
    v_[i] = static_cast<float>(c.fy_px * p.y() * inverse + c.cy_px);
  }

  // Every edge goes to each cell that its pieces, none longer than a cell, have their middle in: a search that looks
  // one cell further than its gate finds it.
  columns_ = static_cast<int>(std::ceil(static_cast<float>(camera.width_px()) / kCell_px)) + 2;
  rows_ = static_cast<int>(std::ceil(static_cast<float>(camera.height_px()) / kCell_px)) + 2;
  cell_begin_.assign(static_cast<std::size_t>(columns_) * rows_ + 1, 0);
  placed_.clear();
  length_px_ = 0;
  const float u_end = (columns_ - 1) * kCell_px, v_end = (rows_ - 1) * kCell_px;
  const auto inside = [&](float u, float v) { return u > -kCell_px && v > -kCell_px && u < u_end && v < v_end; };
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto [a, b] = edges[e];
    if (!in_front_[a] || !in_front_[b]) continue;
    if (!inside(u_[a], v_[a]) && !inside(u_[b], v_[b])) continue;
    const float du = u_[b] - u_[a], dv = v_[b] - v_[a], length2 = du * du + dv * dv;
    if (!(length2 > kMinLength_px * kMinLength_px) || !(length2 < 1e8f)) continue;
    const float length = std::sqrt(length2);
    length_px_ += length;
    const int pieces = length <= kCell_px ? 1 : static_cast<int>(std::ceil(length / kCell_px));
    for (int k = 0; k < pieces; ++k) {
      const float w = (static_cast<float>(k) + 0.5f) / static_cast<float>(pieces);
      const float u = u_[a] + w * du, v = v_[a] + w * dv;
      if (!inside(u, v)) continue;
      const int cell = (static_cast<int>(v * (1 / kCell_px) + 1)) * columns_ + static_cast<int>(u * (1 / kCell_px) + 1);
      placed_.push_back({cell, static_cast<int>(e)});
      ++cell_begin_[static_cast<std::size_t>(cell) + 1];
    }
  }
  for (std::size_t i = 1; i < cell_begin_.size(); ++i) cell_begin_[i] += cell_begin_[i - 1];
  entries_.resize(placed_.size());
  // Each cell's beginning moves to its end while it is filled, which is where the next one begins: put back below.
  for (const auto& [cell, e] : placed_) {
    const auto [a, b] = edges[e];
    const float du = u_[b] - u_[a], dv = v_[b] - v_[a], inverse = 1 / (du * du + dv * dv);
    const auto k = static_cast<std::size_t>(cell_begin_[cell]++);
    entries_.u[k] = u_[a];
    entries_.v[k] = v_[a];
    entries_.du[k] = du;
    entries_.dv[k] = dv;
    entries_.inverse_length2[k] = inverse;
    entries_.cos2[k] = (du * du - dv * dv) * inverse;
    entries_.sin2[k] = 2 * du * dv * inverse;
    entries_.edge[k] = e;
  }
  for (std::size_t i = cell_begin_.size() - 1; i > 0; --i) cell_begin_[i] = cell_begin_[i - 1];
  cell_begin_[0] = 0;
}

ProjectedEdges::Nearest ProjectedEdges::nearest(float u, float v, float cos2, float sin2, float gate_px,
                                                float min_cos2) const {
  return nearestWith(HWY_DYNAMIC_DISPATCH(nearestEntry), u, v, cos2, sin2, gate_px, min_cos2);
}

ProjectedEdges::Nearest ProjectedEdges::nearestWith(NearestEntry* nearest_entry, float u, float v, float cos2,
                                                    float sin2, float gate_px, float min_cos2) const {
  Nearest best;
  const float reach = gate_px + 0.5f * kCell_px;
  const auto cellOf = [](float x, int last) { return std::clamp(static_cast<int>(x * (1 / kCell_px) + 1), 0, last); };
  if (!(u > -1e6f && u < 1e6f && v > -1e6f && v < 1e6f)) return best;
  const int column_first = cellOf(std::max(u - reach, -kCell_px), columns_ - 1),
            column_last = cellOf(u + reach, columns_ - 1);
  const int row_first = cellOf(std::max(v - reach, -kCell_px), rows_ - 1), row_last = cellOf(v + reach, rows_ - 1);
  FoundEntry found{-1, 0, gate_px * gate_px};
  for (int row = row_first; row <= row_last;) {
    int ranges[2 * kMaxRows], count = 0;
    for (; row <= row_last && count < kMaxRows; ++row) {
      const std::size_t line = static_cast<std::size_t>(row) * columns_;
      const int begin = cell_begin_[line + column_first], end = cell_begin_[line + column_last + 1];
      if (begin == end) continue;
      ranges[2 * count] = begin;
      ranges[2 * count + 1] = end;
      ++count;
    }
    nearest_entry(entries_, ranges, count, u, v, cos2, sin2, min_cos2, found);
  }
  if (found.entry < 0) return best;
  const int k = found.entry;
  const float inverse_length = std::sqrt(entries_.inverse_length2[k]);
  best.edge = entries_.edge[k];
  best.along = found.along;
  best.normal_u = -entries_.dv[k] * inverse_length;
  best.normal_v = entries_.du[k] * inverse_length;
  best.distance2_px2 = found.distance2;
  best.offset_px = best.normal_u * (u - entries_.u[k]) + best.normal_v * (v - entries_.v[k]);
  return best;
}

int ProjectedEdges::nearestOfEach(const OrientedPoints& image, float gate_px, float min_cos2,
                                  std::vector<Nearest>& nearest) const {
  nearest.resize(image.size());
  const auto nearest_entry = HWY_DYNAMIC_DISPATCH(nearestEntry);
  int found = 0;
  for (std::size_t j = 0; j < nearest.size(); ++j) {
    nearest[j] = nearestWith(nearest_entry, image.u[j], image.v[j], image.cos2[j], image.sin2[j], gate_px, min_cos2);
    found += nearest[j].edge >= 0;
  }
  return found;
}

}  // namespace angio::registration
#endif
