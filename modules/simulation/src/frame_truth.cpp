// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/frame_truth.hpp"

#include <algorithm>
#include <cmath>

#include "angio/simulation/collimator.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/simulation/intensifier.hpp"
#include "renderer_parts.hpp"

namespace angio::simulation {
namespace {

// A point of an axis as the image has it.
struct Seen {
  Eigen::Vector2d px;
  double radius_px, contrast;
};

// A stretch of axis between two points, in the camera's frame.
struct Stretch {
  Eigen::Vector3d a, b;
  double radius_m;
};

// A ray along the vessel would meet much of it; what bends away does not count.
constexpr double kMinSine = 0.25;

constexpr double kMaxLength_px = 1e5;  // Of a stretch; one that comes near the source has no end.

// Length of the ray's way through a tube at a point of its axis.
double chord(const Stretch& s, const Eigen::Vector3d& p) {
  const double sine = (s.b - s.a).normalized().cross(p.normalized()).norm();
  return 2 * s.radius_m / std::max(sine, kMinSine);
}

bool inside(const std::vector<Eigen::Vector2d>& corners, const Eigen::Vector2d& p) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d along = corners[(i + 1) % corners.size()] - corners[i], to = p - corners[i];
    if (along.x() * to.y() - along.y() * to.x() < 0) return false;
  }
  return true;
}

// Gathers points into branches; a point that is not seen ends one.
class Branches {
 public:
  explicit Branches(double min_px) : min_px_(min_px) {}

  void add(const Seen& seen) { open_.push_back(seen); }

  void end(CurveKind kind) {
    double length = 0;
    for (std::size_t i = 1; i < open_.size(); ++i) length += (open_[i].px - open_[i - 1].px).norm();
    if (open_.size() > 1 && length >= min_px_) {
      seen_.insert(seen_.end(), open_.begin(), open_.end());
      branch_.insert(branch_.end(), open_.size(), count_++);
      kind_.insert(kind_.end(), open_.size(), kind);
    }
    open_.clear();
  }

  Centerline2d centerline() const {
    Eigen::Matrix2Xd points(2, seen_.size());
    Eigen::VectorXd radius(seen_.size()), contrast(seen_.size());
    for (std::size_t i = 0; i < seen_.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      points.col(k) = seen_[i].px;
      radius[k] = seen_[i].radius_px;
      contrast[k] = seen_[i].contrast;
    }
    Centerline2d result = makeCenterline(points, branch_, radius);
    result.contrast = contrast;
    result.kind = kind_;
    return result;
  }

 private:
  double min_px_;
  int count_ = 0;
  std::vector<Seen> open_, seen_;
  std::vector<int> branch_;
  std::vector<CurveKind> kind_;
};

// What a renderer knows about the visibility of a point.
class Visibility {
 public:
  Visibility(const FluoroscopySettings& s, const XrayCamera& camera, const std::vector<float>& passed, double photons,
             double min_contrast_to_noise)
      : camera_(camera),
        passed_(passed),
        primary_(photons / (1 + s.detector.scatter_to_primary)),
        scatter_(s.detector.scatter_to_primary),
        electronic_variance_(s.electronic_noise_photons * s.electronic_noise_photons),
        min_contrast_to_noise_(min_contrast_to_noise),
        open_(openField(s.collimator, camera.width_px(), camera.height_px())),
        intensifier_(intensifierDistortion(s.intensifier, camera.width_px(), camera.height_px())) {}

  const std::vector<Eigen::Vector2d>& openFieldIdeal() const { return open_; }
  Eigen::Vector2d inImage(const Eigen::Vector2d& ideal_px) const { return intensifier_.distorted(ideal_px); }

  /// Whether something that wide, which takes a share of the beam, is seen there: in the open field, on the detector,
  /// and above the noise of a square as wide as it is.
  bool sees(const Eigen::Vector2d& px, double radius_px, double taken) const {
    if (!camera_.sees(px) || !inside(open_, px) || !camera_.sees(inImage(px))) return false;
    const int i = static_cast<int>(px.x() + 0.5) / Anatomy::kCell, j = static_cast<int>(px.y() + 0.5) / Anatomy::kCell;
    const double beam = passed_[static_cast<std::size_t>(j) * Anatomy::nodesAcross(camera_.width_px()) + i];
    const double noise = std::sqrt(primary_ * (beam + scatter_) + electronic_variance_);
    return primary_ * beam * taken / noise * std::max(2 * radius_px, 1.0) >= min_contrast_to_noise_;
  }

 private:
  const XrayCamera& camera_;
  const std::vector<float>& passed_;
  double primary_, scatter_, electronic_variance_, min_contrast_to_noise_;
  std::vector<Eigen::Vector2d> open_;
  DetectorDistortion intensifier_;
};

// Walks along a stretch, its end left to the next one unless it is the last. `taken` gives the log-attenuation of a
// length [m] at a part of the stretch.
template <typename Attenuation>
void walk(const Stretch& stretch, bool last, const XrayCamera& camera, double spacing_px, const Visibility& visibility,
          CurveKind kind, const Attenuation& attenuation, Branches& branches) {
  const auto from = camera.project(stretch.a), to = camera.project(stretch.b);
  if (!from || !to) return branches.end(kind);
  const double length_px = std::min((*to - *from).norm(), kMaxLength_px);
  const int steps = std::max(1, static_cast<int>(std::ceil(length_px / spacing_px)));
  for (int k = 0; k < steps + (last ? 1 : 0); ++k) {
    const double part = static_cast<double>(k) / steps;
    const Eigen::Vector3d p = stretch.a + part * (stretch.b - stretch.a);
    const Eigen::Vector2d px = *camera.project(p);
    const double radius_px = stretch.radius_m * camera.parameters().fx_px / p.z();
    const double log_taken = attenuation(part, chord(stretch, p));
    if (visibility.sees(px, radius_px, 1 - std::exp(-log_taken))) {
      branches.add({visibility.inImage(px), radius_px, log_taken});
    } else {
      branches.end(kind);
    }
  }
}

}  // namespace

FrameTruth FluoroscopyRenderer::truth(const XrayCamera& camera, const XrayScene& scene, const TruthSettings& settings) {
  checkSettings("truth", settings);
  Parts& parts = *parts_;
  parts.check(scene);
  const Visibility visibility(parts.settings, camera,
                              parts.anatomy.transmission(camera, scene.T_camera_model, parts.settings.threads),
                              parts.photons(camera), settings.min_contrast_to_noise);
  Branches branches(settings.min_px);

  const Eigen::Matrix3Xd points = scene.T_camera_model * scene.pointsOf(parts.tree);
  const auto density = [&](int i) { return scene.densities ? (*scene.densities)[i] : 1.0; };
  for (const auto& branch : parts.tree.branches()) {
    for (std::size_t k = 1; k < branch.size(); ++k) {
      const int a = branch[k - 1], b = branch[k];
      const double radius = 0.5 * (*parts.tree.radii()[a] + *parts.tree.radii()[b]);
      const auto taken = [&](double part, double length_m) {
        const double filled = (1 - part) * density(a) + part * density(b);
        return -std::log(std::max(parts.contrast.transmission(static_cast<float>(filled * length_m)), 1e-9F));
      };
      walk({points.col(a), points.col(b), radius}, k + 1 == branch.size(), camera, settings.spacing_px, visibility,
           CurveKind::kVessel, taken, branches);
    }
    branches.end(CurveKind::kVessel);
  }
  for (const Device& device : scene.devices) {
    const Eigen::Matrix3Xd line = scene.T_camera_model * device.points;
    for (Eigen::Index k = 1; k < line.cols(); ++k) {
      walk(
          {line.col(k - 1), line.col(k), 0.5 * device.diameter_m}, k + 1 == line.cols(), camera, settings.spacing_px,
          visibility, CurveKind::kDevice, [&](double, double length_m) { return device.attenuation_per_m * length_m; },
          branches);
    }
    branches.end(CurveKind::kDevice);
  }

  FrameTruth truth{branches.centerline(), {}};
  for (const Eigen::Vector2d& px : visibility.openFieldIdeal())
    truth.collimator_opening_px.push_back(visibility.inImage(px));
  return truth;
}

}  // namespace angio::simulation
