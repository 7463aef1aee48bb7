// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation_image.hpp"

#include "angio/base/errors.hpp"

namespace angio::evaluation {
namespace {

constexpr int kMinWindow_px = 32;
constexpr double kShareTolerance = 0.02;
constexpr double kMinSpurious_px = 60, kMaxSpurious_px = 250;
// Bends of vessels seen in X-ray: radii from about this on [px].
constexpr double kSpuriousBend_px = 80;
constexpr double kDefaultSpacing_px = 1.5;
// A guidewire: 0.014 inch of steel, whose attenuation at 60 keV is 0.95 per mm (NIST XCOM).
constexpr double kWireDiameter_m = 0.36e-3, kSteel_per_m = 950;

// Part of a detector: pixels x to x + width - 1, y to y + height - 1.
struct Window {
  int x = 0, y = 0, width = 0, height = 0;

  bool sees(const Eigen::Vector2d& p) const {
    return p.x() >= x - 0.5 && p.y() >= y - 0.5 && p.x() <= x + width - 0.5 && p.y() <= y + height - 0.5;
  }
};

// As large as `side_px` in x, shaped like the detector, about a pixel; what hangs over the detector's edge is cut off.
Window windowAbout(const Eigen::Vector2d& center, int side_px, const XrayCamera& camera) {
  const double half_x = 0.5 * side_px, half_y = half_x * camera.height_px() / camera.width_px();
  const auto clipped = [](double at, int size) { return std::clamp(static_cast<int>(std::lround(at)), 0, size); };
  Window w;
  w.x = clipped(center.x() - half_x, camera.width_px());
  w.y = clipped(center.y() - half_y, camera.height_px());
  w.width = clipped(center.x() + half_x, camera.width_px()) - w.x;
  w.height = clipped(center.y() + half_y, camera.height_px()) - w.y;
  return w;
}

double lengthOf(const std::vector<Curve>& curves, const Window* inside = nullptr) {
  double sum = 0;
  for (const auto& curve : curves) {
    for (std::size_t i = 1; i < curve.size(); ++i) {
      if (!inside || inside->sees(0.5 * (curve[i - 1] + curve[i]))) sum += (curve[i] - curve[i - 1]).norm();
    }
  }
  return sum;
}

// The smallest window about `centre` with at least the wanted length inside, or the one a pixel smaller if it is
// nearer.
Window windowWithLength(const std::vector<Curve>& curves, const Eigen::Vector2d& center, double length_px,
                        const XrayCamera& camera) {
  int too_small = kMinWindow_px, enough = 2 * camera.width_px() + 2;
  while (enough - too_small > 1) {
    const int middle = (enough + too_small) / 2;
    const Window w = windowAbout(center, middle, camera);
    (lengthOf(curves, &w) < length_px ? too_small : enough) = middle;
  }
  const Window a = windowAbout(center, too_small, camera), b = windowAbout(center, enough, camera);
  return std::abs(lengthOf(curves, &a) - length_px) < std::abs(lengthOf(curves, &b) - length_px) ? a : b;
}

Window windowFor(const std::vector<Curve>& curves, const XrayCamera& camera, double visible_fraction,
                 SimulationRandom random) {
  const Window all{0, 0, camera.width_px(), camera.height_px()};
  const double whole_px = lengthOf(curves);
  if (!(lengthOf(curves, &all) > visible_fraction * whole_px)) return all;
  std::vector<Eigen::Vector2d> seen;
  for (const auto& curve : curves) {
    for (const auto& p : curve) {
      if (all.sees(p)) seen.push_back(p);
    }
  }
  Window best = all;
  double best_off = 1;
  for (int attempt = 0; attempt < 50 && best_off > kShareTolerance; ++attempt) {
    const auto at = static_cast<std::size_t>(random.uniform() * static_cast<double>(seen.size()));
    const Window w = windowWithLength(curves, seen[std::min(at, seen.size() - 1)], visible_fraction * whole_px, camera);
    const double off = std::abs(lengthOf(curves, &w) / whole_px - visible_fraction);
    if (off < best_off) best = w, best_off = off;
  }
  return best;
}

// The parts of a curve inside the window, in the window's own pixels. One point alone has no direction: not a part.
std::vector<Curve> partsInside(const Curve& curve, const Window& window) {
  std::vector<Curve> parts(1);
  for (const auto& p : curve) {
    if (window.sees(p)) {
      parts.back().push_back(p - Eigen::Vector2d(window.x, window.y));
    } else if (!parts.back().empty()) {
      parts.emplace_back();
    }
  }
  parts.erase(std::remove_if(parts.begin(), parts.end(), [](const Curve& c) { return c.size() < 2; }), parts.end());
  return parts;
}

// Points in equal steps of about `spacing_px` along the curve, both ends included; 0 keeps the curve's own.
Curve walked(const Curve& curve, double spacing_px) {
  if (!(spacing_px > 0)) return curve;
  const double length_px = lengthOf({curve});
  const int steps = std::max(1, static_cast<int>(std::lround(length_px / spacing_px)));
  Curve result{curve.front()};
  double behind_px = 0;
  for (std::size_t i = 1; i < curve.size(); ++i) {
    const double edge_px = (curve[i] - curve[i - 1]).norm();
    for (double at = length_px * static_cast<double>(result.size()) / steps;
         static_cast<int>(result.size()) < steps && at <= behind_px + edge_px;
         at = length_px * static_cast<double>(result.size()) / steps) {
      const double w = edge_px > 0 ? (at - behind_px) / edge_px : 0.0;
      result.push_back((1 - w) * curve[i - 1] + w * curve[i]);
    }
    behind_px += edge_px;
  }
  result.push_back(curve.back());
  return result;
}

// A curve whose bend changes slowly, all of it on the detector: a wire, a rib's edge, a vessel of another organ.
Curve spuriousCurve(const XrayCamera& camera, double spacing_px, SimulationRandom& random) {
  double length_px = random.uniform(kMinSpurious_px, kMaxSpurious_px);
  for (;; length_px *= 0.95) {  // Shorter until it fits: in a small field of view little does.
    const double x = random.uniform(0, camera.width_px() - 1.0), y = random.uniform(0, camera.height_px() - 1.0);
    double heading = random.uniform(0, 2 * kPi), bend = random.normal() / kSpuriousBend_px;
    Curve curve{{x, y}};
    const int steps = std::max(1, static_cast<int>(std::lround(length_px / spacing_px)));
    bool inside = true;
    for (int i = 0; i < steps && inside; ++i) {
      bend += random.normal() * 0.15 / kSpuriousBend_px * std::sqrt(spacing_px);
      bend = std::clamp(bend, -2.0 / kSpuriousBend_px, 2.0 / kSpuriousBend_px);
      heading += bend * spacing_px;
      curve.push_back(curve.back() + spacing_px * Eigen::Vector2d(std::cos(heading), std::sin(heading)));
      inside = camera.sees(curve.back());
    }
    if (!inside) curve.pop_back();
    if (inside || length_px < spacing_px) return curve;
  }
}

Centerline2d asCenterline(const std::vector<Curve>& curves, const XrayCamera& camera,
                          const SimulationSettings& settings, int trial, int view) {
  SimulationRandom noise(settings.seed, trial, DrawFor::kNoise, view);
  std::vector<Eigen::Vector2d> points;
  std::vector<int> branch;
  int label = 0;
  for (const auto& curve : curves) {
    for (const auto& p : curve) {
      const Eigen::Vector2d q = p + settings.noise_px * noise.normals<2>();
      if (!camera.sees(q)) continue;
      points.push_back(q);
      branch.push_back(label);
    }
    ++label;
  }
  Eigen::Matrix2Xd matrix(2, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(i) = points[i];
  Centerline2d centerline = makeCenterline(std::move(matrix), std::move(branch));
  SimulationRandom turn(settings.seed, trial, DrawFor::kTangents, view);
  for (int i = 0; settings.tangent_noise_deg > 0 && i < centerline.size(); ++i) {
    const double by_rad = degToRad(settings.tangent_noise_deg) * turn.normal();
    centerline.tangent_rad[i] = undirected(centerline.tangent_rad[i] + by_rad);
  }
  return centerline;
}

// A curve of the image as a wire in the plane of the isocentre.
Device wireAlong(const Curve& curve, const XrayCamera& camera, const Pose& T_camera_model, double depth_m) {
  Device wire;
  wire.diameter_m = kWireDiameter_m;
  wire.attenuation_per_m = kSteel_per_m;
  wire.points.resize(3, curve.size());
  const Pose T_model_camera = T_camera_model.inverse();
  for (std::size_t i = 0; i < curve.size(); ++i) {
    wire.points.col(i) = T_model_camera * (depth_m * camera.ray(curve[i]));
  }
  return wire;
}

}  // namespace

SimulatedView simulatedView(const std::vector<Curve>& branches_px, const std::vector<bool>& shown,
                            const XrayCamera& camera, const SimulationSettings& settings, int trial, int view) {
  const Window window = windowFor(branches_px, camera, settings.visible_fraction,
                                  SimulationRandom(settings.seed, trial, DrawFor::kWindow, view));
  XrayCamera::Parameters p = camera.parameters();
  p.width_px = window.width;
  p.height_px = window.height;
  p.cx_px -= window.x;
  p.cy_px -= window.y;
  const XrayCamera cropped(p);

  std::vector<Curve> curves;
  for (std::size_t b = 0; b < branches_px.size(); ++b) {
    if (!shown[b]) continue;
    for (const auto& part : partsInside(branches_px[b], window)) curves.push_back(walked(part, settings.spacing_px));
  }
  SimulationRandom random(settings.seed, trial, DrawFor::kSpurious, view);
  const double spacing_px = settings.spacing_px > 0 ? settings.spacing_px : kDefaultSpacing_px;
  std::vector<Curve> spurious;
  for (int i = 0; i < settings.spurious; ++i) spurious.push_back(spuriousCurve(cropped, spacing_px, random));
  curves.insert(curves.end(), spurious.begin(), spurious.end());
  return {cropped, asCenterline(curves, cropped, settings, trial, view), std::move(spurious)};
}

TrialImages::TrialImages(const std::vector<VesselTree>& trees, const SimulationSettings& settings)
    : settings_(settings) {
  checkSettings("simulation", settings);
  const auto refuse = [](const char* key, double value) {
    if (value > 0) throw InputError("simulation", key, std::to_string(value), "must be 0: images have noise by dose");
  };
  refuse("noise_px", settings.noise_px);
  refuse("tangent_noise_deg", settings.tangent_noise_deg);
  for (const auto& tree : trees) {
    Surroundings around;
    around.R_lps_model = lpsOf(settings.model_axes);
    renderers_.push_back(std::make_unique<FluoroscopyRenderer>(tree, settings.fluoroscopy, around));
  }
}

XrayScene TrialImages::sceneOf(const SimulatedTrial& trial, std::size_t view) const {
  const SimulatedTrial::TrueView& seen = trial.true_views[view];
  XrayScene scene;
  scene.T_camera_model = seen.T_view_first * trial.truth;
  if (trial.displacements_m.size() > 0) scene.displacements_m = trial.displacements_m;
  scene.densities = trial.filled;
  for (const Curve& curve : seen.spurious_px) {
    if (curve.size() < 2) continue;
    scene.devices.push_back(wireAlong(curve, seen.camera, scene.T_camera_model, 1e-3 * settings_.source_isocenter_mm));
  }
  return scene;
}

cv::Mat TrialImages::render(const SimulatedTrial& trial, std::size_t tree, std::size_t view, int index) {
  return renderers_[tree]->render(trial.true_views[view].camera, sceneOf(trial, view),
                                  static_cast<std::uint64_t>(2 * index) + view);
}

TrialTruth TrialImages::truth(const SimulatedTrial& trial, std::size_t tree, std::size_t view) {
  const XrayScene scene = sceneOf(trial, view);
  const XrayCamera& camera = trial.true_views[view].camera;
  TruthSettings everything;
  everything.min_contrast_to_noise = 0;
  everything.min_px = 0;
  FluoroscopyRenderer& renderer = *renderers_[tree];
  return {renderer.truth(camera, scene).centerline, renderer.truth(camera, scene, everything).centerline};
}

}  // namespace angio::evaluation
