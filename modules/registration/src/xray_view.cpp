// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/xray_view.hpp"

namespace angio::registration {

bool XrayView::sees(const Eigen::Vector2d& pixel) const {
  if (!camera.sees(pixel)) return false;
  // Inside a convex polygon every edge has the point on the same side, whichever way round the corners go.
  bool left = true, right = true;
  for (std::size_t i = 0; i < collimator_px.size(); ++i) {
    const Eigen::Vector2d a = collimator_px[i], edge = collimator_px[(i + 1) % collimator_px.size()] - a;
    const double side = edge.x() * (pixel.y() - a.y()) - edge.y() * (pixel.x() - a.x());
    left = left && side >= 0;
    right = right && side <= 0;
  }
  return left || right;
}

}  // namespace angio::registration
