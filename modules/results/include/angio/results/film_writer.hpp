// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/videoio.hpp>
#include <string>

#include "angio/results/namespace.hpp"

namespace angio::results {

/// Writes pictures one after the other: "film.mp4" as a film, or "frames/%04d.png" (.jpg) as numbered files, from 0.
class FilmWriter {
 public:
  /// Throws InputError when `path` is neither, or its folder does not exist.
  FilmWriter(const std::string& path, double frame_rate_hz);
  FilmWriter(const FilmWriter&) = delete;
  FilmWriter& operator=(const FilmWriter&) = delete;
  ~FilmWriter();  ///< A film that was not finished is thrown away.

  /// The next picture, CV_8UC3. All of a film have the size of the first, of an even number of pixels. Throws
  /// InputError when it cannot be written or has another size.
  void write(const cv::Mat& picture);

  /// The film is complete: it is read back, waited for until it is on its disk, and appears under its name. Throws
  /// InputError when it is not whole, as on a full disk, and no file is left; a film without pictures cannot be.
  void finish();

  int pictures() const { return pictures_; }  ///< Written so far.

 private:
  std::string path_, partial_;
  double rate_hz_;
  bool numbered_;
  int pictures_ = 0;
  cv::Size size_;
  cv::VideoWriter writer_;
};

}  // namespace angio::results
