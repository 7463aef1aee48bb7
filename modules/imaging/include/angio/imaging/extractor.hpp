// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <variant>
#include <vector>

#include "angio/imaging/otsu_settings.hpp"
#include "angio/imaging/ridge_settings.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::imaging {

/// Finds vessel centrelines in an X-ray image. One object per stream of images: it keeps its buffers.
class CenterlineExtractor {
 public:
  virtual ~CenterlineExtractor() = default;

  /// Ordered branches with tangents and radii [px]; empty when there is no vessel. `image` is CV_8UC1 or CV_16UC1;
  /// throws InputError for any other type or an empty image.
  virtual Centerline2d extract(const cv::Mat& image) = 0;
};

/// The settings type is the choice of the method.
using ExtractorSettings = std::variant<OtsuSettings, RidgeSettings>;

/// Throws InputError when a setting is out of its range.
std::unique_ptr<CenterlineExtractor> makeExtractor(const ExtractorSettings& settings);

/// Names of the methods ("otsu"), in the variant's order.
std::vector<std::string> extractorNames();

/// Default settings of a method by its name; throws InputError that lists the names there are.
ExtractorSettings extractorSettingsNamed(const std::string& name);

/// The name of the method that `settings` choose.
std::string extractorName(const ExtractorSettings& settings);

}  // namespace angio::imaging
