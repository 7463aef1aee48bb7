// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// The image side of an oriented registration: points with direction and mass, one array a quantity.
///
/// `mass_px` is the length of centreline that a point stands for, so that a densely sampled vessel counts no more than
/// a sparsely sampled one.
struct OrientedPoints {
  std::vector<float> u, v;        ///< [px]
  std::vector<float> cos2, sin2;  ///< Of twice the tangent's angle: undirected.
  std::vector<float> mass_px;
  std::vector<float> certainty;  ///< The image's middling standard deviation over this point's; 1 when unknown.
  std::vector<float> radius_px;  ///< Of the vessel; 0 when unknown.
  std::vector<int> begin;        ///< First point of each branch.

  int size() const { return static_cast<int>(mass_px.size()); }
  void clear();
  /// Lets vectors of any width read `u` and `v` past the last point.
  void pad();
  void add(float u_px, float v_px, float cos2_phi, float sin2_phi, float mass, float how_certain = 1, float radius = 0);
};

/// The sum of the oriented Gaussian kernels of all image points at one scale l, as three images:
///
///   F(u, phi) = 1/2 (G0(u) + cos 2phi Gc(u) + sin 2phi Gs(u)),
///   G0 = sum_j m_j k(u - q_j),  Gc, Gs = the same with cos 2phi_j, sin 2phi_j,  k(x) = exp(-|x|^2 / 2 l^2) / (l sqrt(2
///   pi)),
///
/// which is sum_j m_j k(u - q_j) cos^2(phi - phi_j): every image point pulls on every model point, without a search.
/// With the masses m_j in pixels of length, F is about 1 on a single straight vessel that runs along phi.
///
/// Stored on cells of half a scale and read bilinearly; the kernel ends at three scales. Memory is kept between frames.
class KernelField {
 public:
  /// The part of the plane that the field covers [px].
  struct Region {
    double u_first = 0, v_first = 0, width = 0, height = 0;
    static Region detector(int width_px, int height_px) {
      return {-0.5, -0.5, static_cast<double>(width_px), static_cast<double>(height_px)};
    }
  };
  void build(const OrientedPoints& points, double scale_px, const Region& region);

  /// Scales after which a kernel ends: it has fallen to 1 %.
  static constexpr int kReach = 3;

  /// Four floats a cell: G0, Gc, Gs and nothing, row by row.
  const float* cells() const { return cells_.data(); }
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  float cell_px() const { return cell_px_; }
  float scale_px() const { return scale_px_; }
  /// Pixel position of the first cell's centre.
  float u_origin_px() const { return u_origin_px_; }
  float v_origin_px() const { return v_origin_px_; }

  /// F and its gradient at a pixel for a direction, as the step reads them; zero outside the field. For tests and
  /// single points.
  struct Value {
    double F = 0;
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  ///< [1/px]
  };
  Value at(const Eigen::Vector2d& pixel, double cos2_phi, double sin2_phi) const;

 private:
  std::vector<float> cells_;
  int columns_ = 0, rows_ = 0;
  float cell_px_ = 1, scale_px_ = 1, u_origin_px_ = 0, v_origin_px_ = 0;
};

}  // namespace angio::registration
