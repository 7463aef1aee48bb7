// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "angio/geometry/distortion.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// How a camera changes when its detector moves towards the source or away from it.
struct CameraDistanceLaw {
  double offset_m = 0;  ///< True source-detector distance less the encoder's.
  Eigen::Vector2d principal_point_slope_px_per_m{0, 0};
};

/// All that a camera file may say.
struct CameraFile {
  XrayCamera camera;
  std::optional<DetectorDistortion> distortion;  ///< Absent: a pinhole camera.
  std::optional<CameraDistanceLaw> distance_law;

  /// The same camera at another source-detector distance by the encoder: f = f0 (d + offset) / (d0 + offset), the
  /// principal point moved along its slope. Throws InputError when the file has no distance law or no distance.
  CameraFile at(double source_detector_distance_m) const;
};

/// Reads an X-ray camera. The extension (in any case) is the choice of the format:
///
/// - `.yaml`, `.yml`: `image_size_px: [w, h]`, `fx_px`, `fy_px`, `cx_px`, `cy_px`; optional
///   `pixel_spacing_mm`, `source_detector_distance_mm`,
///   `distortion: {model: radial, k1, k2, skew_px}` or `{model: intensifier, k1, k2, s1_deg, s2_deg, centre_px: [x,
///   y]}` (see DetectorDistortion; what is missing is zero, the centre the detector's middle; `none`, 0 and lists of
///   zeros are none) or `{model: polynomial, order, centre_px, unit_px, shift_x_px: [...], shift_y_px: [...]}` (see
///   DisplacementPolynomial), `source_detector_distance: {offset_mm, principal_point_slope_px_per_mm: [x, y]}`,
///   `calibration` (its record, which is the calibration module's to read).
/// - `.xml`: ViSP's camera parameters, with one camera and a model without distortion.
/// - `.txt`, `.csv`: MayaCam 2.0 and 1.0, as XMALab and Autoscoper have them, of which K is taken (see readMayaCam()).
///
/// Throws InputError that names file, line, key, value and rule; an unknown key is refused.
CameraFile readCameraFile(const std::string& path);

/// The pinhole camera of such a file. Throws InputError as well for one with distortion.
XrayCamera readCamera(const std::string& path);

/// The keys of the YAML form, for asYaml().
nlohmann::ordered_json cameraAsJson(const CameraFile& camera);

/// Writes the YAML form. Throws InputError when the file cannot be written.
void writeCamera(const std::string& path, const XrayCamera& camera);

}  // namespace angio::io
