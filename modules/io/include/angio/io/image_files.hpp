// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/geometry/xray_camera.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// The X-ray frames of one file, by its content: a PNG or JPEG is one frame, a TIFF has one to a page, a DICOM run its
/// own (see XaRun, which knows their geometry too). The file is held in memory and frames are decoded when asked for.
class XrayFrames {
 public:
  /// Throws InputError that names the file when it is of no such kind, or broken as far as that shows without decoding.
  explicit XrayFrames(const std::string& path);
  XrayFrames(XrayFrames&&) noexcept;
  XrayFrames& operator=(XrayFrames&&) noexcept;
  ~XrayFrames();

  /// How many there are, at least 1.
  int count() const;

  /// One frame, from 0: CV_8UC1 or CV_16UC1, as a camera at the X-ray source sees it. Colours pass when all channels
  /// are equal; a DICOM frame of fewer bits than its type is shifted up to the type's range. Throws InputError that
  /// names the file for a frame that is not there, for anything else, for a broken image and for more than 8192 x 8192
  /// pixels.
  cv::Mat frame(int number) const;

 private:
  struct Source;
  std::unique_ptr<Source> source_;
};

/// One frame of a file: XrayFrames(path).frame(frame).
cv::Mat readXrayImage(const std::string& path, int frame = 0);

/// The same, of one camera's detector: throws InputError too when the image is not of the camera's size.
cv::Mat readXrayImage(const std::string& path, const XrayCamera& camera, int frame = 0);

/// Writes PNG, TIFF or JPEG by extension (in any case), whole or not at all. `image` is CV_8UC1, CV_8UC3 (blue, green,
/// red) or, but not for JPEG, CV_16UC1. Throws InputError for other types and when the file cannot be written.
void writeImage(const std::string& path, const cv::Mat& image);

/// Throws InputError when writeImage() could not write there, by extension or folder: better before hours of work than
/// after. An empty path is none.
void requireImagePath(const std::string& path);

/// Writes frames as the pages of one TIFF (.tif, .tiff), compressed without loss, whole or not at all; XrayFrames reads
/// them back. At least one and at most 10,000 frames, all of one size and all CV_8UC1 or all CV_16UC1. Throws
/// InputError otherwise, for more than 1 GiB, and when the file cannot be written.
void writeImageSequence(const std::string& path, const std::vector<cv::Mat>& frames);

}  // namespace angio::io
