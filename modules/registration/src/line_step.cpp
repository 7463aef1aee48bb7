// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_step.hpp"

#include <algorithm>
#include <cmath>

#include "raw_view.hpp"

// Compiled once for every vector target by the include below, which is chosen from at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "line_step.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::registration {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Normal equations of the distances across the matched edges; a point without a match has no normal, and no weight.
void lineSums(const OrientedPoints& image, const RawView& view, float inverse_two_tolerance2, LineMatches& matches,
              RawNormalEquations& equations, LineSums& out) {
  const hn::ScalableTag<float> d;
  using V = decltype(hn::Zero(d));
  const auto set = [&](float value) { return hn::Set(d, value); };
  const V zero = hn::Zero(d), one = set(1);
  V H[21], g[6], weights = zero, squares = zero;
  for (auto& h : H) h = zero;
  for (auto& v : g) v = zero;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int first = 0; first < image.size(); first += lanes) {
    const V p[3] = {hn::LoadU(d, matches.x.data() + first), hn::LoadU(d, matches.y.data() + first),
                    hn::LoadU(d, matches.z.data() + first)};
    const V nu = hn::LoadU(d, matches.normal_u.data() + first), nv = hn::LoadU(d, matches.normal_v.data() + first);
    const auto row = [&](int r) {
      return hn::MulAdd(
          set(view.R[3 * r]), p[0],
          hn::MulAdd(set(view.R[3 * r + 1]), p[1], hn::MulAdd(set(view.R[3 * r + 2]), p[2], set(view.t[r]))));
    };
    const V depth = row(2);
    const auto visible = hn::And(hn::Gt(depth, set(1e-3f)), hn::Gt(hn::MulAdd(nu, nu, hn::Mul(nv, nv)), set(1e-3f)));
    const V inverse_depth = hn::Div(one, hn::IfThenElse(visible, depth, one));
    const V X = hn::Mul(row(0), inverse_depth), Y = hn::Mul(row(1), inverse_depth);
    const V ru = hn::Sub(hn::MulAdd(set(view.fx), X, set(view.cx)), hn::LoadU(d, image.u.data() + first));
    const V rv = hn::Sub(hn::MulAdd(set(view.fy), Y, set(view.cy)), hn::LoadU(d, image.v.data() + first));
    const V r = hn::IfThenElseZero(visible, hn::MulAdd(nu, ru, hn::Mul(nv, rv)));
    const V r2 = hn::Mul(r, r);
    // exp(-x) as (1 - x / 32)^32, without a table: two parts in a hundred off where it has fallen to a third, and a
    // weight need not be better than that.
    V weight = hn::Max(zero, hn::NegMulAdd(r2, set(inverse_two_tolerance2 / 32), one));
    for (int k = 0; k < 5; ++k) weight = hn::Mul(weight, weight);
    weight = hn::IfThenElseZero(visible, weight);
    const V ku = hn::Mul(hn::Mul(nu, set(view.fx)), inverse_depth),
            kv = hn::Mul(hn::Mul(nv, set(view.fy)), inverse_depth);
    const V kz = hn::Neg(hn::MulAdd(ku, X, hn::Mul(kv, Y)));
    V J[6];
    for (int k = 0; k < 3; ++k)
      J[k] = hn::MulAdd(set(view.R[k]), ku, hn::MulAdd(set(view.R[3 + k]), kv, hn::Mul(set(view.R[6 + k]), kz)));
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
    hn::StoreU(hn::Mul(hn::Sqrt(weight), r), d, matches.weighted_residual.data() + first);
  }
  const auto sum = [&](V value) { return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, value))); };
  for (int k = 0; k < 21; ++k) equations.H[k] = sum(H[k]);
  for (int k = 0; k < 6; ++k) equations.g[k] = sum(g[k]);
  out.weight += sum(weights);
  out.squares_px2 += sum(squares);
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::registration
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::registration {
HWY_EXPORT(lineSums);

// Two tubes are seen as one line when their centres are nearer to each other than this many radii of what is seen.
constexpr float kMergedRadii = 1.3f;
// Edges nearer than this to each other say the same, as those of one vessel do.
constexpr float kApart_px = 0.5f;
// What is left of such a point: it still holds the pose across the line, to some pixels.
constexpr float kSharedCertainty = 0.2f;

void matchLines(const OrientedPoints& image, const ProjectedEdges& edges, double gate_px, double min_cos2,
                LineMatches& matches) {
  matches.matched =
      edges.nearestOfEach(image, static_cast<float>(gate_px), static_cast<float>(min_cos2), matches.of_point);
  for (std::size_t j = 0; j < matches.of_point.size(); ++j) {
    matches.of_point[j].normal_u *= image.certainty[j];
    matches.of_point[j].normal_v *= image.certainty[j];
  }
}

void softenShared(const OrientedPoints& image, const ProjectedEdges& edges, double min_cos2, LineMatches& matches) {
  for (std::size_t j = 0; j < matches.of_point.size(); ++j) {
    auto& match = matches.of_point[j];
    const float half_reach = 0.5f * kMergedRadii * image.radius_px[j];
    if (match.edge < 0 || !(half_reach > 0)) continue;
    const float length = std::hypot(match.normal_u, match.normal_v);
    const float n_u = match.normal_u / length, n_v = match.normal_v / length;
    for (const float side : {-half_reach, half_reach}) {
      const auto other = edges.nearest(image.u[j] + side * n_u, image.v[j] + side * n_v, image.cos2[j], image.sin2[j],
                                       half_reach, static_cast<float>(min_cos2));
      if (other.edge < 0) continue;
      // Where both edges cross the normal, from the image's point on.
      const float alike = other.normal_u * n_u + other.normal_v * n_v;
      if (std::abs(side - other.offset_px * alike + match.offset_px) < kApart_px) continue;
      match.normal_u *= kSharedCertainty;
      match.normal_v *= kSharedCertainty;
      break;
    }
  }
}

double LineSums::togetherness(int points) const {
  // Autocorrelation at lags 1, 2, 4, ...; each stands for the lags around it. Below what chance gives it counts as
  // none, and so do all further ones.
  double together = 1;
  const double chance = 2 / std::sqrt(std::max(1.0, static_cast<double>(points)));
  for (int k = 0; k < kLags; ++k) {
    const double correlation = lagged_px2[k] / std::max(1e-12, squares_px2);
    if (correlation < chance) break;
    const double lags = k == 0 ? 1 : 0.75 * (1 << k);  // From half-way to the lag before to half-way to the next.
    together += 2 * lags * correlation;
  }
  return together;
}

double noiseBehind(double weighted_square, double tau) {
  const double inverse = 1 / std::max(1e-12, weighted_square) - 1 / (tau * tau);
  return inverse > 0.1 / (tau * tau) ? std::sqrt(1 / inverse) : std::sqrt(10.0) * tau;
}

void resolveMatches(const Eigen::Matrix3Xd& points_centered, const std::vector<std::pair<int, int>>& edges,
                    LineMatches& matches) {
  const std::size_t n = matches.of_point.size();
  for (auto* values :
       {&matches.x, &matches.y, &matches.z, &matches.normal_u, &matches.normal_v, &matches.weighted_residual}) {
    values->assign(n + kPadding, 0.0f);
  }
  for (std::size_t j = 0; j < n; ++j) {
    const auto& match = matches.of_point[j];
    if (match.edge < 0) continue;
    const auto& edge = edges[match.edge];
    const auto a = points_centered.col(edge.first), b = points_centered.col(edge.second);
    const double w = match.along;
    matches.x[j] = static_cast<float>(a.x() + w * (b.x() - a.x()));
    matches.y[j] = static_cast<float>(a.y() + w * (b.y() - a.y()));
    matches.z[j] = static_cast<float>(a.z() + w * (b.z() - a.z()));
    matches.normal_u[j] = match.normal_u;
    matches.normal_v[j] = match.normal_v;
  }
}

void addLineEquations(const OrientedPoints& image, LineMatches& matches, const XrayCamera& camera,
                      const Pose& T_view_centered, double tolerance_px, LineSums& sums) {
  RawNormalEquations equations;
  const auto inverse_two_tolerance2 = static_cast<float>(1 / (2 * tolerance_px * tolerance_px));
  HWY_DYNAMIC_DISPATCH(lineSums)
  (image, rawView(camera, T_view_centered), inverse_two_tolerance2, matches, equations, sums);
  equations.addTo(sums.H, sums.g);
  for (int k = 0; k < LineSums::kLags; ++k) {
    const int lag = 1 << k;
    float product = 0;
    for (int j = 0; j + lag < image.size(); ++j) {
      product += matches.weighted_residual[j] * matches.weighted_residual[j + lag];
    }
    sums.lagged_px2[k] += product;
  }
}

}  // namespace angio::registration
#endif
