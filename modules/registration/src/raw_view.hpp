// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Lanes of the widest vector target: arrays that vector code reads are padded by as many.
constexpr std::size_t kPadding = 16;

/// A camera and a pose in front of it as plain numbers for vector code.
struct RawView {
  float R[9], t[3], fx, fy, cx, cy;
};

inline RawView rawView(const XrayCamera& camera, const Pose& T_view_centered) {
  RawView raw;
  for (int i = 0; i < 9; ++i) raw.R[i] = static_cast<float>(T_view_centered.linear()(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) raw.t[i] = static_cast<float>(T_view_centered.translation()[i]);
  const auto& c = camera.parameters();
  raw.fx = static_cast<float>(c.fx_px);
  raw.fy = static_cast<float>(c.fy_px);
  raw.cx = static_cast<float>(c.cx_px);
  raw.cy = static_cast<float>(c.cy_px);
  return raw;
}

/// Places with a direction and one more number each, for vector code.
struct RawPoints {
  const float *x, *y, *z, *tx, *ty, *tz, *weight;
  int count;
};

/// Normal equations of a twist as vector code sums them: the Hessian's lower triangle row by row, and the gradient.
struct RawNormalEquations {
  double H[21], g[6];

  void addTo(Matrix6d& hessian, Vector6d& gradient) const {
    for (int i = 0, entry = 0; i < 6; ++i) {
      gradient[i] += g[i];
      for (int k = 0; k <= i; ++k, ++entry) {
        hessian(i, k) += H[entry];
        if (k != i) hessian(k, i) += H[entry];
      }
    }
  }
};

}  // namespace angio::registration
