// SPDX-License-Identifier: GPL-2.0-or-later
#include "field_search.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {
namespace {

// A pose that leaves less than this share of the model in view scores in proportion: few points fit anywhere.
constexpr double kMinInView = 0.2;

constexpr double kFarthest_px = 1e6;

// Shifts are tried in steps of one scale: the steps that follow bridge half of that.
constexpr int kShiftCells = 2;

bool better(const PoseCandidate& a, const PoseCandidate& b) { return a.score > b.score; }

void keepBest(std::vector<PoseCandidate>& candidates, std::size_t keep) {
  keep = std::min(keep, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(keep), candidates.end(),
                    better);
  candidates.resize(keep);
}

}  // namespace

int FieldSearch::ascend(OrientedFrame& frame, const PosePriorTerm& belief, const ModelPoints& points, int scale,
                        int max_steps, PoseCandidate& candidate) const {
  PullWeight weight;
  weight.outlier_mass = static_cast<float>(settings_.outlier_mass);
  weight.along = static_cast<float>(settings_.along_stiffness);
  const double scale_px = kFieldScales_px[static_cast<std::size_t>(scale)];
  for (int step = 0;; ++step) {
    Matrix6d H = Matrix6d::Zero();
    Vector6d g = Vector6d::Zero();
    double fit = 0, seen = 0, pixels_per_metre = 0;
    for (std::size_t v = 0; v < frame.viewCount(); ++v) {
      const XrayView& view = frame.views()[v];
      const Pose T = view.T_view_first * candidate.T_camera_centered;
      const FieldSums sums = sampleField(points, frame.field(v, scale), view.camera, frame.fieldOfView(v), T, weight);
      const double pixels = view.camera.parameters().fx_px / std::max(0.05, T.translation().z());
      // Points nearer to each other than the kernel is wide say the same thing: they count as one.
      const double independent = std::min(1.0, pixels * model_.spacing_m * model_.size() / points.count / scale_px);
      H += independent * sums.H;
      g += independent * sums.g;
      fit += sums.fit;
      seen += sums.seen;
      pixels_per_metre = std::max(pixels_per_metre, pixels);
    }
    const double enough = kMinInView * points.count * static_cast<double>(frame.viewCount());
    candidate.score = fit / std::max(seen, std::max(1e-9, enough));
    if (step == max_steps) return step;
    Vector6d g_belief = Vector6d::Zero();
    belief.add(candidate.T_camera_centered, H, g_belief);
    const Twist dx = H.ldlt().solve(g - g_belief);
    if (!dx.allFinite()) return step;
    candidate.T_camera_centered = candidate.T_camera_centered * expSE3(dx);
    const double moved_px = pixels_per_metre * (dx.head<3>().norm() + model_.radius_m * dx.tail<3>().norm());
    if (moved_px < 0.05 * scale_px) max_steps = step + 1;
  }
}

int FieldSearch::halve(OrientedFrame& frame, const PosePriorTerm& belief, std::vector<PoseCandidate>& candidates,
                       std::size_t keep) const {
  struct Rung {
    int subset, scale, steps;
    std::size_t share;  // Candidates that go on, as a divisor of all.
  };
  constexpr Rung kRungs[] = {{0, 0, 3, 4}, {1, 1, 4, 10}, {2, 2, 4, 32}, {3, 2, 4, 64}};
  const std::size_t all = candidates.size();
  int steps = 0;
  for (const Rung& rung : kRungs) {
    const auto& points = model_.subsets[static_cast<std::size_t>(rung.subset)];
    for (auto& candidate : candidates) steps += ascend(frame, belief, points, rung.scale, rung.steps, candidate);
    keepBest(candidates, std::max(keep, all / rung.share));
  }
  keepBest(candidates, keep);
  return steps;
}

std::vector<PoseCandidate> FieldSearch::everyShift(OrientedFrame& frame, const std::vector<Pose>& hypotheses,
                                                   double reach_m, std::size_t keep,
                                                   const SearchProgress& progress) const {
  const ModelPoints& points = model_.subsets.front();
  const XrayView& view = frame.views().front();
  const KernelField& field = frame.field(0, 0);
  const float step_px = field.cell_px();
  // The detector in cells of the field, which may cover less.
  const int column_least = static_cast<int>(std::floor(-field.u_origin_px() / step_px)),
            row_least = static_cast<int>(std::floor(-field.v_origin_px() / step_px));
  const int column_most = column_least + static_cast<int>(view.camera.width_px() / step_px),
            row_most = row_least + static_cast<int>(view.camera.height_px() / step_px);
  std::vector<int> column, row;
  std::vector<float> cos2, sin2, weight;
  std::vector<PoseCandidate> found;
  for (std::size_t h = 0; h < hypotheses.size(); ++h) {
    const Pose& hypothesis = hypotheses[h];
    if (progress && h % 64 == 0) progress(0.9 * static_cast<double>(h) / static_cast<double>(hypotheses.size()));
    const Pose T = view.T_view_first * hypothesis;
    const double metres_per_pixel = std::max(0.05, T.translation().z()) / view.camera.parameters().fx_px;
    // Further than across the detector nothing is seen.
    const double reach_px =
        std::min(reach_m / metres_per_pixel, std::hypot(view.camera.width_px(), view.camera.height_px()));
    const int reach = static_cast<int>(std::ceil(reach_px / step_px));
    column.clear();
    row.clear();
    cos2.clear();
    sin2.clear();
    weight.clear();
    for (int i = 0; i < points.count; ++i) {
      const Eigen::Vector3d p = T * Eigen::Vector3d(points.x[i], points.y[i], points.z[i]);
      const Eigen::Vector3d t = T.linear() * Eigen::Vector3d(points.tx[i], points.ty[i], points.tz[i]);
      const auto pixel = view.camera.project(p);
      if (!pixel) continue;
      const double du = t.x() - p.x() / p.z() * t.z(), dv = t.y() - p.y() / p.z() * t.z();
      const double length2 = std::max(1e-12, du * du + dv * dv), length = std::min(1.0, std::sqrt(length2));
      // Next to the source a pixel may be anywhere.
      const Eigen::Vector2d at = pixel->cwiseMax(-kFarthest_px).cwiseMin(kFarthest_px);
      column.push_back(static_cast<int>(std::lround((at.x() - field.u_origin_px()) / step_px)));
      row.push_back(static_cast<int>(std::lround((at.y() - field.v_origin_px()) / step_px)));
      cos2.push_back(static_cast<float>((du * du - dv * dv) / length2 * length));
      sin2.push_back(static_cast<float>(2 * du * dv / length2 * length));
      weight.push_back(points.weight[i] * static_cast<float>(length));
    }
    float all = 0;
    for (const float w : weight) all += w;
    const auto outlier_mass = static_cast<float>(settings_.outlier_mass);
    for (int dv = -reach; dv <= reach; dv += kShiftCells) {
      for (int du = -reach; du <= reach; du += kShiftCells) {
        float fit = 0, seen = 0;
        for (std::size_t i = 0; i < column.size(); ++i) {
          const int c = column[i] + du, r = row[i] + dv;
          if (c < column_least || r < row_least || c > column_most || r > row_most) continue;
          seen += weight[i];
          if (c < 0 || r < 0 || c >= field.columns() || r >= field.rows()) continue;
          const float* cell = field.cells() + 4 * (static_cast<std::size_t>(r) * field.columns() + c);
          const float F = std::max(0.0f, 0.5f * (cell[0] + cos2[i] * cell[1] + sin2[i] * cell[2]));
          fit += weight[i] * F / (F + outlier_mass);
        }
        PoseCandidate candidate;
        candidate.score = fit / std::max({1e-9f, seen, static_cast<float>(kMinInView) * all});
        // Of the neighbours on the grid one is enough; the steps after this find the rest.
        candidate.T_camera_centered =
            view.T_view_first.inverse() *
            (Eigen::Translation3d(du * step_px * metres_per_pixel, dv * step_px * metres_per_pixel, 0) * T);
        found.push_back(candidate);
      }
    }
    if (found.size() > 8 * keep) {
      std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(keep), found.end(), better);
      found.resize(keep);
    }
  }
  keepBest(found, keep);
  return found;
}

}  // namespace angio::registration
