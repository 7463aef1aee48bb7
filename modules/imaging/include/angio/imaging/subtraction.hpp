// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "angio/base/settings.hpp"
#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// How a mask frame is laid over a live one before it is subtracted.
struct SubtractionSettings {
  double max_shift_px = 16;

  void visit(SettingsVisitor& v) {
    v.number("max_shift_px", max_shift_px, 0, 1000, "The patient has breathed by less; 0 takes the mask as it is");
  }
};

/// The shift that moves `mask` onto `live` [px], as far as one shift can: live(p) looks like mask(p - shift).
///
/// Found from the logarithms of both, by the phase of their spectra and then by least squares that take what only one
/// of them shows, contrast agent, for outliers. Zero when the two have nothing in common within `max_shift_px`.
/// Images are CV_8UC1 or CV_16UC1 of one size; throws InputError otherwise.
Eigen::Vector2d maskShift(const cv::Mat& live, const cv::Mat& mask, double max_shift_px);

/// Digital subtraction: what `live` shows and `mask`, a frame without contrast agent, does not.
///
/// CV_16UC1, kSubtractedLevel where nothing changed and less by the factor exp(-absorption) under contrast agent, so
/// that every extractor takes it like an X-ray image. Bright vessels in both images come out bright. Throws InputError
/// as maskShift does, and when a setting is out of its range.
cv::Mat subtracted(const cv::Mat& live, const cv::Mat& mask, const SubtractionSettings& settings = {});

constexpr double kSubtractedLevel = 30000;  ///< Grey value of no change.

}  // namespace angio::imaging
