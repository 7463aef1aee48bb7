// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <variant>

#include "angio/base/variant_sections.hpp"
#include "angio/imaging/extractor_settings.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::imaging {

/// Finds vessel centrelines in an X-ray image. One object per stream of images: it keeps its buffers.
class CenterlineExtractor {
 public:
  virtual ~CenterlineExtractor() = default;

  /// Ordered branches with tangents and radii [px]; empty when there is no vessel. `image` is CV_8UC1 or CV_16UC1;
  /// throws InputError for any other type or an empty image.
  virtual Centerline2d extract(const cv::Mat& image) = 0;

  /// The same of an image in which vessels are expected [px]: a projected tree whose pose was tracked, in branches.
  /// What the image shows without `expected` is found as above. Where that leaves a part of it without a line, one is
  /// fitted to the image there, and kept if a vessel's shadow fits it. A method without use for it, or an `expected`
  /// without branches: as above.
  virtual Centerline2d extract(const cv::Mat& image, const Centerline2d& expected);
};

/// The settings type is the choice of the method.
using ExtractorSettings = std::variant<OtsuSettings, RidgeSettings>;

/// Throws InputError when a setting is out of its range.
std::unique_ptr<CenterlineExtractor> makeExtractor(const ExtractorSettings& settings);

/// All methods' settings, a section each by its name, and under `extractor` the one that is chosen: for settings files.
struct ExtractorSections : VariantSections<ExtractorSettings> {
  explicit ExtractorSections(const ExtractorSettings& chosen = RidgeSettings{})
      : VariantSections("extractor", chosen, "How vessels are found in images") {}
};

}  // namespace angio::imaging
