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

struct TubeAxis {
  float x, y, z, length, radius;
};
}  // namespace angio::tubes
#endif

HWY_BEFORE_NAMESPACE();
namespace angio::tubes {
namespace HWY_NAMESPACE {

// Entry and exit of each ray, as depth t from the tube's end a; exit is not above entry where the ray misses.
//
// The cylinder around the axis u is met where |(o + t d) x u| = r. Where that is beyond an end, the ray enters or
// leaves through the sphere at that end, or not at all: a tube is convex, and its sphere fills the cylinder's section
// at the end. No branches: the compiler makes vectors of it.
void meetTube(const TubeAxis& u, const TubeRow& row, int count, float* __restrict entry, float* __restrict exit) {
  const float r2 = u.radius * u.radius;
  const float wx = u.y - u.z * row.dy;
  for (int i = 0; i < count; ++i) {
    const float dx = row.dx + static_cast<float>(i) * row.dx_step;
    const float ox = row.ox + static_cast<float>(i) * row.ox_step;
    const float wy = u.z * dx - u.x;  // w = u x d.
    const float wz = u.x * row.dy - u.y * dx;
    const float ww = wx * wx + wy * wy + wz * wz;
    const float a = ww > 1e-12F ? ww : 1e-12F;  // A ray along the axis meets the cylinder far beyond both ends.
    const float wo = wx * ox + wy * row.oy;
    const float h = r2 * a - wo * wo;
    const float dd = dx * dx + row.dy * row.dy + 1.0F;
    const float oo = ox * ox + row.oy * row.oy;
    const float d_o = dx * ox + row.dy * row.oy;
    const float ud = u.x * dx + u.y * row.dy + u.z;
    const float uo = u.x * ox + u.y * row.oy;
    const float b = d_o - ud * uo;
    const float root = std::sqrt(h > 0.0F ? h : 0.0F);
    const float t0 = (-b - root) / a, t1 = (-b + root) / a;
    const float s0 = uo + t0 * ud, s1 = uo + t1 * ud;  // Places along the axis.

    const float end0 = s0 < 0.0F ? 0.0F : u.length, end1 = s1 < 0.0F ? 0.0F : u.length;
    const float b0 = d_o - end0 * ud, b1 = d_o - end1 * ud;
    const float h0 = b0 * b0 - dd * (oo - 2.0F * end0 * uo + end0 * end0 - r2);
    const float h1 = b1 * b1 - dd * (oo - 2.0F * end1 * uo + end1 * end1 - r2);
    const float cap0 = (-b0 - std::sqrt(h0 > 0.0F ? h0 : 0.0F)) / dd;
    const float cap1 = (-b1 + std::sqrt(h1 > 0.0F ? h1 : 0.0F)) / dd;

    const bool side0 = (s0 >= 0.0F) & (s0 <= u.length), side1 = (s1 >= 0.0F) & (s1 <= u.length);
    const bool hit = (h > 0.0F) & (side0 | (h0 > 0.0F)) & (side1 | (h1 > 0.0F));
    const float in = side0 ? t0 : cap0, out = side1 ? t1 : cap1;
    entry[i] = in;
    exit[i] = hit ? out : in;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::tubes
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::tubes {
namespace {

HWY_EXPORT(meetTube);

constexpr double kRadiusStep = 0.04e-3;  // [m] Takes 0.6 % of the beam at most, half of a pixel's noise.
constexpr double kMaxLength = 4e-3;      // [m] Keeps single precision at the tube's scale.
constexpr double kNearest = 1e-3;        // [m] From the source; the cone of a tube that touches it has no bounds.
constexpr int kMaxPieces = 256;          // Of one edge.
constexpr double kEmpty = 1e-3;          // Density; takes nothing from the beam that a pixel could show.

// The pixels that a tube may cover lie within reach of its projected axis.
struct Footprint {
  Eigen::Vector2d a, b;  // [px]
  double reach;          // [px]
};

// A point within r of c is seen within f r |c| / (c.z (c.z - r)) of c: Cauchy-Schwarz on the difference of the
// quotients.
Footprint footprint(const Tube& tube, const XrayCamera& camera) {
  const double slant = std::max(tube.a.norm() / tube.a.z(), tube.b.norm() / tube.b.z());
  const double nearest = std::min(tube.a.z(), tube.b.z()) - tube.radius_m;
  const double focal = std::max(camera.parameters().fx_px, camera.parameters().fy_px);
  return {*camera.project(tube.a), *camera.project(tube.b), focal * tube.radius_m * slant / nearest + 1e-3};
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

}  // namespace

TubeTree::TubeTree(const VesselTree& tree) {
  for (const auto& branch : tree.branches()) {
    for (std::size_t k = 1; k < branch.size(); ++k) {
      const int from = branch[k - 1], to = branch[k];
      const double length = (tree.points().col(to) - tree.points().col(from)).norm();
      const double radius = tree.radii()[from].value(), change = tree.radii()[to].value() - radius;
      const double wanted = std::ceil(std::max(std::abs(change) / kRadiusStep, length / kMaxLength));
      const int count = static_cast<int>(std::clamp(wanted, 1.0, static_cast<double>(kMaxPieces)));
      for (int p = 0; p < count; ++p) {
        pieces_.push_back({from, to, static_cast<double>(p) / count, static_cast<double>(p + 1) / count,
                           radius + change * (p + 0.5) / count});
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
    tubes_.push_back({a + piece.begin * step, a + piece.end * step, piece.radius_m, density});
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
  if (std::min(tube.a.z(), tube.b.z()) <= tube.radius_m + kNearest) return;
  const auto& K = camera.parameters();
  const Footprint f = footprint(tube, camera);
  const auto [first, last] =
      pixelsBetween(std::min(f.a.y(), f.b.y()) - f.reach, std::max(f.a.y(), f.b.y()) + f.reach, K.height_px);
  const int top = std::max(first, band.top), bottom = std::min(last, band.bottom);
  if (top >= bottom) return;
  const Eigen::Vector3d along = tube.b - tube.a;
  const double length = along.norm();
  const Eigen::Vector3f u = (length > 0 ? Eigen::Vector3d(along / length) : Eigen::Vector3d::UnitX()).cast<float>();
  const TubeAxis axis{u.x(), u.y(), u.z(), static_cast<float>(length), static_cast<float>(tube.radius_m)};
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
    HWY_DYNAMIC_DISPATCH(meetTube)(axis, row, right - left, band.z_in.data(), band.z_out.data());
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
    add({T_camera_model * tube.a, T_camera_model * tube.b, tube.radius_m, tube.density}, camera, band);
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
