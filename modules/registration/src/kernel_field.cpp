// SPDX-License-Identifier: GPL-2.0-or-later
#include "kernel_field.hpp"

#include <algorithm>
#include <cmath>

#include "raw_view.hpp"

// Compiled once for every vector target by the include below; build chooses at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernel_field.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::registration {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// cell[k] += weight[r] * row[k] for each of `rows` lines of cells; `count` is a multiple of 4.
void addStamp(const float* row, int count, const float* weight, int rows, float* cell, std::ptrdiff_t line_stride) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const hn::CappedTag<float, 4> d4;
  for (int r = 0; r < rows; ++r, cell += line_stride) {
    const auto w = hn::Set(d, weight[r]);
    int k = 0;
    for (; k + lanes <= count; k += lanes) {
      hn::StoreU(hn::MulAdd(w, hn::LoadU(d, row + k), hn::LoadU(d, cell + k)), d, cell + k);
    }
    for (; k < count; k += 4) {
      hn::StoreU(hn::MulAdd(hn::Set(d4, weight[r]), hn::LoadU(d4, row + k), hn::LoadU(d4, cell + k)), d4, cell + k);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::registration
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::registration {
HWY_EXPORT(addStamp);
namespace {

constexpr int kCellsPerScale = 2;
constexpr int kMargin = 1;  // Cells around the detector, for the bilinear neighbours.

constexpr int kReachCells = KernelField::kReach * kCellsPerScale, kWidest = 2 * kReachCells + 1;

// The kernel across a stamp, for where in its middle cell a point lies: in steps of a 64th of a cell, which shifts a
// kernel by a 256th of its scale at most.
class StampRows {
 public:
  static constexpr int kSteps = 64;
  StampRows() {
    for (int step = 0; step <= kSteps; ++step) {
      const double offset = static_cast<double>(step) / kSteps - 0.5;  // Of the point from the cell's centre [cells].
      for (int k = 0; k < kWidest; ++k) {
        const double scales = (k - kReachCells - offset) / kCellsPerScale;
        rows_[step][k] = static_cast<float>(std::exp(-0.5 * scales * scales));
      }
    }
  }
  const float* at(float offset_cells) const {
    return rows_[std::clamp(static_cast<int>((offset_cells + 0.5f) * kSteps + 0.5f), 0, kSteps)];
  }

 private:
  float rows_[kSteps + 1][kWidest];
};

}  // namespace

void OrientedPoints::clear() {
  for (auto* values : {&u, &v, &cos2, &sin2, &mass_px, &certainty, &radius_px}) values->clear();
  begin.clear();
}

void OrientedPoints::pad() {
  for (auto* values : {&u, &v}) values->resize(mass_px.size() + kPadding, 0.0f);
}

void OrientedPoints::add(float u_px, float v_px, float cos2_phi, float sin2_phi, float mass, float how_certain,
                         float radius) {
  u.push_back(u_px);
  v.push_back(v_px);
  cos2.push_back(cos2_phi);
  sin2.push_back(sin2_phi);
  mass_px.push_back(mass);
  certainty.push_back(how_certain);
  radius_px.push_back(radius);
}

void KernelField::build(const OrientedPoints& points, double scale_px, const Region& region) {
  scale_px_ = static_cast<float>(scale_px);
  cell_px_ = scale_px_ / kCellsPerScale;
  u_origin_px_ = static_cast<float>(region.u_first) - kMargin * cell_px_;
  v_origin_px_ = static_cast<float>(region.v_first) - kMargin * cell_px_;
  columns_ = static_cast<int>(std::ceil(static_cast<float>(region.width) / cell_px_)) + 2 * kMargin + 1;
  rows_ = static_cast<int>(std::ceil(static_cast<float>(region.height) / cell_px_)) + 2 * kMargin + 1;
  cells_.assign(4 * static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0.0f);

  static const StampRows rows;
  const float norm = 1 / (scale_px_ * std::sqrt(2 * static_cast<float>(M_PI)));
  const float inverse_cell = 1 / cell_px_;
  const auto add_stamp = HWY_DYNAMIC_DISPATCH(addStamp);
  for (int j = 0; j < points.size(); ++j) {
    const float x = (points.u[j] - u_origin_px_) * inverse_cell, y = (points.v[j] - v_origin_px_) * inverse_cell;
    // Far outside the detector a point reaches no cell, and its index may not fit an integer.
    const float before = -kReachCells - 1;
    if (!(x > before && y > before && x < columns_ + kReachCells && y < rows_ + kReachCells)) continue;
    const int x_mid = static_cast<int>(std::floor(x + 0.5f)), y_mid = static_cast<int>(std::floor(y + 0.5f));
    const int x_first = std::max(0, x_mid - kReachCells), x_last = std::min(columns_ - 1, x_mid + kReachCells);
    const int y_first = std::max(0, y_mid - kReachCells), y_last = std::min(rows_ - 1, y_mid + kReachCells);
    if (x_first > x_last || y_first > y_last) continue;
    const float* const across = rows.at(x - static_cast<float>(x_mid)) + (x_first - (x_mid - kReachCells));
    const float* const down = rows.at(y - static_cast<float>(y_mid)) + (y_first - (y_mid - kReachCells));
    const float mass = norm * points.mass_px[j];
    const Eigen::Array4f stamp(mass, mass * points.cos2[j], mass * points.sin2[j], 0);
    const int width = x_last - x_first + 1;
    float line[4 * kWidest];
    for (int c = 0; c < width; ++c) Eigen::Map<Eigen::Array4f>(line + 4 * c) = across[c] * stamp;
    add_stamp(line, 4 * width, down, y_last - y_first + 1,
              &cells_[4 * (static_cast<std::size_t>(y_first) * columns_ + x_first)],
              4 * static_cast<std::ptrdiff_t>(columns_));
  }
}

KernelField::Value KernelField::at(const Eigen::Vector2d& pixel, double cos2_phi, double sin2_phi) const {
  const double x = (pixel.x() - u_origin_px_) / cell_px_, y = (pixel.y() - v_origin_px_) / cell_px_;
  if (!(x >= 0 && y >= 0 && x < columns_ - 1 && y < rows_ - 1)) return {};
  const int c = static_cast<int>(x), r = static_cast<int>(y);
  const double a = x - c, b = y - r;
  const auto F = [&](int column, int row) {
    const float* cell = &cells_[4 * (static_cast<std::size_t>(row) * columns_ + column)];
    return 0.5 * (cell[0] + cos2_phi * cell[1] + sin2_phi * cell[2]);
  };
  const double F00 = F(c, r), F10 = F(c + 1, r), F01 = F(c, r + 1), F11 = F(c + 1, r + 1);
  Value value;
  value.F = (1 - b) * ((1 - a) * F00 + a * F10) + b * ((1 - a) * F01 + a * F11);
  value.gradient << ((1 - b) * (F10 - F00) + b * (F11 - F01)) / cell_px_,
      ((1 - a) * (F01 - F00) + a * (F11 - F10)) / cell_px_;
  return value;
}

}  // namespace angio::registration
#endif
