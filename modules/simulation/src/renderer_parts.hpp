// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "anatomy.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/tubes/tubes.hpp"
#include "beam.hpp"
#include "detector.hpp"
#include "scatter.hpp"

namespace angio::simulation {

/// All that a renderer keeps.
struct FluoroscopyRenderer::Parts {
  Parts(const VesselTree& tree_with_radii, const FluoroscopySettings& s, const Surroundings& surroundings);

  /// Throws InputError for a scene that cannot be.
  void check(const XrayScene& scene) const;

  /// Log-attenuation of all devices, CV_32FC1.
  const cv::Mat& devicesOf(const XrayScene& scene, const XrayCamera& camera);

  /// Quanta expected in a pixel behind average anatomy, scattered ones included.
  double photons(const XrayCamera& camera) const;

  /// Fills `quanta`: what is expected at the detector.
  void shine(const XrayCamera& camera, const XrayScene& scene);

  const cv::Mat& shutters(const XrayCamera& camera);

  FluoroscopySettings settings;
  VesselTree tree;
  TubeTree vessels;
  ContrastCurve contrast;
  Anatomy anatomy;
  Detector detector;
  PathLengths path_lengths, device_lengths;
  cv::Mat quanta, opacity;

 private:
  cv::Mat shutters_;
};

/// The tubes of a device; their density is its attenuation [1/m].
std::vector<Tube> tubesOf(const Device& device);

/// Distance between pixels at the detector [m]; when the camera does not know, as if the detector were 1.1 m away.
double pixelSpacing(const XrayCamera& camera);

}  // namespace angio::simulation
