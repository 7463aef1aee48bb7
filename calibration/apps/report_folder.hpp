// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace angio {

/// Pictures and a page of a calibration, in a folder of their own.
class ReportFolder {
 public:
  /// Makes the folder. Throws InputError when it cannot be made; so do the others when a file cannot be written.
  explicit ReportFolder(const std::string& folder);

  void picture(const std::string& name, const cv::Mat& picture) const;

  /// overview.jpg: pictures beside each other, of one height.
  void overview(const std::vector<cv::Mat>& pictures) const;

  /// index.html.
  void page(const std::string& title, const std::string& subtitle, const std::vector<std::string>& sections_html) const;

 private:
  std::string folder_;
};

/// A table or text as programs print it: as it stands, in a face of one width.
std::string printed(const std::string& text);

}  // namespace angio
