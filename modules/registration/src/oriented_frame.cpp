// SPDX-License-Identifier: GPL-2.0-or-later
#include "oriented_frame.hpp"

#include <algorithm>

#include "oriented_image.hpp"

namespace angio::registration {
namespace {

// A row of Gaussians three quarters of their width apart is smooth to one part in 10^15: more points add nothing but
// time.
constexpr double kPointsPerScale = 4.0 / 3;

// The part of the detector where points within three scales can pull: elsewhere the field is nothing, and costs
// nothing.
KernelField::Region reachOf(const OrientedPoints& points, double scale_px, const XrayCamera& camera) {
  const double max_u = camera.width_px() - 0.5, max_v = camera.height_px() - 0.5;
  double u_first = max_u, u_last = -0.5, v_first = max_v, v_last = -0.5;
  for (int j = 0; j < points.size(); ++j) {
    u_first = std::min(u_first, points.u[j] - 3 * scale_px);
    u_last = std::max(u_last, points.u[j] + 3 * scale_px);
    v_first = std::min(v_first, points.v[j] - 3 * scale_px);
    v_last = std::max(v_last, points.v[j] + 3 * scale_px);
  }
  u_first = std::clamp(u_first, -0.5, max_u);
  v_first = std::clamp(v_first, -0.5, max_v);
  u_last = std::clamp(u_last, u_first, max_u);
  v_last = std::clamp(v_last, v_first, max_v);
  return {u_first, v_first, u_last - u_first, v_last - v_first};
}

}  // namespace

void OrientedFrame::begin(const XrayViews& views, const OrientedKernelSettings& settings) {
  views_ = &views;
  if (images_.size() < views.size()) images_.resize(views.size());
  spacing_px_ = settings.spacing_px;
  point_count_ = 0;
  length_px_ = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    Image& image = images_[v];
    orientedPoints(views[v].centerline, settings.spacing_px, settings.max_points_2d, image.points);
    angio::registration::fieldOfView(views[v], image.field_of_view);
    image.built.fill(false);
    point_count_ += image.points.size();
    for (const float mass : image.points.mass_px) length_px_ += mass;
  }
}

const KernelField& OrientedFrame::field(std::size_t view, int scale) {
  Image& image = images_[view];
  const auto k = static_cast<std::size_t>(scale);
  if (!image.built[k]) {
    // As many pixels of line a point as the image has on average: a dense centreline is thinned more.
    const double point_px = length_px_ / std::max(1, point_count_);
    const int stride = std::max(1, static_cast<int>(kFieldScales_px[k] / kPointsPerScale / std::max(0.1, point_px)));
    thinned(image.points, stride, image.thin);
    const XrayCamera& camera = (*views_)[view].camera;
    image.field[k].build(image.thin, kFieldScales_px[k], reachOf(image.thin, kFieldScales_px[k], camera));
    image.built[k] = true;
  }
  return image.field[k];
}

}  // namespace angio::registration
