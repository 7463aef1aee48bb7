// SPDX-License-Identifier: GPL-2.0-or-later
#include "pose_bounds.hpp"

#include "angio/geometry/so3.hpp"

// Compiled once for every vector target by the include below; prepare and pointsBound choose at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pose_bounds.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef ANGIO_POSE_BOUNDS_RAW
#define ANGIO_POSE_BOUNDS_RAW
namespace angio::registration {
// Plain numbers in and out of the vector code.
struct RawCell {
  RawPoints samples;
  RawView view;   // Its rotation is that of the cell's middle.
  float G[3][3];  // A step d of the rotation vector turns by G d, to first order; [j] is the turn by a step along j.
  float half[3], half_norm, depth, half_depth;
  float ray_x, ray_y, ray_range, half_ray;  // Middles of rays lie within the range.
  ImageWindow window;                       // The open one.
};
}  // namespace angio::registration
#endif

HWY_BEFORE_NAMESPACE();
namespace angio::registration {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Direction of (du, dv), undirected, in [-pi/2, pi/2], to 1e-4 rad.
template <class D, class V>
V directionOf(D d, V du, V dv) {
  const V ax = hn::Abs(du), ay = hn::Abs(dv);
  const V most = hn::Max(hn::Max(ax, ay), hn::Set(d, 1e-20f)), least = hn::Min(ax, ay);
  const V s = hn::Div(least, most), s2 = hn::Mul(s, s);
  // Abramowitz and Stegun 4.4.49: arctan on [0, 1] to 1e-5.
  V series = hn::MulAdd(s2, hn::Set(d, 0.0208351f), hn::Set(d, -0.0851330f));
  series = hn::MulAdd(s2, series, hn::Set(d, 0.1801410f));
  series = hn::MulAdd(s2, series, hn::Set(d, -0.3302995f));
  series = hn::MulAdd(s2, series, hn::Set(d, 0.9998660f));
  V phi = hn::Mul(s, series);
  phi = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(d, 1.57079633f), phi), phi);
  const auto falling = hn::Lt(hn::Mul(du, dv), hn::Zero(d));
  return hn::IfThenElse(falling, hn::Neg(phi), phi);
}

void prepareBounds(const RawCell& in, const ExplainedRaster::Levels& levels, BoundedSamples& out) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du32;
  using V = decltype(hn::Zero(d));
  const auto set = [&](float value) { return hn::Set(d, value); };
  const V zero = hn::Zero(d), one = set(1);
  constexpr float kBefore_px = ExplainedRaster::kBefore_px;
  V effects[5];
  for (auto& e : effects) e = zero;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int first = 0; first < in.samples.count; first += lanes) {
    const auto load = [&](const float* values) { return hn::LoadU(d, values + first); };
    const V p[3] = {load(in.samples.x), load(in.samples.y), load(in.samples.z)};
    const V s[3] = {load(in.samples.tx), load(in.samples.ty), load(in.samples.tz)};
    const V norm = load(in.samples.weight);
    const float* const R = in.view.R;
    const auto row = [&](int r, const V* a) {
      return hn::MulAdd(set(R[3 * r]), a[0], hn::MulAdd(set(R[3 * r + 1]), a[1], hn::Mul(set(R[3 * r + 2]), a[2])));
    };
    const V X = row(0, p), Y = row(1, p), Z = row(2, p);
    const V tx = row(0, s), ty = row(1, s), tz = row(2, s);
    const V depth = hn::Add(Z, set(in.depth));
    const V usable = hn::Max(depth, set(1e-3f));
    const V inverse = hn::Div(one, usable);
    // Of the middle of all rays; with others it may differ by `spread`.
    const V per_ray = hn::Mul(set(in.depth), inverse);
    const V xm = hn::Mul(hn::MulAdd(set(in.ray_x), set(in.depth), X), inverse);
    const V ym = hn::Mul(hn::MulAdd(set(in.ray_y), set(in.depth), Y), inverse);
    const V x_spread = hn::Mul(set(in.ray_range), per_ray), y_spread = hn::Mul(set(in.ray_range), per_ray);
    const V x_slant = hn::Add(one, hn::Add(hn::Abs(xm), x_spread)),
            y_slant = hn::Add(one, hn::Add(hn::Abs(ym), y_spread));

    // How far a turn moves a place along x - x_image z, y - y_image z and z, and the tangent alike: to first order,
    // and what is left.
    const V second = set(0.75f * in.half_norm * in.half_norm), rest = hn::Mul(second, norm),
            most = hn::Mul(set(in.half_norm), norm);
    V turn_x = zero, turn_y = zero, turn_z = zero, bend_x = zero, bend_y = zero, bend_z = zero;
    V by_turn[3];
    for (int j = 0; j < 3; ++j) {
      const V gx = set(in.G[j][0]), gy = set(in.G[j][1]), gz = set(in.G[j][2]), h = set(in.half[j]);
      const V ax = hn::MulSub(gy, Z, hn::Mul(gz, Y)), ay = hn::MulSub(gz, X, hn::Mul(gx, Z)),
              az = hn::MulSub(gx, Y, hn::Mul(gy, X));
      const V along_x = hn::Mul(h, hn::Abs(hn::NegMulAdd(xm, az, ax))),
              along_y = hn::Mul(h, hn::Abs(hn::NegMulAdd(ym, az, ay)));
      turn_x = hn::Add(turn_x, along_x);
      turn_y = hn::Add(turn_y, along_y);
      turn_z = hn::MulAdd(h, hn::Abs(az), turn_z);
      by_turn[j] = hn::Add(along_x, along_y);
      const V bx = hn::MulSub(gy, tz, hn::Mul(gz, ty)), by = hn::MulSub(gz, tx, hn::Mul(gx, tz)),
              bz = hn::MulSub(gx, ty, hn::Mul(gy, tx));
      bend_x = hn::MulAdd(h, hn::Abs(hn::NegMulAdd(xm, bz, bx)), bend_x);
      bend_y = hn::MulAdd(h, hn::Abs(hn::NegMulAdd(ym, bz, by)), bend_y);
      bend_z = hn::MulAdd(h, hn::Abs(bz), bend_z);
    }
    const V far_x = hn::Min(hn::MulAdd(rest, x_slant, hn::MulAdd(x_spread, turn_z, turn_x)), hn::Mul(most, x_slant));
    const V far_y = hn::Min(hn::MulAdd(rest, y_slant, hn::MulAdd(y_spread, turn_z, turn_y)), hn::Mul(most, y_slant));
    const V far_z = hn::Min(hn::Add(turn_z, rest), most);
    // A change of depth moves a place along the centroid's ray.
    const V along_ray_x = hn::MulAdd(set(in.ray_range), hn::Abs(Z), hn::Abs(hn::MulSub(set(in.ray_x), Z, X)));
    const V along_ray_y = hn::MulAdd(set(in.ray_range), hn::Abs(Z), hn::Abs(hn::MulSub(set(in.ray_y), Z, Y)));
    const V deeper = hn::Mul(set(in.half_depth), inverse);
    const V sideways = set(in.half_ray * (in.depth + in.half_depth));
    const V nearest = hn::Sub(depth, hn::Add(far_z, set(in.half_depth)));
    const auto in_front = hn::Gt(nearest, set(0.02f));
    const V inverse_nearest = hn::Div(set(1.00001f), hn::Max(nearest, set(0.02f)));
    const V off_x = hn::Mul(inverse_nearest, hn::Add(hn::Add(far_x, sideways), hn::Mul(deeper, along_ray_x)));
    const V off_y = hn::Mul(inverse_nearest, hn::Add(hn::Add(far_y, sideways), hn::Mul(deeper, along_ray_y)));
    const V radius = hn::Add(hn::Max(hn::Mul(set(in.view.fx), off_x), hn::Mul(set(in.view.fy), off_y)), set(0.05f));

    // The level whose words cover the radius.
    auto level = hn::Zero(di);
    for (int k = 0; k + 1 < ExplainedRaster::kLevels; ++k) {
      level = hn::IfThenElse(hn::RebindMask(di, hn::Gt(radius, set(levels.radius_px[k]))), hn::Set(di, k + 1), level);
    }
    level = hn::IfThenElse(hn::RebindMask(di, in_front), level, hn::Set(di, ExplainedRaster::kLevels - 1));
    const V inverse_cell = hn::GatherIndex(d, levels.inverse_cell_px, level);
    const V scale_u = hn::Mul(set(in.view.fx), inverse), scale_v = hn::Mul(set(in.view.fy), inverse);
    hn::StoreU(hn::Mul(inverse_cell, hn::MulAdd(scale_u, X, set(in.view.cx + kBefore_px))), d, out.u + first);
    hn::StoreU(hn::Mul(inverse_cell, hn::MulAdd(scale_v, Y, set(in.view.cy + kBefore_px))), d, out.v + first);
    hn::StoreU(hn::Mul(inverse_cell, hn::Mul(scale_u, set(in.depth))), d, out.u_per_ray + first);
    hn::StoreU(hn::Mul(inverse_cell, hn::Mul(scale_v, set(in.depth))), d, out.v_per_ray + first);
    hn::StoreU(hn::GatherIndex(d, levels.last_column, level), d, out.u_last + first);
    hn::StoreU(hn::GatherIndex(d, levels.last_row, level), d, out.v_last + first);
    const auto edge = [&](float pixel, V inward) {
      return hn::Mul(inverse_cell, hn::Add(set(pixel + kBefore_px), inward));
    };
    // Where a place may be anywhere, it is not seen in all poses.
    const auto somewhere = hn::And(in_front, hn::Gt(inverse_cell, zero));
    const auto nowhere = [&](V at) { return hn::IfThenElse(somewhere, at, set(1e9f)); };
    hn::StoreU(nowhere(edge(in.window.u_min, radius)), d, out.u_seen + first);
    hn::StoreU(edge(in.window.u_max, hn::Neg(radius)), d, out.u_seen_to + first);
    hn::StoreU(nowhere(edge(in.window.v_min, radius)), d, out.v_seen + first);
    hn::StoreU(edge(in.window.v_max, hn::Neg(radius)), d, out.v_seen_to + first);
    hn::StoreU(hn::GatherIndex(di, levels.first, level), di, out.first + first);
    hn::StoreU(hn::GatherIndex(di, levels.columns, level), di, out.columns + first);

    // Directions that the projected tangent (tx - x tz, ty - y tz) may have: those of a rectangle about its middle.
    const V x_off = hn::Add(x_spread, off_x), y_off = hn::Add(y_spread, off_y);
    const V more = set(in.half_norm);  // A unit vector moves no further, nor along z.
    const V bend_z_max = hn::Min(hn::Add(bend_z, second), more);
    const V wide_x = hn::Add(hn::MulAdd(second, hn::Add(x_slant, off_x), hn::MulAdd(x_off, bend_z_max, bend_x)),
                             hn::MulAdd(x_off, hn::Abs(tz), set(1e-5f)));
    const V wide_y = hn::Add(hn::MulAdd(second, hn::Add(y_slant, off_y), hn::MulAdd(y_off, bend_z_max, bend_y)),
                             hn::MulAdd(y_off, hn::Abs(tz), set(1e-5f)));
    const V aspect = set(in.view.fy / in.view.fx);
    const V du = hn::NegMulAdd(xm, tz, tx), dv = hn::Mul(aspect, hn::NegMulAdd(ym, tz, ty));
    const V wide_v = hn::Mul(aspect, wide_y);
    const V length = hn::Sqrt(hn::MulAdd(du, du, hn::Mul(dv, dv)));
    const V adu = hn::Abs(du), adv = hn::Abs(dv);
    const V across = hn::MulAdd(wide_x, adv, hn::Mul(wide_v, adu));  // Times the length.
    const V left = hn::NegMulAdd(wide_x, adu, hn::NegMulAdd(wide_v, adv, hn::Mul(length, length)));
    const V turned = hn::Add(hn::Div(across, hn::Max(left, set(1e-12f))), set(0.004f));
    const auto known = hn::And(in_front, hn::And(hn::Gt(left, set(1e-12f)), hn::Lt(turned, set(1.5f))));
    const V phi = directionOf(d, du, dv);
    const V bins = set(static_cast<float>(ExplainedRaster::kDirections / 3.14159265358979323846));
    const V lowest = hn::Floor(hn::Mul(bins, hn::Sub(phi, turned))),
            highest = hn::Floor(hn::Mul(bins, hn::Add(phi, turned)));
    const auto low = hn::ConvertTo(di, hn::IfThenElseZero(known, lowest));
    const auto span = hn::ConvertTo(di, hn::IfThenElse(known, hn::Sub(highest, lowest), set(31)));
    const auto bits = hn::BitCast(du32, hn::Add(span, hn::Set(di, 1)));
    const auto ones =
        hn::IfThenElse(hn::Lt(bits, hn::Set(du32, 32u)),
                       hn::Sub(hn::Shl(hn::Set(du32, 1u), hn::And(bits, hn::Set(du32, 31u))), hn::Set(du32, 1u)),
                       hn::Set(du32, 0xffffffffu));
    const auto by = hn::And(hn::BitCast(du32, low), hn::Set(du32, 31u));
    const auto back = hn::And(hn::Sub(hn::Set(du32, 32u), by), hn::Set(du32, 31u));
    hn::StoreU(hn::Or(hn::Shl(ones, by), hn::Shr(ones, back)), du32, out.directions + first);

    const V pixels = hn::IfThenElseZero(in_front, hn::Mul(set(in.view.fx), inverse_nearest));
    for (int j = 0; j < 3; ++j) effects[j] = hn::MulAdd(pixels, by_turn[j], effects[j]);
    effects[3] = hn::MulAdd(pixels, hn::Mul(deeper, hn::Add(along_ray_x, along_ray_y)), effects[3]);
    effects[4] = hn::MulAdd(pixels, sideways, effects[4]);
  }
  for (int k = 0; k < 5; ++k) out.effects[k] = hn::GetLane(hn::SumOfLanes(d, effects[k]));
}

int countBound(const BoundedSamples& in, const std::uint32_t* words, float ray_x, float ray_y, int enough) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du32;
  const auto zero = hn::Zero(d), x = hn::Set(d, ray_x), y = hn::Set(d, ray_y);
  const int lanes = static_cast<int>(hn::Lanes(d));
  // Points are counted from the most there may be downward: a sample that is not explained loses its own.
  const int most = PoseBounds::maxPoints(), may_lose = most - enough;
  int lost = 0, next_check = 64;
  for (int first = 0; first < TreeSamples::kCount; first += lanes) {
    const auto u = hn::MulAdd(x, hn::LoadU(d, in.u_per_ray + first), hn::LoadU(d, in.u + first));
    const auto v = hn::MulAdd(y, hn::LoadU(d, in.v_per_ray + first), hn::LoadU(d, in.v + first));
    const auto c = hn::ConvertTo(di, hn::Max(zero, hn::Min(u, hn::LoadU(d, in.u_last + first))));
    const auto r = hn::ConvertTo(di, hn::Max(zero, hn::Min(v, hn::LoadU(d, in.v_last + first))));
    const auto at = hn::Add(hn::LoadU(di, in.first + first), hn::Add(hn::Mul(r, hn::LoadU(di, in.columns + first)), c));
    const auto word = hn::GatherIndex(du32, words, at);
    const auto shared = hn::And(word, hn::LoadU(du32, in.directions + first));
    const auto missed = hn::RebindMask(d, hn::Eq(shared, hn::Zero(du32)));
    const auto in_u =
        hn::And(hn::Ge(u, hn::LoadU(d, in.u_seen + first)), hn::Le(u, hn::LoadU(d, in.u_seen_to + first)));
    const auto in_v =
        hn::And(hn::Ge(v, hn::LoadU(d, in.v_seen + first)), hn::Le(v, hn::LoadU(d, in.v_seen_to + first)));
    const auto seen = hn::And(missed, hn::And(in_u, in_v));
    lost += PoseBounds::kExplained * static_cast<int>(hn::CountTrue(d, missed)) +
            in.unexplained * static_cast<int>(hn::CountTrue(d, seen));
    if (first + lanes >= next_check) {
      next_check += 32;
      if (lost > may_lose) return -1;
    }
  }
  return lost <= may_lose ? most - lost : -1;
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::registration
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::registration {
HWY_EXPORT(prepareBounds);
HWY_EXPORT(countBound);
namespace {

// A vessel's direction is that of a chord so far to both sides.
constexpr double kSmooth_m = 1.5e-3;

}  // namespace

TreeSamples::TreeSamples(const VesselTree& tree) : points(3, kCount), tangents(3, kCount) {
  const double apart = tree.length() / kCount;
  int k = 0;
  double before = 0;          // Length up to the edge.
  constexpr int kStep = 159;  // Odd, and near to the golden section of the count.
  const auto along = [&](const std::vector<int>& branch, int from, const Eigen::Vector3d& at, int direction) {
    // The place so far along a branch, or its end.
    Eigen::Vector3d here = at;
    double left = kSmooth_m;
    for (int i = from; i >= 0 && i < static_cast<int>(branch.size()); i += direction) {
      const Eigen::Vector3d next = tree.points().col(branch[i]);
      const double length = (next - here).norm();
      if (length >= left) return Eigen::Vector3d(here + left / length * (next - here));
      left -= length;
      here = next;
    }
    return here;
  };
  for (const auto& branch : tree.branches()) {
    for (int i = 1; i < static_cast<int>(branch.size()); ++i) {
      const Eigen::Vector3d a = tree.points().col(branch[i - 1]), b = tree.points().col(branch[i]);
      const double length = (b - a).norm();
      for (; k < kCount && (k + 0.5) * apart <= before + length; ++k) {
        const Eigen::Index column = k * kStep % kCount;
        const Eigen::Vector3d at = a + (((k + 0.5) * apart - before) / length) * (b - a);
        points.col(column) = at - tree.centroid();
        const Eigen::Vector3d chord = along(branch, i, at, 1) - along(branch, i - 1, at, -1);
        tangents.col(column) = chord.norm() > 0.1 * kSmooth_m ? chord.normalized() : (b - a) / length;
      }
      before += length;
    }
  }
  const Eigen::VectorXd norm = (1.000001 * points.colwise().norm().array() + 1e-9).matrix().transpose();
  floats = ModelPoints::of(points, tangents, norm, 1);
}

ImageWindow openWindow(const XrayView& view) {
  const double u_last = view.camera.width_px() - 0.5, v_last = view.camera.height_px() - 0.5;
  ImageWindow window{-0.5, -0.5, u_last, v_last};
  if (view.collimator_px.empty()) return window;
  Eigen::Vector2d least(u_last, v_last), most(-0.5, -0.5);
  for (const Eigen::Vector2d& corner : view.collimator_px) {
    least = least.cwiseMin(corner).cwiseMax(Eigen::Vector2d(-0.5, -0.5));
    most = most.cwiseMax(corner).cwiseMin(Eigen::Vector2d(u_last, v_last));
  }
  // Of the rectangle around the edges so much that all of its corners are open.
  const Eigen::Vector2d middle = 0.5 * (least + most);
  for (double share = 1; share > 0; share -= 0.01) {
    const Eigen::Vector2d half = 0.5 * share * (most - least);
    window = {middle.x() - half.x(), middle.y() - half.y(), middle.x() + half.x(), middle.y() + half.y()};
    if (view.sees({window.u_min, window.v_min}) && view.sees({window.u_max, window.v_min}) &&
        view.sees({window.u_min, window.v_max}) && view.sees({window.u_max, window.v_max}))
      return window;
  }
  return {1, 1, 0, 0};  // Nothing has to be seen.
}

PoseBounds::PoseBounds(const TreeSamples& samples, const ExplainedRaster& raster, const XrayView& view,
                       const Eigen::Matrix3d& R0, int unexplained)
    : samples_(samples),
      raster_(raster),
      camera_(view.camera),
      window_(openWindow(view)),
      R0_(R0),
      unexplained_(unexplained) {
  bounded_.unexplained = unexplained;
}

void PoseBounds::prepare(const PoseCell& cell, const RayCell& rays, double half_ray) {
  // A little more than asked for, so that rounding to single precision leaves nothing out.
  constexpr double kMore = 1 + 1e-5;
  Pose middle = Pose::Identity();
  middle.linear() = expSO3(cell.rotation) * R0_;
  const Eigen::Matrix3d G = leftJacobianSO3(cell.rotation);
  const auto more = [](double value) { return static_cast<float>(kMore * value + 1e-7); };
  RawCell in{};
  in.samples = samples_.floats.raw();
  in.view = rawView(camera_, middle);
  for (int j = 0; j < 3; ++j) {
    for (int k = 0; k < 3; ++k) in.G[j][k] = static_cast<float>(G(k, j));
    in.half[j] = static_cast<float>(kMore * cell.half[j]);
  }
  in.half_norm = more(cell.half.norm());
  in.depth = static_cast<float>(cell.depth);
  in.half_depth = more(cell.half_depth);
  in.ray_x = static_cast<float>(rays.x);
  in.ray_y = static_cast<float>(rays.y);
  in.ray_range = more(rays.half);
  in.half_ray = more(half_ray);
  in.window = window_;
  HWY_DYNAMIC_DISPATCH(prepareBounds)(in, raster_.levels(), bounded_);
  for (std::size_t k = 0; k < effects_px_.size(); ++k) effects_px_[k] = 0.5 * bounded_.effects[k] / TreeSamples::kCount;
}

int PoseBounds::pointsBound(double ray_x, double ray_y, int enough) const {
  return HWY_DYNAMIC_DISPATCH(countBound)(bounded_, raster_.words(), static_cast<float>(ray_x),
                                          static_cast<float>(ray_y), enough);
}

int PoseBounds::points(const Pose& T, int enough) const {
  int lost = 0;
  const int may_lose = maxPoints() - enough;
  const XrayCamera::Parameters& c = camera_.parameters();
  for (int i = 0; i < TreeSamples::kCount; ++i) {
    if (lost > may_lose) return -1;
    const Eigen::Vector3d p = T * samples_.points.col(i), t = T.linear() * samples_.tangents.col(i);
    if (!(p.z() > 0)) {
      lost += kExplained;
      continue;
    }
    const double x = p.x() / p.z(), y = p.y() / p.z();
    const double u = c.fx_px * x + c.cx_px, v = c.fy_px * y + c.cy_px;
    if (raster_.explains(u, v, c.fx_px * (t.x() - x * t.z()), c.fy_px * (t.y() - y * t.z()))) continue;
    lost += kExplained + (window_.contains(u, v) ? unexplained_ : 0);
  }
  return lost <= may_lose ? maxPoints() - lost : -1;
}

}  // namespace angio::registration
#endif
