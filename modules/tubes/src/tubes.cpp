// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/tubes/tubes.hpp"

#include <algorithm>
#include <cmath>

// Compiled once for every vector target by the include below, which is chosen from at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tubes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef ANGIO_TUBES_RAW
#define ANGIO_TUBES_RAW
namespace angio::tubes {
// What all rays of one row share, and how they change from pixel to pixel. A ray is p = o + t d with d = (dx, dy, 1),
// where o is its point at the depth of the tube's end a, relative to a: small numbers, so that single precision is
// enough.
struct TubeRow {
  float dx, dx_step, dy;
  float ox, ox_step, oy;
};

// Of a tapered tube: its side is the cone that touches both ends' balls. Its normals have the slope `sine` along the
// axis; it touches the balls at the places `from` and `to` along the axis, which are none where one ball holds the
// other.
struct TubeShape {
  float x, y, z, length;  // Axis.
  float radius_a, radius_b;
  float sine, from, to;
};
}  // namespace angio::tubes
#endif

HWY_BEFORE_NAMESPACE();
namespace angio::tubes {
namespace HWY_NAMESPACE {

// Entry and exit of each ray, as depth t from the tube's end a; exit is not above entry where the ray misses.
//
// A tube is convex and the hull of its two balls. Its surface is parts of both balls and, between the circles where it
// touches them, of the cone around them. The ray enters at the first of what it meets of these and leaves at the last:
// what of a ball is not on the surface is inside. A point p of the cone has c |p - (u p) u| = r_a - s (u p), where s
// and c are sine and cosine of the normals' slope; squared, and with c^2 + s^2 = 1, c^2 |p|^2 - (u p)^2 + 2 r_a s (u p)
// = r_a^2. No branches: the compiler makes vectors of it.
void meetTube(const TubeShape& u, const TubeRow& row, int count, float* __restrict entry, float* __restrict exit) {
  constexpr float kFar = 1e3F;
  const float s = u.sine, s2 = s * s, c2 = 1.0F - s2, shift = u.radius_a * s;
  const float ra2 = u.radius_a * u.radius_a, rb2 = u.radius_b * u.radius_b;
  const float wx = u.y - u.z * row.dy;
  for (int i = 0; i < count; ++i) {
    const float dx = row.dx + static_cast<float>(i) * row.dx_step;
    const float ox = row.ox + static_cast<float>(i) * row.ox_step;
    const float wy = u.z * dx - u.x;  // w = u x d.
    const float wz = u.x * row.dy - u.y * dx;
    const float ww = wx * wx + wy * wy + wz * wz;
    const float dd = dx * dx + row.dy * row.dy + 1.0F;
    const float oo = ox * ox + row.oy * row.oy;
    const float d_o = dx * ox + row.dy * row.oy;
    const float ud = u.x * dx + u.y * row.dy + u.z;
    const float uo = u.x * ox + u.y * row.oy;

    // The cone: a t^2 + 2 b t + c = 0. The root of larger size first, and the other by their product, so that neither
    // is a difference of nearly equal numbers where the ray runs along the cone's side and a is next to nothing.
    const float a = ww - s2 * dd;
    const float b = c2 * d_o - ud * (uo - shift);
    const float c = c2 * oo - uo * uo + 2.0F * shift * uo - ra2;
    const float h = b * b - a * c;
    const float root = std::sqrt(h > 0.0F ? h : 0.0F);
    const float q = b > 0.0F ? -b - root : root - b;
    const float ta = q / (a != 0.0F ? a : 1e-30F), tb = c / (q != 0.0F ? q : 1e-30F);
    const float xa = uo + ta * ud, xb = uo + tb * ud;  // Places along the axis.
    const bool meets_a = (h > 0.0F) & (xa >= u.from) & (xa <= u.to);
    const bool meets_b = (h > 0.0F) & (xb >= u.from) & (xb <= u.to);

    // The balls.
    const float d_ob = d_o - u.length * ud, oob = oo - u.length * (2.0F * uo - u.length);
    const float ha = d_o * d_o - dd * (oo - ra2), hb = d_ob * d_ob - dd * (oob - rb2);
    const float root_a = std::sqrt(ha > 0.0F ? ha : 0.0F), root_b = std::sqrt(hb > 0.0F ? hb : 0.0F);

    float in = ha > 0.0F ? (-d_o - root_a) / dd : kFar, out = ha > 0.0F ? (-d_o + root_a) / dd : -kFar;
    const float in_b = hb > 0.0F ? (-d_ob - root_b) / dd : kFar, out_b = hb > 0.0F ? (-d_ob + root_b) / dd : -kFar;
    in = in_b < in ? in_b : in;
    out = out_b > out ? out_b : out;
    const float in_ca = meets_a ? ta : kFar, out_ca = meets_a ? ta : -kFar;
    const float in_cb = meets_b ? tb : kFar, out_cb = meets_b ? tb : -kFar;
    in = in_ca < in ? in_ca : in;
    out = out_ca > out ? out_ca : out;
    in = in_cb < in ? in_cb : in;
    out = out_cb > out ? out_cb : out;
    entry[i] = in;
    exit[i] = out;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::tubes
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::tubes {
namespace {

HWY_EXPORT(meetTube);

constexpr double kMaxLength = 4e-3;  // [m] Keeps single precision at the tube's scale.
constexpr double kNearest = 1e-3;    // [m] From the source; the cone of a tube that touches it has no bounds.
constexpr int kMaxPieces = 256;      // Of one edge.
constexpr double kSteepest = 0.999;  // Taper by length, from where one ball holds nearly all of the other.
constexpr double kEmpty = 1e-3;      // Density; takes nothing from the beam that a pixel could show.

// The pixels that a tube may cover lie within reach of its projected axis.
struct Footprint {
  Eigen::Vector2d a, b;  // [px]
  double reach;          // [px]
};

// A point within r of c is seen within f r |c| / (c.z (c.z - r)) of c: Cauchy-Schwarz on the difference of the
// quotients.
Footprint footprint(const Tube& tube, double radius_m, const XrayCamera& camera) {
  const double slant = std::max(tube.a.norm() / tube.a.z(), tube.b.norm() / tube.b.z());
  const double nearest = std::min(tube.a.z(), tube.b.z()) - radius_m;
  const double focal = std::max(camera.parameters().fx_px, camera.parameters().fy_px);
  return {*camera.project(tube.a), *camera.project(tube.b), focal * radius_m * slant / nearest + 1e-3};
}

// Whole pixels between two positions and on the detector: [first, second).
std::pair<int, int> pixelsBetween(double low, double high, int size) {
  return {static_cast<int>(std::ceil(std::clamp(low, 0.0, static_cast<double>(size)))),
          static_cast<int>(std::floor(std::clamp(high, -1.0, size - 1.0))) + 1};
}

// Of row y, the pixels between the two lines parallel to the axis at its reach, and within the footprint's box.
std::pair<int, int> columns(const Footprint& f, int y, int width) {
  const Eigen::Vector2d along = f.b - f.a;
  double low = std::min(f.a.x(), f.b.x()) - f.reach, high = std::max(f.a.x(), f.b.x()) + f.reach;
  if (std::abs(along.y()) > 1e-9) {
    const double center = f.a.x() + (y - f.a.y()) * along.x() / along.y();
    const double half = f.reach * along.norm() / std::abs(along.y());
    low = std::max(low, center - half);
    high = std::min(high, center + half);
  }
  return pixelsBetween(low, high, width);
}

TubeShape shapeOf(const Tube& tube) {
  const Eigen::Vector3d along = tube.b - tube.a;
  const double length = along.norm(), taper = tube.radius_a_m - tube.radius_b_m;
  const Eigen::Vector3f u = (length > 0 ? Eigen::Vector3d(along / length) : Eigen::Vector3d::UnitX()).cast<float>();
  TubeShape shape{u.x(),
                  u.y(),
                  u.z(),
                  static_cast<float>(length),
                  static_cast<float>(tube.radius_a_m),
                  static_cast<float>(tube.radius_b_m),
                  0,
                  1,
                  0};
  if (std::abs(taper) < kSteepest * length) {  // Else the side is no longer than the balls' difference shows anyway.
    const double sine = taper / length;
    shape.sine = static_cast<float>(sine);
    shape.from = static_cast<float>(sine * tube.radius_a_m);
    shape.to = static_cast<float>(length + sine * tube.radius_b_m);
  }
  return shape;
}

}  // namespace

TubeTree::TubeTree(const VesselTree& tree) {
  for (const auto& branch : tree.branches()) {
    for (std::size_t k = 1; k < branch.size(); ++k) {
      const int from = branch[k - 1], to = branch[k];
      const double length = (tree.points().col(to) - tree.points().col(from)).norm();
      const double radius = tree.radii()[from].value(), change = tree.radii()[to].value() - radius;
      const int count =
          static_cast<int>(std::clamp(std::ceil(length / kMaxLength), 1.0, static_cast<double>(kMaxPieces)));
      for (int p = 0; p < count; ++p) {
        const double begin = static_cast<double>(p) / count, end = static_cast<double>(p + 1) / count;
        pieces_.push_back({from, to, begin, end, radius + begin * change, radius + end * change});
      }
    }
  }
}

const std::vector<Tube>& TubeTree::tubes(const Eigen::Matrix3Xd& points, const Eigen::VectorXd& densities) const {
  tubes_.clear();
  for (const Piece& piece : pieces_) {
    double density = 1;
    if (densities.size() > 0) {
      const double middle = 0.5 * (piece.begin + piece.end);
      density = (1 - middle) * densities[piece.from] + middle * densities[piece.to];
      if (density < kEmpty) continue;
    }
    const Eigen::Vector3d a = points.col(piece.from), step = points.col(piece.to) - a;
    tubes_.push_back({a + piece.begin * step, a + piece.end * step, piece.radius_begin_m, piece.radius_end_m, density});
  }
  return tubes_;
}

void PathLengths::insert(Band& band, Interval added) {
  std::int32_t* link = &first_[added.pixel];
  std::int32_t grown = -1;
  while (*link >= 0) {
    Interval& other = band.intervals[*link];
    if (other.z_in > added.z_out || added.z_in > other.z_out) {
      link = &other.next;
      continue;
    }
    const float length = added.z_out - added.z_in, other_length = other.z_out - other.z_in;
    added.density = (length * added.density + other_length * other.density) / (length + other_length);
    added.z_in = std::min(added.z_in, other.z_in);
    added.z_out = std::max(added.z_out, other.z_out);
    if (grown < 0) {
      grown = *link;
      link = &other.next;
    } else {
      other.z_out = other.z_in;  // Counts for nothing any more.
      *link = other.next;
    }
  }
  if (grown >= 0) {
    Interval& interval = band.intervals[grown];
    interval.z_in = added.z_in;
    interval.z_out = added.z_out;
    interval.density = added.density;
  } else {
    added.next = first_[added.pixel];
    first_[added.pixel] = static_cast<std::int32_t>(band.intervals.size());
    band.intervals.push_back(added);
  }
}

void PathLengths::add(const Tube& tube, const XrayCamera& camera, Band& band) {
  const double widest_m = std::max(tube.radius_a_m, tube.radius_b_m);
  if (std::min(tube.a.z(), tube.b.z()) <= widest_m + kNearest) return;
  const auto& K = camera.parameters();
  const Footprint f = footprint(tube, widest_m, camera);
  const auto [first, last] =
      pixelsBetween(std::min(f.a.y(), f.b.y()) - f.reach, std::max(f.a.y(), f.b.y()) + f.reach, K.height_px);
  const int top = std::max(first, band.top), bottom = std::min(last, band.bottom);
  if (top >= bottom) return;
  const TubeShape shape = shapeOf(tube);
  const float depth = static_cast<float>(tube.a.z() - origin_z_), density = static_cast<float>(tube.density);

  for (int y = top; y < bottom; ++y) {
    const auto [left, right] = columns(f, y, K.width_px);
    if (left >= right) continue;
    TubeRow row;
    row.dx = static_cast<float>((left - K.cx_px) / K.fx_px);
    row.dx_step = static_cast<float>(1 / K.fx_px);
    row.dy = static_cast<float>((y - K.cy_px) / K.fy_px);
    row.ox = static_cast<float>((left - f.a.x()) * tube.a.z() / K.fx_px);
    row.ox_step = static_cast<float>(tube.a.z() / K.fx_px);
    row.oy = static_cast<float>((y - f.a.y()) * tube.a.z() / K.fy_px);
    const float *z_in = band.z_in.data(), *z_out = band.z_out.data();
    HWY_DYNAMIC_DISPATCH(meetTube)(shape, row, right - left, band.z_in.data(), band.z_out.data());
    for (int i = 0; i < right - left; ++i) {
      if (z_out[i] > z_in[i]) {
        insert(band, {depth + z_in[i], depth + z_out[i], density, -1, y * K.width_px + left + i});
      }
    }
  }
}

void PathLengths::computeBand(const std::vector<Tube>& tubes, const XrayCamera& camera, const Pose& T_camera_model,
                              Band& band) {
  const auto& K = camera.parameters();
  const std::size_t begin = static_cast<std::size_t>(band.top) * K.width_px;
  const std::size_t end = static_cast<std::size_t>(band.bottom) * K.width_px;
  std::fill(first_.begin() + begin, first_.begin() + end, -1);
  float* result = result_.ptr<float>();
  std::fill(result + begin, result + end, 0.0F);
  band.intervals.clear();
  band.z_in.resize(K.width_px);
  band.z_out.resize(K.width_px);
  for (const Tube& tube : tubes) {
    add({T_camera_model * tube.a, T_camera_model * tube.b, tube.radius_a_m, tube.radius_b_m, tube.density}, camera,
        band);
  }
  for (const Interval& interval : band.intervals) {
    const double dx = (interval.pixel % K.width_px - K.cx_px) / K.fx_px;
    const double dy = (interval.pixel / K.width_px - K.cy_px) / K.fy_px;
    const float slant = static_cast<float>(std::sqrt(dx * dx + dy * dy + 1));
    result[interval.pixel] += slant * (interval.z_out - interval.z_in) * interval.density;
  }
}

const cv::Mat& PathLengths::compute(const std::vector<Tube>& tubes, const XrayCamera& camera,
                                    const Pose& T_camera_model, int threads) {
  const auto& K = camera.parameters();
  first_.resize(static_cast<std::size_t>(K.width_px) * K.height_px);
  result_.create(K.height_px, K.width_px, CV_32FC1);
  origin_z_ = tubes.empty() ? 0 : (T_camera_model * tubes.front().a).z();
  bands_.resize(std::max<std::size_t>(bands_.size(), threads));
  forBands(threads, K.height_px, [&](const RowBand& rows) {
    Band& band = bands_[rows.index];
    band.top = rows.top;
    band.bottom = rows.bottom;
    computeBand(tubes, camera, T_camera_model, band);
  });
  return result_;
}

}  // namespace angio::tubes
#endif  // HWY_ONCE
