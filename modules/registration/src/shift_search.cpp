// SPDX-License-Identifier: GPL-2.0-or-later
#include "shift_search.hpp"

#include <algorithm>
#include <cmath>

#include "oriented_image.hpp"

namespace angio::registration {
namespace {

constexpr double kScale_px = 16;  // Of the model's field, whose cells are the steps of the shifts.
constexpr double kModelSpacing_px = 4;
constexpr double kImageSpacing_px = 8;
constexpr float kOutlierMass = 0.5f;
// Poses nearer than this fall to the same answer.
constexpr double kApart_m = 3e-3, kApart_rad = 0.035;

bool better(const PoseCandidate& a, const PoseCandidate& b) { return a.score > b.score; }

KernelField::Region around(const OrientedPoints& points, double margin_px) {
  const auto [u_least, u_most] = std::minmax_element(points.u.begin(), points.u.end());
  const auto [v_least, v_most] = std::minmax_element(points.v.begin(), points.v.end());
  return {*u_least - margin_px, *v_least - margin_px, *u_most - *u_least + 2 * margin_px,
          *v_most - *v_least + 2 * margin_px};
}

}  // namespace

void projectedPoints(const OrientedModel& model, const XrayView& view, const Pose& T_camera_centered, double spacing_px,
                     OrientedPoints& to) {
  to.clear();
  to.begin.push_back(0);
  const Pose T = view.T_view_first * T_camera_centered;
  double since_px = 0;  // Length since the last point.
  for (const auto& [parent, child] : model.edges) {
    const auto a = view.camera.project(T * model.points.col(parent)),
               b = view.camera.project(T * model.points.col(child));
    if (!a || !b) continue;
    const Eigen::Vector2d d = *b - *a, at = 0.5 * (*a + *b);
    const double length = d.norm();
    if (!(length > 0.05 && length < 1e4)) continue;  // Seen end-on, or next to the source.
    since_px += length;
    if (since_px < spacing_px) continue;
    to.add(static_cast<float>(at.x()), static_cast<float>(at.y()),
           static_cast<float>((d.x() * d.x() - d.y() * d.y()) / (length * length)),
           static_cast<float>(2 * d.x() * d.y() / (length * length)), static_cast<float>(since_px));
    since_px = 0;
  }
}

std::vector<PoseCandidate> searchShifts(const OrientedModel& model, const OrientedFrame& frame,
                                        const std::vector<Pose>& hypotheses, double reach_m, std::size_t keep) {
  const XrayView& view = frame.views().front();
  OrientedPoints image, given, lines;
  const double point_px = frame.length_px() / std::max(1, frame.pointCount());
  thinned(frame.points(0), std::max(1, static_cast<int>(kImageSpacing_px / std::max(0.1, point_px))), given);
  image.begin.push_back(0);
  for (int j = 0; j < given.size(); ++j) {
    if (!view.camera.sees({given.u[j], given.v[j]})) continue;  // A file may hold anything.
    image.add(given.u[j], given.v[j], given.cos2[j], given.sin2[j], given.mass_px[j]);
  }
  std::vector<PoseCandidate> found, kept;
  if (image.size() == 0) return kept;
  float total = 0;
  for (const float mass : image.mass_px) total += mass;
  KernelField field;
  std::vector<std::ptrdiff_t> cell_of(static_cast<std::size_t>(image.size()));
  for (const Pose& hypothesis : hypotheses) {
    const Pose T = view.T_view_first * hypothesis;
    const double metres_per_pixel = std::max(0.05, T.translation().z()) / view.camera.parameters().fx_px;
    // Further than across the detector nothing is seen.
    const double reach_px =
        std::min(reach_m / metres_per_pixel, std::hypot(view.camera.width_px(), view.camera.height_px()));
    projectedPoints(model, view, hypothesis, kModelSpacing_px, lines);
    field.build(lines, kScale_px, around(image, reach_px + kScale_px));
    const double step_px = field.cell_px();
    const int reach = static_cast<int>(std::ceil(reach_px / step_px));
    for (std::size_t j = 0; j < cell_of.size(); ++j) {
      cell_of[j] = 4 * (std::lround((image.v[j] - field.v_origin_px()) / step_px) * field.columns() +
                        std::lround((image.u[j] - field.u_origin_px()) / step_px));
    }
    for (int dv = -reach; dv <= reach; ++dv) {
      for (int du = -reach; du <= reach; ++du) {
        const std::ptrdiff_t offset = 4 * (static_cast<std::ptrdiff_t>(dv) * field.columns() + du);
        float sum = 0;
        for (std::size_t j = 0; j < cell_of.size(); ++j) {
          const float* cell = field.cells() + cell_of[j] + offset;
          const float F = std::max(0.0f, 0.5f * (cell[0] + image.cos2[j] * cell[1] + image.sin2[j] * cell[2]));
          sum += image.mass_px[j] * F / (F + kOutlierMass);
        }
        // Where the image's points would have to go, the model has to come from.
        const Eigen::Translation3d shift(-du * step_px * metres_per_pixel, -dv * step_px * metres_per_pixel, 0);
        found.push_back({view.T_view_first.inverse() * (shift * T), sum / total});
      }
    }
    if (found.size() > 64 * keep) {
      std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(32 * keep), found.end(), better);
      found.resize(32 * keep);
    }
  }
  std::sort(found.begin(), found.end(), better);
  for (const auto& candidate : found) {
    if (kept.size() == keep) break;
    const Pose& T = candidate.T_camera_centered;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const PoseCandidate& other) {
      return (other.T_camera_centered.translation() - T.translation()).head<2>().norm() < kApart_m &&
             rotationAngle(other.T_camera_centered.linear().transpose() * T.linear()) < kApart_rad;
    });
    if (!known) kept.push_back(candidate);
  }
  return kept;
}

}  // namespace angio::registration
