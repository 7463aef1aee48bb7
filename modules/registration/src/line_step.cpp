// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_step.hpp"

#include <algorithm>
#include <cmath>

// Compiled once for every vector target by the include below, which is chosen from at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "line_step.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef ANGIO_LINE_STEP_RAW
#define ANGIO_LINE_STEP_RAW
namespace angio {
// Plain numbers in and out of the vector code.
struct RawEntries {
  const float *u, *v, *du, *dv, *inverse_length2, *cos2, *sin2;
};
struct RawNearest {
  int entry;
  float along, distance2;
};
struct RawLineLook {
  const float *x, *y, *z, *normal_u, *normal_v, *u, *v;
  float* weighted_residual;
  int count;
  float R[9], t[3], fx, fy, cx, cy, inverse_two_tolerance2;
};
struct RawLineSums {
  double H[21], g[6], weight, squares;
};
}  // namespace angio
#endif

HWY_BEFORE_NAMESPACE();
namespace angio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The nearest of the entries in several ranges [begin, end): as many of them at a time as there are lanes.
void nearestEntry(const RawEntries& entries, const int* ranges, int range_count, float u, float v, float cos2,
                  float sin2, float least_cos2, RawNearest& best) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  auto best_distance2 = hn::Set(d, best.distance2), best_along = zero;
  auto best_entry = hn::Set(di, -1);
  for (int r = 0; r < range_count; ++r) {
    const int end = ranges[2 * r + 1];
    for (int k = ranges[2 * r]; k < end; k += lanes) {
      const auto x = hn::Sub(hn::Set(d, u), hn::LoadU(d, entries.u + k));
      const auto y = hn::Sub(hn::Set(d, v), hn::LoadU(d, entries.v + k));
      const auto du = hn::LoadU(d, entries.du + k), dv = hn::LoadU(d, entries.dv + k);
      const auto along = hn::Min(
          one, hn::Max(zero, hn::Mul(hn::MulAdd(x, du, hn::Mul(y, dv)), hn::LoadU(d, entries.inverse_length2 + k))));
      const auto rx = hn::NegMulAdd(along, du, x), ry = hn::NegMulAdd(along, dv, y);
      const auto distance2 = hn::MulAdd(rx, rx, hn::Mul(ry, ry));
      const auto cosine = hn::MulAdd(hn::LoadU(d, entries.cos2 + k), hn::Set(d, cos2),
                                     hn::Mul(hn::LoadU(d, entries.sin2 + k), hn::Set(d, sin2)));
      const auto index = hn::Iota(di, k);
      auto wins = hn::And(hn::Lt(distance2, best_distance2), hn::Ge(cosine, hn::Set(d, least_cos2)));
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

// Normal equations of the distances across the matched edges; a point without a match has no normal, and no weight.
void lineSums(const RawLineLook& in, RawLineSums& out) {
  const hn::ScalableTag<float> d;
  using V = decltype(hn::Zero(d));
  const auto set = [&](float value) { return hn::Set(d, value); };
  const V zero = hn::Zero(d), one = set(1);
  V H[21], g[6], weights = zero, squares = zero;
  for (auto& h : H) h = zero;
  for (auto& v : g) v = zero;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int first = 0; first < in.count; first += lanes) {
    const V p[3] = {hn::LoadU(d, in.x + first), hn::LoadU(d, in.y + first), hn::LoadU(d, in.z + first)};
    const V nu = hn::LoadU(d, in.normal_u + first), nv = hn::LoadU(d, in.normal_v + first);
    const auto row = [&](int r) {
      return hn::MulAdd(set(in.R[3 * r]), p[0],
                        hn::MulAdd(set(in.R[3 * r + 1]), p[1], hn::MulAdd(set(in.R[3 * r + 2]), p[2], set(in.t[r]))));
    };
    const V depth = row(2);
    const auto visible = hn::And(hn::Gt(depth, set(1e-3f)), hn::Gt(hn::MulAdd(nu, nu, hn::Mul(nv, nv)), set(0.5f)));
    const V inverse_depth = hn::Div(one, hn::IfThenElse(visible, depth, one));
    const V X = hn::Mul(row(0), inverse_depth), Y = hn::Mul(row(1), inverse_depth);
    const V ru = hn::Sub(hn::MulAdd(set(in.fx), X, set(in.cx)), hn::LoadU(d, in.u + first));
    const V rv = hn::Sub(hn::MulAdd(set(in.fy), Y, set(in.cy)), hn::LoadU(d, in.v + first));
    const V r = hn::IfThenElseZero(visible, hn::MulAdd(nu, ru, hn::Mul(nv, rv)));
    const V r2 = hn::Mul(r, r);
    // exp(-x) as (1 - x / 32)^32, without a table: two parts in a hundred off where it has fallen to a third, and a
    // weight need not be better than that.
    V weight = hn::Max(zero, hn::NegMulAdd(r2, set(in.inverse_two_tolerance2 / 32), one));
    for (int k = 0; k < 5; ++k) weight = hn::Mul(weight, weight);
    weight = hn::IfThenElseZero(visible, weight);
    const V ku = hn::Mul(hn::Mul(nu, set(in.fx)), inverse_depth), kv = hn::Mul(hn::Mul(nv, set(in.fy)), inverse_depth);
    const V kz = hn::Neg(hn::MulAdd(ku, X, hn::Mul(kv, Y)));
    V J[6];
    for (int k = 0; k < 3; ++k)
      J[k] = hn::MulAdd(set(in.R[k]), ku, hn::MulAdd(set(in.R[3 + k]), kv, hn::Mul(set(in.R[6 + k]), kz)));
    for (int k = 0; k < 3; ++k) {
      const int m = (k + 1) % 3, n = (k + 2) % 3;
      J[3 + k] = hn::MulSub(p[m], J[n], hn::Mul(p[n], J[m]));
    }
    const V wr = hn::Mul(weight, r);
    int entry = 0;
    for (int i = 0; i < 6; ++i) {
      const V wj = hn::Mul(weight, J[i]);
      for (int k = 0; k <= i; ++k, ++entry) H[entry] = hn::MulAdd(wj, J[k], H[entry]);
      g[i] = hn::MulAdd(wr, J[i], g[i]);
    }
    weights = hn::Add(weights, weight);
    squares = hn::MulAdd(wr, r, squares);
    hn::StoreU(hn::Mul(hn::Sqrt(weight), r), d, in.weighted_residual + first);
  }
  const auto sum = [&](V value) { return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, value))); };
  for (int k = 0; k < 21; ++k) out.H[k] = sum(H[k]);
  for (int k = 0; k < 6; ++k) out.g[k] = sum(g[k]);
  out.weight = sum(weights);
  out.squares = sum(squares);
}

}  // namespace HWY_NAMESPACE
}  // namespace angio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio {
HWY_EXPORT(nearestEntry);
HWY_EXPORT(lineSums);
namespace {

constexpr std::size_t kPadding = 16;  // Lanes of the widest target.
constexpr int kMostRows = 64;
constexpr float kCell_px = 16;
constexpr float kShortest_px = 0.05f;  // An edge seen shorter than this has no direction.

}  // namespace

void ProjectedEdges::Entries::resize(std::size_t size) {
  for (auto* values : {&u, &v, &du, &dv, &inverse_length2, &cos2, &sin2}) values->resize(size + kPadding);
  edge.resize(size + kPadding);
}

void ProjectedEdges::project(const Eigen::Matrix3Xd& points_centred, const std::vector<std::pair<int, int>>& edges,
                             const XrayCamera& camera, const Pose& T_view_centred) {
  const auto n = static_cast<std::size_t>(points_centred.cols());
  u_.resize(n);
  v_.resize(n);
  in_front_.resize(n);
  const Eigen::Matrix3d R = T_view_centred.linear();
  const Eigen::Vector3d t = T_view_centred.translation();
  const auto& c = camera.parameters();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d p = R * points_centred.col(static_cast<Eigen::Index>(i)) + t;
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
    const auto a = static_cast<std::size_t>(edges[e].first), b = static_cast<std::size_t>(edges[e].second);
    if (!in_front_[a] || !in_front_[b]) continue;
    if (!inside(u_[a], v_[a]) && !inside(u_[b], v_[b])) continue;
    const float du = u_[b] - u_[a], dv = v_[b] - v_[a], length2 = du * du + dv * dv;
    if (!(length2 > kShortest_px * kShortest_px) || !(length2 < 1e8f)) continue;
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
    const auto a = static_cast<std::size_t>(edges[static_cast<std::size_t>(e)].first),
               b = static_cast<std::size_t>(edges[static_cast<std::size_t>(e)].second);
    const float du = u_[b] - u_[a], dv = v_[b] - v_[a], inverse = 1 / (du * du + dv * dv);
    const auto k = static_cast<std::size_t>(cell_begin_[static_cast<std::size_t>(cell)]++);
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
                                                float least_cos2) const {
  return nearestWith(HWY_DYNAMIC_DISPATCH(nearestEntry), u, v, cos2, sin2, gate_px, least_cos2);
}

ProjectedEdges::Nearest ProjectedEdges::nearestWith(NearestEntry* nearest_entry, float u, float v, float cos2,
                                                    float sin2, float gate_px, float least_cos2) const {
  Nearest best;
  const float reach = gate_px + 0.5f * kCell_px;
  const auto cellOf = [](float x, int last) { return std::clamp(static_cast<int>(x * (1 / kCell_px) + 1), 0, last); };
  if (!(u > -1e6f && u < 1e6f && v > -1e6f && v < 1e6f)) return best;
  const int column_first = cellOf(std::max(u - reach, -kCell_px), columns_ - 1),
            column_last = cellOf(u + reach, columns_ - 1);
  const int row_first = cellOf(std::max(v - reach, -kCell_px), rows_ - 1), row_last = cellOf(v + reach, rows_ - 1);
  const RawEntries entries = {entries_.u.data(),
                              entries_.v.data(),
                              entries_.du.data(),
                              entries_.dv.data(),
                              entries_.inverse_length2.data(),
                              entries_.cos2.data(),
                              entries_.sin2.data()};
  RawNearest found{-1, 0, gate_px * gate_px};
  for (int row = row_first; row <= row_last;) {
    int ranges[2 * kMostRows], count = 0;
    for (; row <= row_last && count < kMostRows; ++row) {
      const std::size_t line = static_cast<std::size_t>(row) * columns_;
      const int begin = cell_begin_[line + column_first], end = cell_begin_[line + column_last + 1];
      if (begin == end) continue;
      ranges[2 * count] = begin;
      ranges[2 * count + 1] = end;
      ++count;
    }
    nearest_entry(entries, ranges, count, u, v, cos2, sin2, least_cos2, found);
  }
  if (found.entry < 0) return best;
  const auto k = static_cast<std::size_t>(found.entry);
  const float inverse_length = std::sqrt(entries_.inverse_length2[k]);
  best.edge = entries_.edge[k];
  best.along = found.along;
  best.normal_u = -entries_.dv[k] * inverse_length;
  best.normal_v = entries_.du[k] * inverse_length;
  best.distance2_px2 = found.distance2;
  return best;
}

void matchLines(const OrientedPoints& image, const ProjectedEdges& edges, double gate_px, double least_cos2,
                LineMatches& matches) {
  matches.of_point.resize(static_cast<std::size_t>(image.size()));
  matches.matched = 0;
  const auto nearest_entry = HWY_DYNAMIC_DISPATCH(nearestEntry);
  for (std::size_t j = 0; j < matches.of_point.size(); ++j) {
    matches.of_point[j] = edges.nearestWith(nearest_entry, image.u[j], image.v[j], image.cos2[j], image.sin2[j],
                                            static_cast<float>(gate_px), static_cast<float>(least_cos2));
    matches.matched += matches.of_point[j].edge >= 0;
  }
}

double LineSums::togetherness(int points) const {
  // Autocorrelation at lags 1, 2, 4, ...; each stands for the lags around it. Below what chance gives it counts as
  // none, and so do all further ones.
  double together = 1;
  const double chance = 2 / std::sqrt(std::max(1.0, static_cast<double>(points)));
  for (int k = 0; k < kLags; ++k) {
    const double correlation = lagged_px2[static_cast<std::size_t>(k)] / std::max(1e-12, squares_px2);
    if (correlation < chance) break;
    const double lags = k == 0 ? 1 : 0.75 * (1 << k);  // From half-way to the lag before to half-way to the next.
    together += 2 * lags * correlation;
  }
  return together;
}

void resolveMatches(const Eigen::Matrix3Xd& points_centred, const std::vector<std::pair<int, int>>& edges,
                    LineMatches& matches) {
  const std::size_t n = matches.of_point.size();
  for (auto* values :
       {&matches.x, &matches.y, &matches.z, &matches.normal_u, &matches.normal_v, &matches.weighted_residual}) {
    values->assign(n + kPadding, 0.0f);
  }
  for (std::size_t j = 0; j < n; ++j) {
    const auto& match = matches.of_point[j];
    if (match.edge < 0) continue;
    const auto& edge = edges[static_cast<std::size_t>(match.edge)];
    const auto a = points_centred.col(edge.first), b = points_centred.col(edge.second);
    const double w = match.along;
    matches.x[j] = static_cast<float>(a.x() + w * (b.x() - a.x()));
    matches.y[j] = static_cast<float>(a.y() + w * (b.y() - a.y()));
    matches.z[j] = static_cast<float>(a.z() + w * (b.z() - a.z()));
    matches.normal_u[j] = match.normal_u;
    matches.normal_v[j] = match.normal_v;
  }
}

void addLineEquations(const OrientedPoints& image, LineMatches& matches, const XrayCamera& camera,
                      const Pose& T_view_centred, double tolerance_px, LineSums& sums) {
  RawLineLook in;
  in.x = matches.x.data();
  in.y = matches.y.data();
  in.z = matches.z.data();
  in.normal_u = matches.normal_u.data();
  in.normal_v = matches.normal_v.data();
  in.u = image.u.data();
  in.v = image.v.data();
  in.weighted_residual = matches.weighted_residual.data();
  in.count = image.size();
  for (int i = 0; i < 9; ++i) in.R[i] = static_cast<float>(T_view_centred.linear()(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) in.t[i] = static_cast<float>(T_view_centred.translation()[i]);
  in.fx = static_cast<float>(camera.parameters().fx_px);
  in.fy = static_cast<float>(camera.parameters().fy_px);
  in.cx = static_cast<float>(camera.parameters().cx_px);
  in.cy = static_cast<float>(camera.parameters().cy_px);
  in.inverse_two_tolerance2 = static_cast<float>(1 / (2 * tolerance_px * tolerance_px));
  RawLineSums raw;
  HWY_DYNAMIC_DISPATCH(lineSums)(in, raw);
  for (int i = 0, entry = 0; i < 6; ++i) {
    sums.g[i] += raw.g[i];
    for (int k = 0; k <= i; ++k, ++entry) {
      sums.H(i, k) += raw.H[entry];
      if (k != i) sums.H(k, i) += raw.H[entry];
    }
  }
  sums.weight += raw.weight;
  sums.squares_px2 += raw.squares;
  for (int k = 0; k < LineSums::kLags; ++k) {
    const int lag = 1 << k;
    float product = 0;
    for (int j = 0; j + lag < image.size(); ++j) {
      product += matches.weighted_residual[static_cast<std::size_t>(j)] *
                 matches.weighted_residual[static_cast<std::size_t>(j + lag)];
    }
    sums.lagged_px2[static_cast<std::size_t>(k)] += product;
  }
}

}  // namespace angio
#endif
