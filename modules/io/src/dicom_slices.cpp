// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/dicom_slices.hpp"

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"
#include "dicom_file.hpp"
#include "dicom_pixels.hpp"

namespace angio::io {
namespace {

// Slices are some hundred kilobytes.
constexpr std::size_t kMaxSlice = std::size_t{64} << 20;

constexpr DicomTag kSeries{0x0020, 0x000e, "Series Instance UID"};
constexpr DicomTag kPosition{0x0020, 0x0032, "Image Position (Patient)"};
constexpr DicomTag kOrientation{0x0020, 0x0037, "Image Orientation (Patient)"};
constexpr DicomTag kSpacing{0x0028, 0x0030, "Pixel Spacing"};
constexpr DicomTag kIntercept{0x0028, 0x1052, "Rescale Intercept"};
constexpr DicomTag kSlope{0x0028, 0x1053, "Rescale Slope"};

std::vector<double> needNumbers(const DicomFile& file, const DicomTag& tag, std::size_t count) {
  const std::vector<double> numbers = file.numbers(tag);
  if (numbers.size() != count) {
    throw file.refusal(tag, std::to_string(numbers.size()), "must be " + std::to_string(count) + " numbers");
  }
  for (const double number : numbers) requireBetween(file.path(), tag.label(), number, -1e4, 1e4);
  return numbers;
}

double finiteOr(const DicomFile& file, const DicomTag& tag, double otherwise) {
  return requireBetween(file.path(), tag.label(), file.number(tag).value_or(otherwise), -1e9, 1e9);
}

}  // namespace

DicomSlice readDicomSlice(const std::string& path) {
  const DicomFile file(path, readWholeFile(path, kMaxSlice));
  DicomSlice slice;
  slice.path = path;
  slice.series_uid = file.text(kSeries).value_or("");
  const auto position = needNumbers(file, kPosition, 3), axes = needNumbers(file, kOrientation, 6);
  slice.first_pixel_mm = Eigen::Vector3d(position[0], position[1], position[2]);
  slice.right = Eigen::Vector3d(axes[0], axes[1], axes[2]);
  slice.down = Eigen::Vector3d(axes[3], axes[4], axes[5]);
  if (std::abs(slice.right.norm() - 1) > 1e-3 || std::abs(slice.down.norm() - 1) > 1e-3 ||
      std::abs(slice.right.dot(slice.down)) > 1e-3) {
    throw file.refusal(kOrientation, "", "must be two directions of length one at right angles");
  }
  const auto spacing = needNumbers(file, kSpacing, 2);  // The standard names the one between rows first.
  for (const double value : spacing) requireBetween(path, kSpacing.label(), value, 1e-3, 1e3);
  slice.spacing_mm = Eigen::Vector2d(spacing[1], spacing[0]);

  const DicomPixelLayout layout = readPixelLayout(file);
  if (layout.frames != 1)
    throw InputError(path, "frames", std::to_string(layout.frames), "a slice of a series must have one");
  const double slope = finiteOr(file, kSlope, 1), intercept = finiteOr(file, kIntercept, 0);
  // Signed pixels come as if their smallest were zero.
  const double smallest = layout.is_signed ? -std::ldexp(1.0, layout.bits_stored - 1) : 0;
  decodeDicomFrame(file, layout, 0).convertTo(slice.values, CV_32F, slope, intercept + slope * smallest);
  return slice;
}

}  // namespace angio::io
