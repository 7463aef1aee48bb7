// SPDX-License-Identifier: GPL-2.0-or-later
#include "anatomy.hpp"

#include <algorithm>
#include <cmath>

#include "uniform.hpp"
#include "volume_rays.hpp"

namespace angio::simulation {
namespace {

constexpr float kRange = 0.85F;  // Of the log-attenuation that is shown, to both sides of the mean.

// A camera whose pixels are the grid's nodes.
XrayCamera nodeCamera(const XrayCamera& camera) {
  XrayCamera::Parameters p = camera.parameters();
  p.width_px = Anatomy::nodesAcross(p.width_px);
  p.height_px = Anatomy::nodesAcross(p.height_px);
  for (double* length_px : {&p.fx_px, &p.fy_px, &p.cx_px, &p.cy_px}) *length_px /= Anatomy::kCell;
  return XrayCamera(p);
}

bool same(const XrayCamera::Parameters& a, const XrayCamera::Parameters& b) {
  return a.width_px == b.width_px && a.height_px == b.height_px && a.fx_px == b.fx_px && a.fy_px == b.fy_px &&
         a.cx_px == b.cx_px && a.cy_px == b.cy_px;
}

// The part of a grid that may see a shape: [left, right) x [top, bottom).
struct Box {
  int left, right, top, bottom;
};

Box boxOf(const ShapeInView& shape, const XrayCamera& nodes, const RowBand& rows) {
  const auto& K = nodes.parameters();
  const Eigen::Vector3d& c = shape.center();
  const double nearest = c.z() - shape.reach_m();
  if (c.z() + shape.reach_m() <= 0) return {0, 0, 0, 0};
  if (nearest <= 0.1) return {0, K.width_px, rows.top, rows.bottom};
  const auto span = [&](double x, double f, double center, int low, int high) {
    // The ball's edge, seen from the source: no further than by the reach at its nearest point.
    const double a = center + f * std::min((x - shape.reach_m()) / nearest, (x - shape.reach_m()) / c.z());
    const double b = center + f * std::max((x + shape.reach_m()) / nearest, (x + shape.reach_m()) / c.z());
    const int first = static_cast<int>(std::clamp(std::ceil(a), static_cast<double>(low), static_cast<double>(high)));
    const int last =
        static_cast<int>(std::clamp(std::floor(b) + 1, static_cast<double>(low), static_cast<double>(high)));
    return std::pair<int, int>(first, last);
  };
  const auto [left, right] = span(c.x(), K.fx_px, K.cx_px, 0, K.width_px);
  const auto [top, bottom] = span(c.y(), K.fy_px, K.cy_px, rows.top, rows.bottom);
  return {left, right, top, bottom};
}

// Depths from `in` to `out` of each ray of a row.
struct Spans {
  std::vector<double> in, out;

  void meet(const ShapeInView& shape, const RayRow& rays) {
    in.resize(rays.count);
    out.resize(rays.count);
    shape.meet(rays, in.data(), out.data());
  }
};

// Length of span i that lies in none of others.
double lengthWithout(const Spans& spans, const std::vector<Spans>& others, int i) {
  const double end = spans.out[i];
  double left = end - spans.in[i], covered_to = spans.in[i];
  // Spans are few: the one that begins first is looked for anew each time.
  for (std::size_t n = 0; n < others.size(); ++n) {
    const Spans* next = nullptr;
    for (const Spans& other : others) {
      if (other.out[i] > covered_to && other.in[i] < end && (!next || other.in[i] < next->in[i])) next = &other;
    }
    if (!next) break;
    const double to = std::min(next->out[i], end);
    left -= to - std::max(next->in[i], covered_to);
    covered_to = to;
  }
  return left;
}

constexpr double kBodyRadius = 0.15;  // [m] Clouds fill a ball of this size, a little more than a detector sees.

// exp(-d^2 / 2 sigma^2) at grid nodes first..last, d from `centre` [px].
void bump(double center, double sigma, int first, int last, std::vector<float>& values) {
  for (int i = first; i <= last; ++i) {
    const double d = (i * Background::kCell - center) / sigma;
    values[i] = static_cast<float>(std::exp(-0.5 * d * d));
  }
}

}  // namespace

Anatomy::Anatomy(const Eigen::Vector3d& center_model, const Eigen::Matrix3d& R_lps_model,
                 const FluoroscopySettings& settings, std::optional<AttenuationVolume> volume)
    : body_(volume ? Body{} : bodyAround(settings.anatomy, static_cast<std::uint64_t>(settings.seed))),
      contrast_(settings.anatomy.contrast),
      soft_tissue_(center_model, settings.background_strength, settings.background_structure_mm * 1e-3,
                   static_cast<std::uint64_t>(settings.seed)),
      volume_(std::move(volume)) {
  T_model_body_.setIdentity();
  T_model_body_.linear() = R_lps_model.transpose();
  T_model_body_.translation() = center_model;
  if (volume_) volume_->check();
}

void Anatomy::addTissues(const RowBand& rows, const XrayCamera& nodes, const Pose& T_camera_body) {
  const auto& K = nodes.parameters();
  Spans spans;
  std::vector<Spans> others;
  for (const Tissue& tissue : body_.tissues) {
    const ShapeInView shape(tissue.shape, T_camera_body);
    std::vector<ShapeInView> without;
    for (const Shape& other : tissue.without) without.emplace_back(other, T_camera_body);
    others.resize(without.size());
    const Box box = boxOf(shape, nodes, rows);
    RayRow rays{(box.left - K.cx_px) / K.fx_px, 1 / K.fx_px, 0, box.right - box.left};
    for (int j = box.top; j < box.bottom; ++j) {
      rays.dy = (j - K.cy_px) / K.fy_px;
      spans.meet(shape, rays);
      for (std::size_t n = 0; n < without.size(); ++n) others[n].meet(without[n], rays);
      float* row = grid_.data() + static_cast<std::size_t>(j) * K.width_px + box.left;
      for (int i = 0; i < rays.count; ++i) {
        const double depth = others.empty() ? spans.out[i] - spans.in[i] : lengthWithout(spans, others, i);
        row[i] += static_cast<float>(tissue.attenuation_per_m * depth);
      }
    }
  }
  // From depths to lengths along the rays.
  for (int j = rows.top; j < rows.bottom; ++j) {
    const double dy = (j - K.cy_px) / K.fy_px;
    float* row = grid_.data() + static_cast<std::size_t>(j) * K.width_px;
    for (int i = 0; i < K.width_px; ++i) {
      const double dx = (i - K.cx_px) / K.fx_px;
      row[i] *= static_cast<float>(std::sqrt(dx * dx + dy * dy + 1));
    }
  }
}

void Anatomy::addBones(const XrayCamera& nodes, const Pose& T_camera_body, int threads) {
  if (body_.bones.bone.empty()) return;
  const float* bone = bone_.compute(body_.bones.bone, nodes, T_camera_body, threads).ptr<float>();
  const float* marrow = marrow_.compute(body_.bones.marrow, nodes, T_camera_body, threads).ptr<float>();
  constexpr float kBone = static_cast<float>(kBoneAttenuation_per_m);
  constexpr float kMarrow = static_cast<float>(kMarrowOverBone * kBoneAttenuation_per_m);
  for (std::size_t i = 0; i < grid_.size(); ++i) grid_[i] += kBone * bone[i] + kMarrow * marrow[i];
}

const std::vector<float>& Anatomy::transmission(const XrayCamera& camera, const Pose& T_camera_model, int threads) {
  if (seen_ && same(seen_->camera, camera.parameters()) && seen_->T_camera_model == T_camera_model.matrix()) {
    return grid_;
  }
  const XrayCamera nodes = nodeCamera(camera);
  const auto& K = nodes.parameters();
  const Pose T_camera_body = T_camera_model * T_model_body_;
  grid_.assign(static_cast<std::size_t>(K.width_px) * K.height_px, 0.0F);
  std::optional<VolumeRays> rays;
  if (volume_) rays.emplace(*volume_, T_camera_model);
  forBands(threads, K.height_px, [&](const RowBand& rows) {
    addTissues(rows, nodes, T_camera_body);
    for (int j = rays ? rows.top : rows.bottom; j < rows.bottom; ++j) {
      for (int i = 0; i < K.width_px; ++i) {
        grid_[static_cast<std::size_t>(j) * K.width_px + i] +=
            rays->logAttenuation((i - K.cx_px) / K.fx_px, (j - K.cy_px) / K.fy_px);
      }
    }
  });
  addBones(nodes, T_camera_body, threads);

  const std::vector<float>& soft = soft_tissue_.logAttenuation(camera, T_camera_model);
  const int soft_columns = Background::nodesAcross(camera.width_px());
  const float shown = static_cast<float>(contrast_);
  double sum = 0;
  for (int j = 0; j < K.height_px; ++j) {
    // Every second node is one of the soft tissue's grid; the others lie between two.
    static_assert(Background::kCell == 2 * kCell);
    const float* above = soft.data() + static_cast<std::size_t>(j / 2) * soft_columns;
    const float* below = j % 2 ? above + soft_columns : above;
    float* row = grid_.data() + static_cast<std::size_t>(j) * K.width_px;
    for (int i = 0; i < K.width_px; ++i) {
      const int k = i / 2, next = k + i % 2;
      row[i] = shown * row[i] + 0.25F * (above[k] + above[next] + below[k] + below[next]);
      sum += row[i];
    }
  }
  // Automatic exposure: the mean of what comes through is what the settings ask for. Lungs do not dazzle: systems
  // compress what is far from it.
  const float mean = static_cast<float>(sum / static_cast<double>(grid_.size()));
  for (float& value : grid_) value = std::exp(kRange * std::tanh((mean - value) / kRange));
  seen_ = View{camera.parameters(), T_camera_model.matrix()};
  return grid_;
}

Background::Background(const Eigen::Vector3d& center_model, double strength, double structure_m, std::uint64_t seed) {
  Uniform uniform(seed);
  struct Level {
    int count;
    double size, share;  // Relative to the largest structure; share of the standard deviation.
  };
  for (const Level level : {Level{100, 0.5, 0.85}, Level{300, 0.2, 0.45}, Level{600, 0.1, 0.2}}) {
    for (int i = 0; i < level.count; ++i) {
      Eigen::Vector3d p;
      do {
        p = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      } while (p.squaredNorm() > 1);
      const double sigma = structure_m * level.size * uniform(0.6, 1.4);
      // Bumps of random sign, n on a disc of radius R: variance = n / (pi R^2) * peak^2 pi sigma^2. Uniform in (-a, a)
      // has the variance a^2 / 3.
      const double a = std::sqrt(3.0) * strength * level.share * kBodyRadius / (sigma * std::sqrt(level.count));
      clouds_.push_back({center_model + kBodyRadius * p, sigma, uniform(-a, a)});
    }
  }
}

void Background::addCloud(const Cloud& cloud, const XrayCamera& camera, const Pose& T_camera_model) {
  const Eigen::Vector3d center = T_camera_model * cloud.center;
  if (center.z() < 4 * cloud.std_m) return;  // Around the source there is no patient.
  const auto& K = camera.parameters();
  const Eigen::Vector2d seen = *camera.project(center);
  const int columns = nodesAcross(K.width_px), rows = nodesAcross(K.height_px);
  const auto span = [](double middle, double sigma, int count) {
    const double low = (middle - 3 * sigma) / kCell, high = (middle + 3 * sigma) / kCell;
    return std::pair<int, int>(static_cast<int>(std::ceil(std::clamp(low, 0.0, static_cast<double>(count)))),
                               static_cast<int>(std::floor(std::clamp(high, -1.0, count - 1.0))));
  };
  const double std_x = K.fx_px * cloud.std_m / center.z(), std_y = K.fy_px * cloud.std_m / center.z();
  const auto [left, right] = span(seen.x(), std_x, columns);
  const auto [top, bottom] = span(seen.y(), std_y, rows);
  bump(seen.x(), std_x, left, right, across_);
  bump(seen.y(), std_y, top, bottom, down_);
  for (int j = top; j <= bottom; ++j) {
    const float height = static_cast<float>(cloud.peak) * down_[j];
    float* row = grid_.data() + static_cast<std::size_t>(j) * columns;
    for (int i = left; i <= right; ++i) row[i] += height * across_[i];
  }
}

const std::vector<float>& Background::logAttenuation(const XrayCamera& camera, const Pose& T_camera_model) {
  const int columns = nodesAcross(camera.width_px()), rows = nodesAcross(camera.height_px());
  grid_.assign(static_cast<std::size_t>(columns) * rows, 0.0F);
  across_.resize(columns);
  down_.resize(rows);
  for (const Cloud& cloud : clouds_) addCloud(cloud, camera, T_camera_model);
  return grid_;
}

}  // namespace angio::simulation
