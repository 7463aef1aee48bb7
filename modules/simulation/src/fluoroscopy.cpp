// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/fluoroscopy.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "angio/base/errors.hpp"
#include "background.hpp"
#include "noise.hpp"
#include "tubes.hpp"

namespace angio {
namespace {

// One row of the background's grid, blended from the two grid rows around image row y and spread to pixels.
void spread(const std::vector<float>& grid, int columns, int y, float scale, int width, float* __restrict out) {
  constexpr int kCell = Background::kCell;
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

// Grey values of a row: mean and noise of the photons, by gain, rounded and cut to 16 bits.
void expose(const float* __restrict photons, const float* __restrict deviates, float electronic_variance, float gain,
            int width, std::uint16_t* __restrict out) {
  for (int x = 0; x < width; ++x) {
    const float grey = gain * (photons[x] + std::sqrt(photons[x] + electronic_variance) * deviates[x]) + 0.5F;
    const float cut = grey < 0.0F ? 0.0F : grey > 65535.0F ? 65535.0F : grey;
    out[x] = static_cast<std::uint16_t>(static_cast<std::int32_t>(cut));
  }
}

void requireFinitePose(const Pose& T) {
  if (!T.matrix().allFinite()) throw InputError("fluoroscopy", "T_camera_model", "", "must have finite numbers");
}

FluoroscopySettings checked(const FluoroscopySettings& settings) {
  checkSettings("fluoroscopy", settings);
  return settings;
}

}  // namespace

struct FluoroscopyRenderer::Parts {
  Parts(const VesselTree& tree, const FluoroscopySettings& s)
      : settings(checked(s)),
        tubes(tubesOf(withPlausibleRadii(tree, s.end_radius_mm * 1e-3))),
        background(tree.centroid(), s.background_strength, s.background_structure_mm * 1e-3,
                   static_cast<std::uint64_t>(s.seed)) {}

  FluoroscopySettings settings;
  std::vector<Tube> tubes;
  Background background;
  NormalDeviates normal;
  PathLengths path_lengths;
  std::vector<float> photons, deviates;
};

FluoroscopyRenderer::FluoroscopyRenderer(const VesselTree& tree_with_radii, const FluoroscopySettings& settings)
    : parts_(std::make_unique<Parts>(tree_with_radii, settings)) {}
FluoroscopyRenderer::~FluoroscopyRenderer() = default;
FluoroscopyRenderer::FluoroscopyRenderer(FluoroscopyRenderer&&) noexcept = default;
FluoroscopyRenderer& FluoroscopyRenderer::operator=(FluoroscopyRenderer&&) noexcept = default;

cv::Mat FluoroscopyRenderer::pathLength(const XrayCamera& camera, const Pose& T_camera_model) const {
  requireFinitePose(T_camera_model);
  return PathLengths().compute(parts_->tubes, camera, T_camera_model);
}

cv::Mat FluoroscopyRenderer::render(const XrayCamera& camera, const Pose& T_camera_model, std::uint64_t frame) {
  requireFinitePose(T_camera_model);
  const FluoroscopySettings& s = parts_->settings;
  const int width = camera.width_px();
  const cv::Mat& path_m = parts_->path_lengths.compute(parts_->tubes, camera, T_camera_model);
  const std::vector<float>& passed = parts_->background.transmission(camera, T_camera_model);
  std::vector<float>&photons = parts_->photons, &deviates = parts_->deviates;
  photons.resize(width);
  deviates.resize(width);

  const float attenuation_per_m = static_cast<float>(s.contrast_attenuation_per_mm * 1e3);
  const float electronic_variance = static_cast<float>(s.electronic_noise_photons * s.electronic_noise_photons);
  const float gain = static_cast<float>(s.background_level / s.photons_per_pixel);
  const std::uint64_t stream = mixed(mixed(static_cast<std::uint64_t>(s.seed) + 1) + frame);
  cv::Mat image(camera.height_px(), width, CV_16UC1);
  for (int y = 0; y < image.rows; ++y) {
    spread(passed, Background::nodesAcross(width), y, static_cast<float>(s.photons_per_pixel), width, photons.data());
    const float* path = path_m.ptr<float>(y);
    for (int x = 0; x < width; ++x) {
      if (path[x] > 0.0F) photons[x] *= std::exp(-attenuation_per_m * path[x]);
    }
    parts_->normal.fill(stream + static_cast<std::uint64_t>(y), width, deviates.data());
    expose(photons.data(), deviates.data(), electronic_variance, gain, width, image.ptr<std::uint16_t>(y));
  }
  return image;
}

}  // namespace angio
