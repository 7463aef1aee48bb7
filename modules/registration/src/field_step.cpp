// SPDX-License-Identifier: GPL-2.0-or-later
#include "field_step.hpp"

// Compiled once for every vector target by the include below; sampleField chooses at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "field_step.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::registration {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void samplePoints(const RawPoints& points, const RawView& view, const KernelField& field,
                  const std::vector<HalfPlane>& planes, const PullWeight& weighing, RawNormalEquations& equations,
                  FieldSums& out) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  using V = decltype(hn::Zero(d));
  const auto set = [&](float value) { return hn::Set(d, value); };
  const V zero = hn::Zero(d), one = set(1), half = set(0.5f);
  V H[21], g[6], fit = zero, seen = zero;
  for (auto& h : H) h = zero;
  for (auto& v : g) v = zero;
  const float* const cells = field.cells();
  const int columns = field.columns(), rows = field.rows();
  const float inverse_cell = 1 / field.cell_px(), inverse_scale2 = 1 / (field.scale_px() * field.scale_px());

  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int first = 0; first < points.count; first += lanes) {
    const auto load = [&](const float* values) { return hn::LoadU(d, values + first); };
    const V p[3] = {load(points.x), load(points.y), load(points.z)};
    const V q[3] = {load(points.tx), load(points.ty), load(points.tz)};
    V weight = load(points.weight);
    const auto row = [&](int r, const V* a) {
      return hn::MulAdd(set(view.R[3 * r]), a[0],
                        hn::MulAdd(set(view.R[3 * r + 1]), a[1], hn::Mul(set(view.R[3 * r + 2]), a[2])));
    };
    const V depth = hn::Add(row(2, p), set(view.t[2]));
    // Behind the source, or so near to it that a pixel loses its meaning, a point has no image.
    auto visible = hn::Gt(depth, set(1e-3f));
    const V inverse_depth = hn::Div(one, hn::IfThenElse(visible, depth, one));
    const V X = hn::Mul(hn::Add(row(0, p), set(view.t[0])), inverse_depth);
    const V Y = hn::Mul(hn::Add(row(1, p), set(view.t[1])), inverse_depth);
    const V u = hn::MulAdd(set(view.fx), X, set(view.cx)), v = hn::MulAdd(set(view.fy), Y, set(view.cy));
    for (const HalfPlane& plane : planes) {
      const V side = hn::MulAdd(set(plane.n_u), u, hn::MulAdd(set(plane.n_v), v, set(plane.d)));
      visible = hn::And(visible, hn::Ge(side, zero));
    }

    // Direction of the projected tangent, and how much of its length is left: a vessel seen end-on has none.
    const V qz = row(2, q);
    const V du = hn::NegMulAdd(X, qz, row(0, q)), dv = hn::NegMulAdd(Y, qz, row(1, q));
    const V length2 = hn::MulAdd(du, du, hn::Mul(dv, dv));
    const V inverse_length2 = hn::Div(one, hn::Max(length2, set(1e-12f)));
    const V length = hn::Min(hn::Sqrt(length2), one);
    const V cos2 = hn::Mul(hn::Mul(hn::MulSub(du, du, hn::Mul(dv, dv)), inverse_length2), length);
    const V sin2 = hn::Mul(hn::Mul(hn::Mul(hn::Add(du, du), dv), inverse_length2), length);
    weight = hn::IfThenElseZero(visible, hn::Mul(weight, length));
    seen = hn::Add(seen, weight);

    // Bilinear look-up. Points beyond the field read its first cell; they are in view, but nothing pulls them.
    const V column_at = hn::Mul(hn::Sub(u, set(field.u_origin_px())), set(inverse_cell));
    const V line_at = hn::Mul(hn::Sub(v, set(field.v_origin_px())), set(inverse_cell));
    const auto on_columns = hn::And(hn::Ge(column_at, zero), hn::Lt(column_at, set(static_cast<float>(columns - 1))));
    const auto on_rows = hn::And(hn::Ge(line_at, zero), hn::Lt(line_at, set(static_cast<float>(rows - 1))));
    const auto in_field = hn::And(visible, hn::And(on_columns, on_rows));
    const V column = hn::IfThenElseZero(in_field, column_at), line = hn::IfThenElseZero(in_field, line_at);
    const V column0 = hn::Floor(column), line0 = hn::Floor(line);
    const V a = hn::Sub(column, column0), b = hn::Sub(line, line0);
    const auto index =
        hn::ShiftLeft<2>(hn::Add(hn::Mul(hn::ConvertTo(di, line0), hn::Set(di, columns)), hn::ConvertTo(di, column0)));
    const auto corner = [&](int offset) {
      const auto at = hn::Add(index, hn::Set(di, 4 * offset));
      const V G0 = hn::GatherIndex(d, cells, at);
      const V Gc = hn::GatherIndex(d, cells + 1, at);
      const V Gs = hn::GatherIndex(d, cells + 2, at);
      return hn::Mul(half, hn::MulAdd(cos2, Gc, hn::MulAdd(sin2, Gs, G0)));
    };
    const V F00 = corner(0), F10 = corner(1), F01 = corner(columns), F11 = corner(columns + 1);
    const V along_top = hn::Sub(F10, F00), along_bottom = hn::Sub(F11, F01);
    const V F_top = hn::MulAdd(a, along_top, F00), F_bottom = hn::MulAdd(a, along_bottom, F01);
    const V F = hn::IfThenElseZero(in_field, hn::Max(zero, hn::MulAdd(b, hn::Sub(F_bottom, F_top), F_top)));
    const V scale = set(inverse_cell);
    const V gradient_u =
        hn::IfThenElseZero(in_field, hn::Mul(scale, hn::MulAdd(b, hn::Sub(along_bottom, along_top), along_top)));
    const V gradient_v = hn::IfThenElseZero(in_field, hn::Mul(scale, hn::Sub(F_bottom, F_top)));

    const V inverse_mass = hn::Div(one, hn::Add(F, set(weighing.outlier_mass)));
    const V found = hn::Mul(weight, hn::Mul(F, inverse_mass));
    fit = hn::Add(fit, found);
    const V pull = hn::Mul(weight, inverse_mass);             // Of the gradient,
    const V stiffness = hn::Mul(found, set(inverse_scale2));  // and of the Hessian.

    // d(T exp(dx) p) = R (v + w x p): a row r of (projection's Jacobian * R) gives [r, p x r].
    V ju[6], jv[6];
    const V scale_u = hn::Mul(set(view.fx), inverse_depth), scale_v = hn::Mul(set(view.fy), inverse_depth);
    for (int k = 0; k < 3; ++k) {
      ju[k] = hn::Mul(scale_u, hn::NegMulAdd(X, set(view.R[6 + k]), set(view.R[k])));
      jv[k] = hn::Mul(scale_v, hn::NegMulAdd(Y, set(view.R[6 + k]), set(view.R[3 + k])));
    }
    for (int k = 0; k < 3; ++k) {
      const int m = (k + 1) % 3, n = (k + 2) % 3;
      ju[3 + k] = hn::MulSub(p[m], ju[n], hn::Mul(p[n], ju[m]));
      jv[3 + k] = hn::MulSub(p[m], jv[n], hn::Mul(p[n], jv[m]));
    }
    // Stiffness is full across the vessel and a part of it along: the 2 x 2 weight matrix, from the tangent's double
    // angle.
    const V isotropic = hn::Mul(stiffness, set(0.5f * (1 + weighing.along)));
    const V deviator = hn::Mul(stiffness, set(0.5f * (1 - weighing.along)));
    const V Wuu = hn::NegMulAdd(deviator, cos2, isotropic), Wvv = hn::MulAdd(deviator, cos2, isotropic);
    const V Wuv = hn::Neg(hn::Mul(deviator, sin2));
    const V pull_u = hn::Mul(pull, gradient_u), pull_v = hn::Mul(pull, gradient_v);
    int entry = 0;
    for (int i = 0; i < 6; ++i) {
      const V wu = hn::MulAdd(Wuu, ju[i], hn::Mul(Wuv, jv[i])), wv = hn::MulAdd(Wuv, ju[i], hn::Mul(Wvv, jv[i]));
      for (int k = 0; k <= i; ++k, ++entry) H[entry] = hn::MulAdd(wu, ju[k], hn::MulAdd(wv, jv[k], H[entry]));
      g[i] = hn::MulAdd(pull_u, ju[i], hn::MulAdd(pull_v, jv[i], g[i]));
    }
  }
  const auto sum = [&](V value) { return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, value))); };
  for (int k = 0; k < 21; ++k) equations.H[k] = sum(H[k]);
  for (int k = 0; k < 6; ++k) equations.g[k] = sum(g[k]);
  out.fit = sum(fit);
  out.seen = sum(seen);
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::registration
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::registration {
HWY_EXPORT(samplePoints);

ModelPoints ModelPoints::of(const Eigen::Matrix3Xd& points_centered, const Eigen::Matrix3Xd& tangents,
                            const Eigen::VectorXd& weights, int stride) {
  ModelPoints m;
  const Eigen::Index n = points_centered.cols();
  for (Eigen::Index i = (stride - 1) / 2; i < n; i += stride) {
    const auto push = [](std::vector<float>& to, double value) { to.push_back(static_cast<float>(value)); };
    push(m.x, points_centered(0, i));
    push(m.y, points_centered(1, i));
    push(m.z, points_centered(2, i));
    push(m.tx, tangents(0, i));
    push(m.ty, tangents(1, i));
    push(m.tz, tangents(2, i));
    push(m.weight, weights[i]);
    ++m.count;
  }
  for (auto* values : {&m.x, &m.y, &m.z, &m.tx, &m.ty, &m.tz, &m.weight}) {
    values->resize(static_cast<std::size_t>(m.count) + kPadding, 0.0f);
  }
  return m;
}

void fieldOfView(const XrayView& view, std::vector<HalfPlane>& planes) {
  const float w = static_cast<float>(view.camera.width_px()) - 0.5f,
              h = static_cast<float>(view.camera.height_px()) - 0.5f;
  planes = {{1, 0, 0.5f}, {-1, 0, w}, {0, 1, 0.5f}, {0, -1, h}};
  const auto& corners = view.collimator_px;
  double area = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d a = corners[i], b = corners[(i + 1) % corners.size()];
    area += a.x() * b.y() - a.y() * b.x();
  }
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d a = corners[i], edge = corners[(i + 1) % corners.size()] - a;
    const Eigen::Vector2d inwards = (area >= 0 ? 1 : -1) * Eigen::Vector2d(-edge.y(), edge.x()).normalized();
    planes.push_back(
        {static_cast<float>(inwards.x()), static_cast<float>(inwards.y()), static_cast<float>(-inwards.dot(a))});
  }
}

FieldSums sampleField(const ModelPoints& model, const KernelField& field, const XrayCamera& camera,
                      const std::vector<HalfPlane>& field_of_view, const Pose& T_view_centered,
                      const PullWeight& weight) {
  RawNormalEquations equations;
  FieldSums sums;
  const RawView seen = rawView(camera, T_view_centered);
  HWY_DYNAMIC_DISPATCH(samplePoints)(model.raw(), seen, field, field_of_view, weight, equations, sums);
  equations.addTo(sums.H, sums.g);
  return sums;
}

std::vector<std::int64_t> fieldStepTargets() { return hwy::SupportedAndGeneratedTargets(); }

void useFieldStepTarget(std::int64_t target) { hwy::SetSupportedTargetsForTest(static_cast<std::uint32_t>(target)); }

}  // namespace angio::registration
#endif
