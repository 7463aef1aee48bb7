// SPDX-License-Identifier: GPL-2.0-or-later
#include "report_folder.hpp"

#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <system_error>

#include "angio/base/errors.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"

namespace angio {
namespace {

constexpr double kOverviewHeight_px = 480;

std::string fileIn(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).string();
}

}  // namespace

ReportFolder::ReportFolder(const std::string& folder) : folder_(folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder, "report", "", "cannot be made: " + error.message());
}

void ReportFolder::picture(const std::string& name, const cv::Mat& picture) const {
  writeImage(fileIn(folder_, name), picture);
}

void ReportFolder::overview(const std::vector<cv::Mat>& pictures) const {
  std::vector<cv::Mat> scaled;
  for (const cv::Mat& picture : pictures) {
    const double scale = kOverviewHeight_px / picture.rows;
    cv::resize(picture, scaled.emplace_back(), {}, scale, scale, cv::INTER_AREA);
  }
  writeImage(fileIn(folder_, "overview.jpg"), sideBySide(scaled));
}

void ReportFolder::page(const std::string& title, const std::string& subtitle,
                        const std::vector<std::string>& sections_html) const {
  writeWholeFile(fileIn(folder_, "index.html"), html::page(title, subtitle, sections_html));
}

std::string printed(const std::string& text) { return "<pre>" + htmlEscaped(text) + "</pre>"; }

}  // namespace angio
