// SPDX-License-Identifier: GPL-2.0-or-later
#include "explained_shares.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {
namespace {

constexpr double kLeastDepth_m = 1e-3;
// A vessel seen so nearly end-on has no direction: the square of what is left of its length.
constexpr double kEndOn = 0.02;

// Eighth of half a turn that a direction lies in, by any positive multiple of its doubled angle's cosine and sine.
int eighthOf(double cos2, double sin2) {
  const bool steep = std::abs(sin2) > std::abs(cos2);
  if (sin2 >= 0) return cos2 >= 0 ? (steep ? 1 : 0) : (steep ? 2 : 3);
  return cos2 < 0 ? (steep ? 5 : 4) : (steep ? 6 : 7);
}

std::uint8_t bitOf(int eighth) { return static_cast<std::uint8_t>(1 << (eighth & 7)); }

std::uint8_t besideOf(int eighth) {
  return static_cast<std::uint8_t>(bitOf(eighth) | bitOf(eighth + 1) | bitOf(eighth + 7));
}

}  // namespace

ExplainedShares::ExplainedShares(const OrientedModel& model, const OrientedFrame& frame, double cell_px)
    : model_(model),
      view_(frame.views().front()),
      cell_px_(cell_px),
      columns_(static_cast<int>(view_.camera.width_px() / cell_px) + 3),
      rows_(static_cast<int>(view_.camera.height_px() / cell_px) + 3),
      image_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0),
      shown_(image_.size()),
      work_(image_.size()) {
  OrientedPoints points;
  const double point_px = frame.length_px() / std::max(1, frame.pointCount());
  thinned(frame.points(0), std::max(1, static_cast<int>(0.5 * cell_px / std::max(0.1, point_px))), points);
  for (int j = 0; j < points.size(); ++j) {
    const int cell = cellAt(points.u[j], points.v[j]);
    if (cell < 0) continue;  // A file may hold anything.
    cells_.push_back(cell);
    directions_.push_back(besideOf(eighthOf(points.cos2[j], points.sin2[j])));
    lengths_px_.push_back(points.mass_px[j]);
    total_px_ += points.mass_px[j];
    image_[static_cast<std::size_t>(cell)] |= directions_.back();
  }
  widen(image_);
}

double ExplainedShares::of(const Pose& T_camera_centered) {
  std::fill(shown_.begin(), shown_.end(), 0);
  const Pose T = view_.T_view_first * T_camera_centered;
  const Eigen::Matrix3f R = T.linear().cast<float>();
  const Eigen::Vector3f t = T.translation().cast<float>();
  const XrayCamera::Parameters& c = view_.camera.parameters();
  const ModelPoints& points = model_.all;
  // One point a cell is enough.
  const double step_px = c.fx_px / std::max(0.05, T.translation().z()) * model_.spacing_m;
  const int stride = std::max(1, static_cast<int>(cell_px_ / step_px));
  double seen = 0, explained = 0;
  for (int i = 0; i < points.count; i += stride) {
    const Eigen::Vector3f p = R * Eigen::Vector3f(points.x[i], points.y[i], points.z[i]) + t;
    if (!(p.z() > kLeastDepth_m)) continue;
    const double x = p.x() / p.z(), y = p.y() / p.z();
    const int cell = cellAt(c.fx_px * x + c.cx_px, c.fy_px * y + c.cy_px);
    if (cell < 0) continue;
    const Eigen::Vector3f d = R * Eigen::Vector3f(points.tx[i], points.ty[i], points.tz[i]);
    const double du = d.x() - x * d.z(), dv = d.y() - y * d.z(), length2 = du * du + dv * dv;
    if (!(length2 > kEndOn)) continue;
    const std::uint8_t direction = bitOf(eighthOf(du * du - dv * dv, 2 * du * dv));
    const double length = std::sqrt(length2);
    seen += length;
    if ((image_[static_cast<std::size_t>(cell)] & direction) != 0) explained += length;
    shown_[static_cast<std::size_t>(cell)] |= direction;
  }
  if (!(seen > 0 && total_px_ > 0)) return 0;
  widen(shown_);
  double explained_px = 0;
  for (std::size_t j = 0; j < cells_.size(); ++j) {
    if ((shown_[static_cast<std::size_t>(cells_[j])] & directions_[j]) != 0) explained_px += lengths_px_[j];
  }
  return explained_px / total_px_ * (explained / seen);
}

int ExplainedShares::cellAt(double u_px, double v_px) const {
  const XrayCamera& camera = view_.camera;
  if (!(u_px >= 0 && v_px >= 0 && u_px < camera.width_px() && v_px < camera.height_px())) return -1;
  return (static_cast<int>(v_px / cell_px_) + 1) * columns_ + static_cast<int>(u_px / cell_px_) + 1;
}

// Each cell with the eight around it. The raster has cells beyond the detector on all sides, so none is missed at its
// edge; what runs on from the end of a row into the next one lands there.
void ExplainedShares::widen(Raster& raster) {
  const auto count = static_cast<std::ptrdiff_t>(raster.size());
  work_ = raster;
  for (std::ptrdiff_t i = 1; i + 1 < count; ++i) work_[i] = raster[i - 1] | raster[i] | raster[i + 1];
  raster = work_;
  for (std::ptrdiff_t i = columns_; i + columns_ < count; ++i) {
    raster[i] = work_[i - columns_] | work_[i] | work_[i + columns_];
  }
}

}  // namespace angio::registration
