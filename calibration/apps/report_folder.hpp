// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"

namespace angio::apps {

/// A picture of a calibration's report and the file that it is written to beside the page.
struct ReportPicture {
  std::string file, caption;
  cv::Mat image;
  bool in_overview = true;
};

struct ReportSection {
  std::string title, text_html;
  std::vector<ReportPicture> pictures;
};

/// Writes pictures, a page of them (index.html) and overview.jpg, some of them beside each other, into a folder that is
/// made when it is missing. Throws InputError when that cannot be done.
void writeReport(const std::string& folder, const std::string& title, const std::string& subtitle,
                 const std::vector<ReportSection>& sections);

/// A table or text as programs print it: as it stands, in a face of one width.
std::string printed(const std::string& text);

}  // namespace angio::apps
