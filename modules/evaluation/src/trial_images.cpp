// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/trial_images.hpp"

#include "angio/base/errors.hpp"

namespace angio::evaluation {
namespace {

// A guidewire: 0.014 inch of steel, whose attenuation at 60 keV is 0.95 per mm (NIST XCOM).
constexpr double kWireDiameter_m = 0.36e-3, kSteel_per_m = 950;

// A curve of the image as a wire in the plane of the isocentre.
Device wireAlong(const Curve& curve, const XrayCamera& camera, const Pose& T_camera_model, double depth_m) {
  Device wire;
  wire.diameter_m = kWireDiameter_m;
  wire.attenuation_per_m = kSteel_per_m;
  wire.points.resize(3, static_cast<Eigen::Index>(curve.size()));
  const Pose T_model_camera = T_camera_model.inverse();
  for (std::size_t i = 0; i < curve.size(); ++i) {
    wire.points.col(static_cast<Eigen::Index>(i)) = T_model_camera * (depth_m * camera.ray(curve[i]));
  }
  return wire;
}

}  // namespace

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

TrialImages::~TrialImages() = default;

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
