// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <type_traits>

#include "angio/conventions/diffdrr.hpp"
#include "angio/conventions/itk_transform.hpp"
#include "angio/conventions/rtk.hpp"
#include "angio/conventions/xreg.hpp"
#include "fields.hpp"

namespace angio::conventions {

/// A projection in another program's words: the keys of its file, and what has to be done to our picture for it.
struct Described {
  nlohmann::ordered_json json;
  PictureFlip flip = PictureFlip::kNone;
};

/// Each convention's file: its keys to ours, and ours to its keys. Throw InputError that names the field.
ConvertedProjection readOwnView(YamlMap& map);
Described describeOwnView(const XrayProjection& ours);
ConvertedProjection readDiffDrr(YamlMap& map);
Described describeDiffDrr(const XrayProjection& ours, DiffDrrOrientation orientation, const WorldFrame& world);
ConvertedProjection readXreg(YamlMap& map);
Described describeXreg(const XrayProjection& ours, XregFrame frame, const WorldFrame& world);
ConvertedProjection readRtk(YamlMap& map);
Described describeRtk(const XrayProjection& ours, const WorldFrame& world);
ConvertedProjection readRtkMatrix(YamlMap& map);
Described describeRtkMatrix(const XrayProjection& ours, const WorldFrame& world);
ConvertedProjection readVispPose(YamlMap& map);
Described describeVispPose(const XrayProjection& ours);
ConvertedProjection readItkView(YamlMap& map);
Described describeItkView(const XrayProjection& ours, ItkTransformType type, const WorldFrame& world);

/// A length of ours that may be unknown [m], under a key in millimetres.
template <typename Fields, typename Length>
void visitKnownLength(Fields& fields, const char* key, Length& length_m) {
  fields.whenGiven(key, length_m.has_value(), [&](auto& f) {
    double length_mm = 1e3 * length_m.value_or(0);
    f.positive(key, length_mm);
    if constexpr (!std::is_const_v<Length>) length_m = 1e-3 * length_mm;
  });
}

/// The width and height of a picture, and what is known of the detector.
template <typename Fields, typename Parameters>
void visitDetectorOf(Fields& fields, Parameters& p) {
  Eigen::Vector2d size_px(p.width_px, p.height_px);
  fields.numbers("image_size_px", size_px);
  if constexpr (!std::is_const_v<Parameters>) {
    p.width_px = static_cast<int>(size_px.x());
    p.height_px = static_cast<int>(size_px.y());
    if (size_px != Eigen::Vector2d(p.width_px, p.height_px)) {
      throw InputError("camera", "image_size_px", "", "must be whole numbers");
    }
  }
  visitKnownLength(fields, "pixel_spacing_mm", p.pixel_spacing_m);
  visitKnownLength(fields, "source_detector_distance_mm", p.source_detector_distance_m);
}

/// The keys of our own camera file.
template <typename Fields, typename Parameters>
void visitCamera(Fields& fields, Parameters& p) {
  visitDetectorOf(fields, p);
  fields.positive("fx_px", p.fx_px);
  fields.positive("fy_px", p.fy_px);
  fields.number("cx_px", p.cx_px);
  fields.number("cy_px", p.cy_px);
}

}  // namespace angio::conventions
