// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/simulation/attenuation_volume.hpp"
#include "angio/simulation/device.hpp"
#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/frame_truth.hpp"
#include "angio/vessel/plausible_radii.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::simulation {

/// What is in front of the detector when a frame is taken.
struct XrayScene {
  Pose T_camera_model = Pose::Identity();  ///< [m]
  std::optional<Eigen::Matrix3Xd>
      displacements_m;                       ///< Of the tree's points, model axes, 3 x N [m]; absent: none moved.
  std::optional<Eigen::VectorXd> densities;  ///< Of contrast agent at the tree's points, N, 0..1; absent: 1 everywhere.
  std::vector<Device> devices;               ///< Where they are now.

  /// Where the points of its tree stand, 3 x N [m].
  Eigen::Matrix3Xd pointsOf(const VesselTree& tree) const {
    return displacements_m ? Eigen::Matrix3Xd(tree.points() + *displacements_m) : tree.points();
  }
};

/// What stands around the tree.
struct Surroundings {
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();  ///< The patient's axes L, P, S from the model's.
  std::optional<AttenuationVolume> volume;                    ///< The body; absent: the one that the settings describe.
};

/// Makes X-ray images of a vessel tree with contrast agent, devices and a patient's anatomy.
///
/// One object per stream of images: it keeps its buffers. Throws InputError for a pose that is not finite, for a scene
/// that does not fit the tree, and for a device that cannot be.
class FluoroscopyRenderer {
 public:
  /// Radii that `tree_with_radii` does not know are filled in by withPlausibleRadii. Throws InputError when a setting
  /// is out of its range or the volume cannot be.
  FluoroscopyRenderer(const VesselTree& tree_with_radii, const FluoroscopySettings& settings,
                      const Surroundings& surroundings = {});
  ~FluoroscopyRenderer();
  FluoroscopyRenderer(FluoroscopyRenderer&&) noexcept;
  FluoroscopyRenderer& operator=(FluoroscopyRenderer&&) noexcept;

  /// Metres of contrast agent on the ray through each pixel's centre, CV_32FC1 of the detector's size.
  ///
  /// Exact for the union of the tree's edges as tubes with round ends: what overlaps at bends and bifurcations counts
  /// once, vessels that cross at different depths add up. An edge whose radius changes is a row of tubes 0.04 mm apart
  /// in radius. A tube that reaches the source, or lies behind it, casts no shadow.
  cv::Mat pathLength(const XrayCamera& camera, const Pose& T_camera_model) const;

  /// The X-ray image, CV_16UC1 or CV_8UC1 of the detector's size, vessels dark.
  ///
  /// Quanta in a pixel: those that pass vessels, devices, anatomy and shutters, and those scattered; blurred by the
  /// focal spot, bent by an intensifier, counted with normal noise of their own variance, blurred with it by the
  /// detector; then the electronics' noise and gain. The anatomy moves with the model. The same seed, frame, camera and
  /// scene give the same image, with any number of threads, unless the detector has an afterglow of the frames before;
  /// noise differs between frames.
  cv::Mat render(const XrayCamera& camera, const XrayScene& scene, std::uint64_t frame);

  /// The same of a tree at rest that is full of contrast agent.
  cv::Mat render(const XrayCamera& camera, const Pose& T_camera_model, std::uint64_t frame);

  /// What is to be seen in that image.
  FrameTruth truth(const XrayCamera& camera, const XrayScene& scene, const TruthSettings& settings = {});

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Quanta that a detector of caesium iodide counts in a pixel at an air kerma: 30.2 per mm^2 and nGy (beam RQA5 of IEC
/// 62220-1), of which 70 % count (detective quantum efficiency).
/// @param air_kerma_ngy  At the detector's entrance [nGy]. @param pixel_spacing_m  At the detector [m].
double photonsPerPixel(double air_kerma_ngy, double pixel_spacing_m);

}  // namespace angio::simulation
