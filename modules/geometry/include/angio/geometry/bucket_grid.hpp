// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "angio/geometry/namespace.hpp"

namespace angio::geometry {

/// Points of the plane [px] in a grid of cells: the nearest one, exactly. Cheap to build, so for points that are looked
/// up about once each. Memory is kept: as many points in a box of the same shape cost no allocation.
class BucketGrid {
 public:
  /// A point that was found.
  struct Match {
    int index = -1;  ///< -1: there are no points.
    double distance2_px2 = 0;
  };

  /// Takes new points, 2 x N [px], finite.
  void build(const Eigen::Ref<const Eigen::Matrix2Xd>& points_px) {
    const int n = static_cast<int>(points_px.cols());
    setCells(points_px);
    cell_of_.resize(n);
    first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
    for (int i = 0; i < n; ++i) {
      const int cell = row(points_px(1, i)) * columns_ + column(points_px(0, i));
      cell_of_[i] = cell;
      ++first_[cell + 1];
    }
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    // Slots are given out from the last to the first of a cell, so that indices rise within it.
    x_.resize(n);
    y_.resize(n);
    index_.resize(n);
    for (int i = n - 1; i >= 0; --i) {
      const int slot = --first_[cell_of_[i] + 1];
      x_[slot] = points_px(0, i);
      y_[slot] = points_px(1, i);
      index_[slot] = i;
    }
    // Each cell's start now stands where its end stood.
    std::copy(first_.begin() + 1, first_.end(), first_.begin());
    first_.back() = n;
  }

  int size() const { return static_cast<int>(index_.size()); }

  /// The nearest point to a finite place; of several that stand in one place the one of lowest index.
  Match nearest(const Eigen::Vector2d& query) const {
    if (index_.empty()) return {};
    double best = std::numeric_limits<double>::infinity();
    int best_slot = 0;
    // Empty cells before the box of all points need no look.
    double reach = cell_px_ + (low_ - query).cwiseMax(query - high_).cwiseMax(0).sum();
    while (true) {
      eachSlot(query, reach, [&](int slot) {
        // Without a branch: which point is nearer cannot be foretold.
        const double distance2 = distance2At(slot, query);
        best_slot = distance2 < best ? slot : best_slot;
        best = std::min(best, distance2);
      });
      const double found = std::sqrt(best);
      // What lies in the square's corners may be further away than something outside of it.
      if (found <= reach || coversAll(query, reach)) return {index_[best_slot], best};
      reach = std::min(2 * reach, found);
    }
  }

  /// Visits all points within `reach_px` of a finite place: their index, and where they are from there (x, y) [px].
  template <typename Visit>
  void eachWithin(const Eigen::Vector2d& query, double reach_px, const Visit& visit) const {
    if (index_.empty()) return;
    eachSlot(query, reach_px, [&](int slot) {
      const double x = x_[slot] - query.x(), y = y_[slot] - query.y();
      if (x * x + y * y <= reach_px * reach_px) visit(index_[slot], x, y);
    });
  }

 private:
  static constexpr double kMinCell_px = 4;
  static constexpr double kCellsPerPoint = 8;

  // Cells of a few pixels, larger when the points are few and far apart: there are never many more cells than points.
  void setCells(const Eigen::Ref<const Eigen::Matrix2Xd>& points_px) {
    const Eigen::Index n = points_px.cols();
    low_ = high_ = n > 0 ? points_px.col(0) : Eigen::Vector2d(0, 0);
    for (Eigen::Index i = 1; i < n; ++i) {
      low_ = low_.cwiseMin(points_px.col(i));
      high_ = high_.cwiseMax(points_px.col(i));
    }
    const Eigen::Vector2d size = high_ - low_;
    const double most = kCellsPerPoint * std::max<double>(1, static_cast<double>(n));
    cell_px_ = std::max({kMinCell_px, std::sqrt(size.x() / most * size.y()), size.x() / most, size.y() / most});
    // A row of cells costs a loop, a column nothing: cells are higher than wide.
    cells_per_px_ = Eigen::Vector2d(2, 0.5) / cell_px_;
    columns_ = 1 + at(size.x() * cells_per_px_.x(), 2 * most);
    rows_ = 1 + at(size.y() * cells_per_px_.y(), most);
  }

  // Rising in x, whatever is rounded: so a point within reach is in a cell within reach.
  int column(double x) const { return at((x - low_.x()) * cells_per_px_.x(), columns_ - 1); }
  int row(double y) const { return at((y - low_.y()) * cells_per_px_.y(), rows_ - 1); }
  static int at(double cell, double last) { return cell > 0 ? static_cast<int>(std::min(cell, last)) : 0; }

  // All slots in the cells of a square; those of one row of cells stand together.
  template <typename Visit>
  void eachSlot(const Eigen::Vector2d& query, double reach, const Visit& visit) const {
    if ((query.array() + reach < low_.array()).any() || (query.array() - reach > high_.array()).any()) return;
    const int left = column(query.x() - reach), right = column(query.x() + reach);
    const int last_row = row(query.y() + reach);
    for (int r = row(query.y() - reach); r <= last_row; ++r) {
      const int end = first_[r * columns_ + right + 1];
      for (int slot = first_[r * columns_ + left]; slot < end; ++slot) visit(slot);
    }
  }

  bool coversAll(const Eigen::Vector2d& query, double reach) const {
    return (query.array() - reach <= low_.array()).all() && (query.array() + reach >= high_.array()).all();
  }

  double distance2At(int slot, const Eigen::Vector2d& query) const {
    const double dx = x_[slot] - query.x(), dy = y_[slot] - query.y();
    return dx * dx + dy * dy;
  }

  double cell_px_ = kMinCell_px;  // The root of a cell's area.
  Eigen::Vector2d cells_per_px_{0, 0};
  Eigen::Vector2d low_{0, 0}, high_{0, 0};  // Box of the points.
  int columns_ = 1, rows_ = 1;
  std::vector<int> first_;     // Cells + 1: the first slot of each, row by row.
  std::vector<double> x_, y_;  // By slot.
  std::vector<int> index_;     // By slot: which point.
  std::vector<int> cell_of_;   // By point, while building.
};

}  // namespace angio::geometry
