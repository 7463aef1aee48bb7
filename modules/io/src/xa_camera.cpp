// SPDX-License-Identifier: GPL-2.0-or-later
#include "xa_camera.hpp"

#include <cmath>
#include <utility>

#include "xa_tags.hpp"

namespace angio::io {
namespace {

// Metres; from a tenth of a C-arm to ten of them.
std::optional<double> distance(const DicomFile& file, const DicomTag& tag, int frame) {
  const auto distance_mm = file.number(tag, frame);
  if (!distance_mm || *distance_mm == 0) return std::nullopt;  // Zero is how machines say that they do not know.
  return 1e-3 * requireBetween(file.path(), tag.label(), *distance_mm, 100, 10000);
}

std::optional<double> magnificationOf(const DicomFile& file, int frame) {
  const auto factor = file.number(tag::kMagnification, frame);
  if (!factor || *factor == 0) return std::nullopt;
  return requireBetween(file.path(), tag::kMagnification.label(), *factor, 1, 10);
}

struct Distances {
  double detector_m = 0;
  std::optional<double> isocenter_m;
};

Distances readDistances(const DicomFile& file, int frame, Lines& assumed) {
  auto detector_m = distance(file, tag::kSourceDetector, frame);
  auto isocenter_m = distance(file, tag::kSourcePatient, frame);
  if (!isocenter_m) {
    isocenter_m = distance(file, tag::kSourceIsocenter, frame);
    if (isocenter_m) assumed.push_back(missing(tag::kSourcePatient, tag::kSourceIsocenter.label() + " stands for it"));
  }
  const auto factor = magnificationOf(file, frame);
  if (!detector_m) {
    if (!factor || !isocenter_m) {
      throw file.refusal(tag::kSourceDetector, "",
                         "is missing, and with it the camera: " + tag::kMagnification.label() + " and " +
                             tag::kSourcePatient.label() + " do not replace it");
    }
    detector_m = *isocenter_m * *factor;
    assumed.push_back(
        missing(tag::kSourceDetector,
                formatValue(*detector_m * 1e3) + " mm by the magnification factor and " + tag::kSourcePatient.label()));
  } else if (!isocenter_m && factor) {
    isocenter_m = *detector_m / *factor;
    assumed.push_back(
        missing(tag::kSourcePatient, formatValue(*isocenter_m * 1e3) + " mm by " + tag::kMagnification.label()));
  } else if (!isocenter_m) {
    assumed.push_back(missing(tag::kSourcePatient, "no pose by the angles, no magnification"));
  } else if (factor && std::abs(*factor * *isocenter_m / *detector_m - 1) > 0.01) {
    assumed.push_back(tag::kMagnification.label() + " = " + formatValue(*factor) + " is not used: the distances say " +
                      formatValue(*detector_m / *isocenter_m));
  }
  if (isocenter_m && *isocenter_m > *detector_m) {
    throw file.refusal(tag::kSourcePatient, formatValue(*isocenter_m * 1e3),
                       "must not exceed " + tag::kSourceDetector.label() + " = " + formatValue(*detector_m * 1e3));
  }
  return {*detector_m, isocenter_m};
}

// At the detector, between rows and between columns.
struct Spacing {
  Eigen::Vector2d mm;
  DicomTag from;
};

// Two positive numbers, the first again for the second when there is one only; nothing when missing or zero.
std::optional<Eigen::Vector2d> pairOf(const DicomFile& file, const DicomTag& tag, int frame, double largest) {
  const auto values = file.numbers(tag, frame);
  if (values.empty() || values.front() == 0) return std::nullopt;
  const Eigen::Vector2d pair(values[0], values.size() > 1 ? values[1] : values[0]);
  for (const double value : pair) requireBetween(file.path(), tag.label(), value, 1e-3, largest);
  return pair;
}

Spacing readSpacing(const DicomFile& file, const DicomPixelLayout& layout, const Distances& distances, int frame,
                    Lines& assumed) {
  constexpr double kWidestPixel_mm = 10, kWidestField_mm = 2000;
  const auto assume = [&](const Eigen::Vector2d& mm, const std::string& how) {
    assumed.push_back(missing(tag::kImagerSpacing, formatValue(mm[0]) + " x " + formatValue(mm[1]) + " mm by " + how));
  };
  if (const auto mm = pairOf(file, tag::kImagerSpacing, frame, kWidestPixel_mm)) return {*mm, tag::kImagerSpacing};
  const auto in_patient = pairOf(file, tag::kPixelSpacing, frame, kWidestPixel_mm);
  if (in_patient && distances.isocenter_m) {
    const Eigen::Vector2d mm = *in_patient * distances.detector_m / *distances.isocenter_m;
    assume(mm, tag::kPixelSpacing.label() + ", calibrated by " +
                   file.text(tag::kCalibrationType, frame).value_or("an unknown way") + ", taken at the isocentre");
    return {mm, tag::kPixelSpacing};
  }
  const Eigen::Vector2d size_px(layout.height_px, layout.width_px);
  if (const auto field_mm = pairOf(file, tag::kFieldDimensions, frame, kWidestField_mm)) {
    const Eigen::Vector2d mm = field_mm->cwiseQuotient(size_px);
    assume(mm, tag::kFieldDimensions.label() + " on the whole image");
    return {mm, tag::kFieldDimensions};
  }
  if (const auto size_mm = pairOf(file, tag::kIntensifierSize, frame, kWidestField_mm)) {
    const Eigen::Vector2d mm = Eigen::Vector2d::Constant((*size_mm)[0] / size_px.maxCoeff());
    assume(mm, tag::kIntensifierSize.label() + " on the whole image");
    return {mm, tag::kIntensifierSize};
  }
  throw file.refusal(tag::kImagerSpacing, "",
                     "is missing, and with it the camera: no " + tag::kFieldDimensions.label() + ", " +
                         tag::kIntensifierSize.label() + ", or " + tag::kPixelSpacing.label() + " with " +
                         tag::kSourcePatient.label() + " replaces it");
}

}  // namespace

XaGeometry readXaCamera(const DicomFile& file, const DicomPixelLayout& layout, int frame) {
  Lines assumed;
  const Distances distances = readDistances(file, frame, assumed);
  const Spacing spacing = readSpacing(file, layout, distances, frame, assumed);
  XrayCamera::Parameters p;
  p.width_px = layout.width_px;
  p.height_px = layout.height_px;
  const double rows_m = spacing.mm[0] * 1e-3, columns_m = spacing.mm[1] * 1e-3;
  p.fx_px = distances.detector_m / columns_m;
  p.fy_px = distances.detector_m / rows_m;
  p.cx_px = 0.5 * (layout.width_px - 1);
  p.cy_px = 0.5 * (layout.height_px - 1);
  if (columns_m == rows_m) p.pixel_spacing_m = rows_m;
  p.source_detector_distance_m = distances.detector_m;
  XaGeometry geometry{XrayCamera(p)};
  geometry.source_detector_distance_m = distances.detector_m;
  geometry.source_isocenter_distance_m = distances.isocenter_m;
  geometry.spacing_from = spacing.from.label();
  geometry.assumed = std::move(assumed);
  return geometry;
}

std::string missing(const DicomTag& tag, const std::string& instead) { return tag.label() + " is missing: " + instead; }

// Clockwise, of what is stored against the detector [rad].
double fieldRotation(const DicomFile& file, int frame) {
  const double rotation_deg = file.number(tag::kFieldRotation, frame).value_or(0);
  if (rotation_deg != 0 && rotation_deg != 90 && rotation_deg != 180 && rotation_deg != 270) {
    throw file.refusal(tag::kFieldRotation, formatValue(rotation_deg), "must be 0, 90, 180 or 270");
  }
  return degToRad(rotation_deg);
}

void placePrincipalPoint(const DicomFile& file, int frame, XaGeometry& g) {
  const auto field_origin = file.numbers(tag::kFieldOrigin, frame);
  if (field_origin.empty()) {
    g.assumed.push_back("the principal point is taken at the image's centre: no attribute says it");
    return;
  }
  const auto element_mm = pairOf(file, tag::kElementSpacing, frame, 10);
  const auto active_mm = pairOf(file, tag::kActiveDimensions, frame, 2000);
  if (field_origin.size() != 2 || !element_mm || !active_mm) {
    g.assumed.push_back("the principal point is taken at the image's centre: " + tag::kFieldOrigin.label() +
                        " does not say it without " + tag::kElementSpacing.label() + " and " +
                        tag::kActiveDimensions.label());
    return;
  }
  auto active_origin = file.numbers(tag::kActiveOrigin, frame);
  if (active_origin.size() != 2) active_origin = {0, 0};

  // Rows first, as in the file; the field as it lies on the detector, before it is turned.
  XrayCamera::Parameters p = g.camera.parameters();
  const Eigen::Vector2d pixel_mm = 1e3 * g.source_detector_distance_m * Eigen::Vector2d(1 / p.fy_px, 1 / p.fx_px);
  const double rotation_rad = fieldRotation(file, frame);
  Eigen::Vector2d field_mm = pixel_mm.cwiseProduct(Eigen::Vector2d(p.height_px, p.width_px));
  if (std::abs(std::sin(rotation_rad)) > 0.5) std::swap(field_mm[0], field_mm[1]);
  Eigen::Vector2d off_mm = 0.5 * (*active_mm - field_mm);
  for (const int k : {0, 1}) off_mm[k] += (active_origin[k] - field_origin[k]) * (*element_mm)[k];
  const double c = std::cos(rotation_rad), s = std::sin(rotation_rad);
  Eigen::Vector2d right_down_px(c * off_mm[1] - s * off_mm[0], s * off_mm[1] + c * off_mm[0]);
  right_down_px = right_down_px.cwiseQuotient(Eigen::Vector2d(pixel_mm[1], pixel_mm[0]));
  for (const int k : {0, 1}) {
    const double size_px = k == 0 ? p.width_px : p.height_px;
    if (std::abs(right_down_px[k]) > 4 * size_px) {
      throw file.refusal(tag::kFieldOrigin, formatValue(field_origin[1 - k]),
                         "must lie on the detector: the beam's axis would be " + formatValue(right_down_px[k]) +
                             " px from the image's middle");
    }
  }
  // A flip, whether the file's or ours, is one of left for right; both together are none. As seen from the detector
  // nothing is flipped, and then the camera's picture is.
  p.cx_px -= right_down_px.x();
  p.cy_px += right_down_px.y();
  g.camera = XrayCamera(p);
  g.assumed.push_back("the principal point is the middle of the detector's active area, by " +
                      tag::kFieldOrigin.label());
}

}  // namespace angio::io
