// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/fluoroscopy.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/simulation/collimator.hpp"
#include "renderer_parts.hpp"

namespace angio::simulation {
namespace {

constexpr double kUsualDetectorDistance = 1.1;  // [m]
constexpr double kSigmaOfWidth = 0.4247;        // Standard deviation of a normal curve of full width 1 at half height.

void requireFinitePose(const Pose& T) {
  if (!T.matrix().allFinite()) throw InputError("pose", "T_camera_model", "", "must be finite");
}

// The renderer's first argument; settings are checked before they are used.
VesselTree withRadii(const VesselTree& tree, const FluoroscopySettings& settings) {
  checkSettings("fluoroscopy settings", settings);
  const auto unknown = [](const std::optional<double>& radius) { return !radius; };
  if (std::none_of(tree.radii().begin(), tree.radii().end(), unknown)) return tree;
  return withPlausibleRadii(tree, settings.end_radius_mm * 1e-3);
}

// One row of the anatomy's grid, blended from the two grid rows around image row y and spread to pixels.
void spread(const std::vector<float>& grid, int columns, int y, float scale, int width, float* __restrict out) {
  constexpr int kCell = Anatomy::kCell;
  const float* above = grid.data() + static_cast<std::size_t>(y / kCell) * columns;
  const float* below = above + columns;
  const float down = static_cast<float>(y % kCell) / kCell;
  const auto node = [&](int i) { return scale * (above[i] + down * (below[i] - above[i])); };
  for (int i = 0; i * kCell < width; ++i) {
    const float left = node(i), step = (node(i + 1) - left) / kCell;
    const int count = std::min(kCell, width - i * kCell);
    for (int k = 0; k < count; ++k) out[i * kCell + k] = left + static_cast<float>(k) * step;
  }
}

double airKerma_ngy(Dose dose) { return dose == Dose::kFluoroscopy ? 30 : dose == Dose::kCine ? 170 : 3000; }

}  // namespace

double pixelSpacing(const XrayCamera& camera) {
  const auto& K = camera.parameters();
  return K.pixel_spacing_m.value_or(K.source_detector_distance_m.value_or(kUsualDetectorDistance) / K.fx_px);
}

std::vector<Tube> tubesOf(const Device& device) {
  std::vector<Tube> tubes;
  double to_tip = 0;
  for (Eigen::Index k = device.points.cols() - 1; k > 0; --k) {
    const Eigen::Vector3d tip = device.points.col(k), back = device.points.col(k - 1);
    const double length = (tip - back).norm(), radius = 0.5 * device.diameter_m;
    const double marked = std::clamp((device.marker_length_m - to_tip) / std::max(length, 1e-12), 0.0, 1.0);
    const Eigen::Vector3d border = tip + marked * (back - tip);
    if (marked > 0) tubes.push_back({border, tip, radius, radius, device.marker_attenuation_per_m});
    if (marked < 1) tubes.push_back({back, border, radius, radius, device.attenuation_per_m});
    to_tip += length;
  }
  return tubes;
}

FluoroscopyRenderer::Parts::Parts(const VesselTree& tree_with_radii, const FluoroscopySettings& s,
                                  const Surroundings& surroundings)
    : settings(s),
      tree(withRadii(tree_with_radii, s)),
      vessels(tree),
      contrast(s.contrast_attenuation_per_mm * 1e3, s.beam_hardening),
      anatomy(tree.centroid(), surroundings.R_lps_model, s, surroundings.volume),
      detector(s) {}

void FluoroscopyRenderer::Parts::check(const XrayScene& scene) const {
  requireFinitePose(scene.T_camera_model);
  const std::string rule = "must be one for each of the tree's " + std::to_string(tree.size()) + " points, finite";
  if (scene.displacements_m && (scene.displacements_m->cols() != tree.size() || !scene.displacements_m->allFinite())) {
    throw InputError("X-ray scene", "displacements_m", std::to_string(scene.displacements_m->cols()), rule);
  }
  if (scene.densities && (scene.densities->size() != tree.size() || !scene.densities->allFinite())) {
    throw InputError("X-ray scene", "densities", std::to_string(scene.densities->size()), rule);
  }
  for (const Device& device : scene.devices) device.check();
}

const cv::Mat& FluoroscopyRenderer::Parts::devicesOf(const XrayScene& scene, const XrayCamera& camera) {
  opacity.create(camera.height_px(), camera.width_px(), CV_32FC1);
  opacity.setTo(0);
  for (const Device& device : scene.devices) {
    cv::add(opacity, device_lengths.compute(tubesOf(device), camera, scene.T_camera_model, settings.threads), opacity);
  }
  return opacity;
}

double FluoroscopyRenderer::Parts::photons(const XrayCamera& camera) const {
  if (settings.dose == Dose::kPhotons) return settings.photons_per_pixel;
  return photonsPerPixel(airKerma_ngy(settings.dose), pixelSpacing(camera));
}

const cv::Mat& FluoroscopyRenderer::Parts::shutters(const XrayCamera& camera) {
  if (shutters_.cols != camera.width_px() || shutters_.rows != camera.height_px()) {
    shutters_ = shutterTransmission(settings.collimator, camera.width_px(), camera.height_px());
  }
  return shutters_;
}

void FluoroscopyRenderer::Parts::shine(const XrayCamera& camera, const XrayScene& scene) {
  const int width = camera.width_px();
  const cv::Mat& path_m =
      path_lengths.compute(vessels.tubes(scene.pointsOf(tree), scene.densities.value_or(Eigen::VectorXd())), camera,
                           scene.T_camera_model, settings.threads);
  const cv::Mat* metal = scene.devices.empty() ? nullptr : &devicesOf(scene, camera);
  const std::vector<float>& passed = anatomy.transmission(camera, scene.T_camera_model, settings.threads);
  const cv::Mat* shutter = settings.collimator.shutter == Shutter::kOpen ? nullptr : &shutters(camera);
  const float primary = static_cast<float>(photons(camera) / (1 + settings.detector.scatter_to_primary));
  quanta.create(camera.height_px(), width, CV_32FC1);
  forBands(settings.threads, quanta.rows, [&](const RowBand& band) {
    for (int y = band.top; y < band.bottom; ++y) {
      float* row = quanta.ptr<float>(y);
      spread(passed, Anatomy::nodesAcross(width), y, primary, width, row);
      const float* path = path_m.ptr<float>(y);
      for (int x = 0; x < width; ++x) {
        if (path[x] > 0.0F) row[x] *= contrast.transmission(path[x]);
      }
      const float* attenuation = metal ? metal->ptr<float>(y) : nullptr;
      for (int x = 0; attenuation && x < width; ++x) {
        if (attenuation[x] > 0.0F) row[x] *= std::exp(-attenuation[x]);
      }
      const float* open = shutter ? shutter->ptr<float>(y) : nullptr;
      for (int x = 0; open && x < width; ++x) row[x] *= open[x];
    }
  });
  Scatter(settings.detector.scatter_to_primary, settings.detector.scatter_std_mm * 1e-3 / pixelSpacing(camera))
      .add(quanta, settings.threads);
}

FluoroscopyRenderer::FluoroscopyRenderer(const VesselTree& tree_with_radii, const FluoroscopySettings& settings,
                                         const Surroundings& surroundings)
    : parts_(std::make_unique<Parts>(tree_with_radii, settings, surroundings)) {}
FluoroscopyRenderer::~FluoroscopyRenderer() = default;
FluoroscopyRenderer::FluoroscopyRenderer(FluoroscopyRenderer&&) noexcept = default;
FluoroscopyRenderer& FluoroscopyRenderer::operator=(FluoroscopyRenderer&&) noexcept = default;

cv::Mat FluoroscopyRenderer::pathLength(const XrayCamera& camera, const Pose& T_camera_model) const {
  requireFinitePose(T_camera_model);
  return PathLengths().compute(TubeTree(parts_->vessels).tubes(parts_->tree.points(), {}), camera, T_camera_model);
}

cv::Mat FluoroscopyRenderer::render(const XrayCamera& camera, const XrayScene& scene, std::uint64_t frame) {
  Parts& p = *parts_;
  p.check(scene);
  p.shine(camera, scene);
  const double spacing_m = pixelSpacing(camera), photons = p.photons(camera);
  const double depth = (scene.T_camera_model * p.tree.centroid()).z();
  const double detector_m = spacing_m * camera.parameters().fx_px;
  // The spot's shadow at the detector, as large as the part of the beam behind the patient is to that before it.
  const double behind = depth > 0 ? std::clamp(detector_m / depth - 1, 0.0, 4.0) : 0.0;
  const Optics optics{p.settings.background_level / photons,
                      kSigmaOfWidth * p.settings.detector.focal_spot_mm * 1e-3 * behind / spacing_m,
                      p.settings.detector.psf_std_mm * 1e-3 / spacing_m};
  return p.detector.expose(p.quanta, optics, mixed(mixed(static_cast<std::uint64_t>(p.settings.seed) + 1) + frame));
}

cv::Mat FluoroscopyRenderer::render(const XrayCamera& camera, const Pose& T_camera_model, std::uint64_t frame) {
  XrayScene scene;
  scene.T_camera_model = T_camera_model;
  return render(camera, scene, frame);
}

}  // namespace angio::simulation
