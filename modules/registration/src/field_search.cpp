// SPDX-License-Identifier: GPL-2.0-or-later
#include "field_search.hpp"
#include "angio/geometry/decompositions.hpp"

#include <algorithm>
#include <cmath>

#include "explained_shares.hpp"
#include "oriented_frame.hpp"

namespace angio::registration {
namespace {

// A pose that leaves less than this share of the model in view scores in proportion: few points fit anywhere.
constexpr double kMinInView = 0.2;

// What projection leaves of a length on average over all directions.
constexpr double kMeanForeshortening = kPi / 4;

constexpr double kFarthest_px = 1e6;

// Shifts are tried in steps of one scale: the steps that follow bridge half of that.
constexpr int kShiftCells = 2;

void keepBest(std::vector<PoseCandidate>& candidates, std::size_t keep) {
  keep = std::min(keep, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(keep), candidates.end(),
                    better);
  candidates.resize(keep);
}

constexpr double kScale_px = 16;  // Of the model's field, whose cells are the steps of the shifts.
constexpr double kModelSpacing_px = 4;
constexpr double kImageSpacing_px = 8;
constexpr float kOutlierMass = 0.5f;
// Poses nearer than this fall to the same answer.
constexpr double kApart_m = 3e-3, kApart_rad = 0.035;

KernelField::Region around(const OrientedPoints& points, double margin_px) {
  const auto [u_min, u_max] = std::minmax_element(points.u.begin(), points.u.end());
  const auto [v_min, v_max] = std::minmax_element(points.v.begin(), points.v.end());
  return {*u_min - margin_px, *v_min - margin_px, *u_max - *u_min + 2 * margin_px, *v_max - *v_min + 2 * margin_px};
}

}  // namespace

double FieldSearch::enoughInView(OrientedFrame& frame, const FieldHypothesis& hypothesis,
                                 const Pose& T_camera_centered) const {
  if (!(hypothesis.image_share > 0)) return kMinInView;
  const XrayView& view = frame.views().front();
  const double depth_m = std::max(0.05, (view.T_view_first * T_camera_centered).translation().z());
  const double model_px =
      kMeanForeshortening * model_.spacing_m * model_.size() * view.camera.parameters().fx_px / depth_m;
  const double image_px = frame.chordLength_px() / static_cast<double>(frame.viewCount());
  return std::max(kMinInView, hypothesis.image_share * std::min(1.0, image_px / model_px));
}

int FieldSearch::ascend(OrientedFrame& frame, const PosePriorTerm& belief, const ModelPoints& points, int scale,
                        int max_steps, const FieldHypothesis& hypothesis, PoseCandidate& candidate) const {
  PullWeight weight;
  weight.outlier_mass = static_cast<float>(hypothesis.outlier_mass);
  weight.along = static_cast<float>(OrientedKernelSettings::along_stiffness);
  const double scale_px = kFieldScales_px[scale];
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
    const double share =
        std::max(kMinInView, kMeanForeshortening * enoughInView(frame, hypothesis, candidate.T_camera_centered));
    const double enough = share * points.count * static_cast<double>(frame.viewCount());
    candidate.score = fit / std::max(seen, std::max(1e-9, enough));
    if (step == max_steps) return step;
    Vector6d g_belief = Vector6d::Zero();
    belief.add(candidate.T_camera_centered, H, g_belief);
    const Twist dx = solveSymmetric(H, g - g_belief);
    if (!dx.allFinite()) return step;
    candidate.T_camera_centered = candidate.T_camera_centered * expSE3(dx);
    const double moved_px = pixels_per_metre * (dx.head<3>().norm() + model_.radius_m * dx.tail<3>().norm());
    if (moved_px < 0.05 * scale_px) max_steps = step + 1;
  }
}

int FieldSearch::halve(OrientedFrame& frame, const PosePriorTerm& belief, const FieldHypothesis& hypothesis,
                       std::vector<PoseCandidate>& candidates, std::size_t keep) const {
  struct Rung {
    int subset, scale, steps;
    std::size_t share;  // Candidates that go on, as a divisor of all.
  };
  constexpr Rung kRungs[] = {{0, 0, 3, 4}, {1, 1, 4, 10}, {2, 2, 4, 32}, {3, 2, 4, 64}};
  const std::size_t all = candidates.size();
  int steps = 0;
  for (const Rung& rung : kRungs) {
    const auto& points = model_.subsets[rung.subset];
    for (auto& candidate : candidates) {
      steps += ascend(frame, belief, points, rung.scale, rung.steps, hypothesis, candidate);
    }
    if (hypothesis.by_shares && rung.scale > 0 && frame.viewCount() == 1) {
      ExplainedShares shares(model_, frame, kFieldScales_px[static_cast<std::size_t>(rung.scale)]);
      for (auto& candidate : candidates) candidate.score = shares.of(candidate.T_camera_centered);
    }
    keepBest(candidates, std::max(keep, all / rung.share));
  }
  keepBest(candidates, keep);
  return steps;
}

std::vector<PoseCandidate> FieldSearch::everyShift(OrientedFrame& frame, const std::vector<Pose>& poses, double reach_m,
                                                   const FieldHypothesis& hypothesis, std::size_t keep,
                                                   const SearchProgress& progress) const {
  const ModelPoints& points = model_.subsets.front();
  const XrayView& view = frame.views().front();
  const KernelField& field = frame.field(0, 0);
  const float step_px = field.cell_px();
  // The detector in cells of the field, which may cover less.
  const int column_min = static_cast<int>(std::floor(-field.u_origin_px() / step_px)),
            row_min = static_cast<int>(std::floor(-field.v_origin_px() / step_px));
  const int column_max = column_min + static_cast<int>(view.camera.width_px() / step_px),
            row_max = row_min + static_cast<int>(view.camera.height_px() / step_px);
  std::vector<int> column, row;
  std::vector<float> cos2, sin2, weight;
  std::vector<PoseCandidate> found;
  for (std::size_t h = 0; h < poses.size(); ++h) {
    if (progress && h % 64 == 0) progress(0.9 * static_cast<double>(h) / static_cast<double>(poses.size()));
    const Pose T = view.T_view_first * poses[h];
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
    const auto mass = static_cast<float>(hypothesis.outlier_mass);
    const auto enough = std::max(1e-9f, static_cast<float>(enoughInView(frame, hypothesis, poses[h])) * all);
    for (int dv = -reach; dv <= reach; dv += kShiftCells) {
      for (int du = -reach; du <= reach; du += kShiftCells) {
        float fit = 0, seen = 0;
        for (std::size_t i = 0; i < column.size(); ++i) {
          const int c = column[i] + du, r = row[i] + dv;
          if (c < column_min || r < row_min || c > column_max || r > row_max) continue;
          seen += weight[i];
          if (c < 0 || r < 0 || c >= field.columns() || r >= field.rows()) continue;
          const float* cell = field.cells() + 4 * (static_cast<std::size_t>(r) * field.columns() + c);
          const float F = std::max(0.0f, 0.5f * (cell[0] + cos2[i] * cell[1] + sin2[i] * cell[2]));
          fit += weight[i] * F / (F + mass);
        }
        PoseCandidate candidate;
        candidate.score = fit / std::max(seen, enough);
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
