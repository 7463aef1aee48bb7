// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>

#include "angio/base/settings.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio {

/// How the simulated X-ray looks. The defaults are those of an arteriogram with iodine: a vessel of 4 mm takes a
/// quarter of the beam, one of 1 mm a fifteenth, and a pixel's noise is a little above one per cent.
struct FluoroscopySettings {
  double contrast_attenuation_per_mm = 0.07;  ///< Linear attenuation of the contrast agent above that of blood [1/mm].
  double photons_per_pixel = 7000;            ///< Photons expected in a pixel behind average anatomy.
  double electronic_noise_photons = 12;       ///< Standard deviation of the detector's own noise [photons].
  double background_strength = 0.08;          ///< Standard deviation of the anatomy's log-attenuation over the image.
  double background_structure_mm = 45;        ///< Size of the largest structures of the anatomy, in the patient [mm].
  double background_level = 45000;            ///< Grey value behind average anatomy, of 65535.
  double end_radius_mm = 0.65;                ///< Radius of vessel ends where the tree knows none [mm].
  int seed = 1;                               ///< Of the anatomy and of the noise.

  void visit(SettingsVisitor& v) {
    v.number("contrast_attenuation_per_mm", contrast_attenuation_per_mm, 0, 10);
    v.number("photons_per_pixel", photons_per_pixel, 1, 1e9);
    v.number("electronic_noise_photons", electronic_noise_photons, 0, 1e6);
    v.number("background_strength", background_strength, 0, 2);
    v.number("background_structure_mm", background_structure_mm, 20, 1000);
    v.number("background_level", background_level, 1, 65535);
    v.number("end_radius_mm", end_radius_mm, 0.01, 10);
    v.integer("seed", seed, 0, 2147483647);
  }
};

/// The tree with every radius known: those it has are kept, the others follow Murray's law.
///
/// Ends have `end_radius_m` [m]; where branches part, the cube of the parent's radius is the sum of the cubes of its
/// children's, up to 4 mm. A branch is constant but for its first millimetres, where it leaves its parent's radius
/// smoothly. A branch that knows some of its radii is interpolated between them. Throws InputError unless end_radius_m
/// is positive. Source: Murray, The physiological principle of minimum work, PNAS 12 (1926).
VesselTree withPlausibleRadii(const VesselTree& tree, double end_radius_m);

/// Makes X-ray images of a vessel tree full of contrast agent, in front of a patient's anatomy, with quantum noise.
///
/// One object per stream of images: it keeps its buffers. It uses one thread. Throws InputError for a pose that is not
/// finite.
class FluoroscopyRenderer {
 public:
  /// Radii that `tree_with_radii` does not know are filled in by withPlausibleRadii. Throws InputError when a setting
  /// is out of its range.
  FluoroscopyRenderer(const VesselTree& tree_with_radii, const FluoroscopySettings& settings);
  ~FluoroscopyRenderer();
  FluoroscopyRenderer(FluoroscopyRenderer&&) noexcept;
  FluoroscopyRenderer& operator=(FluoroscopyRenderer&&) noexcept;

  /// Metres of contrast agent on the ray through each pixel's centre, CV_32FC1 of the detector's size.
  ///
  /// Exact for the union of the tree's edges as tubes with round ends: what overlaps at bends and bifurcations counts
  /// once, vessels that cross at different depths add up. An edge whose radius changes is a row of tubes 0.04 mm apart
  /// in radius. A tube that reaches the source, or lies behind it, casts no shadow.
  cv::Mat pathLength(const XrayCamera& camera, const Pose& T_camera_model) const;

  /// The X-ray image, CV_16UC1 of the detector's size, vessels dark.
  ///
  /// Photons per pixel: mean N = N0 exp(-contrast * path - anatomy), variance N + electronic noise squared, normal. The
  /// anatomy moves with the model. The same seed, frame, camera and pose give the same image; noise differs between
  /// frames.
  cv::Mat render(const XrayCamera& camera, const Pose& T_camera_model, std::uint64_t frame);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace angio
