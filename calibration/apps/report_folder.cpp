// SPDX-License-Identifier: GPL-2.0-or-later
#include "report_folder.hpp"

#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <system_error>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::apps {
namespace {

constexpr double kOverviewHeight_px = 480;

}  // namespace

void writeReport(const std::string& folder, const std::string& title, const std::string& subtitle,
                 const std::vector<ReportSection>& sections) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder, "report", "", "cannot be made: " + error.message());
  const auto fileIn = [&](const std::string& name) { return (std::filesystem::path(folder) / name).string(); };
  std::vector<cv::Mat> overview;
  std::vector<std::string> sections_html;
  for (const ReportSection& section : sections) {
    std::vector<std::string> figures;
    for (const ReportPicture& picture : section.pictures) {
      writeImage(fileIn(picture.file), picture.image);
      figures.push_back(html::picture(picture.image, picture.caption));
      if (!picture.in_overview) continue;
      const double scale = kOverviewHeight_px / picture.image.rows;
      cv::resize(picture.image, overview.emplace_back(), {}, scale, scale, cv::INTER_AREA);
    }
    const std::string pictures = figures.empty() ? "" : html::grid(figures);
    sections_html.push_back(html::section(section.title, section.text_html + pictures));
  }
  writeImage(fileIn("overview.jpg"), sideBySide(overview));
  writeWholeFile(fileIn("index.html"), html::page(title, subtitle, sections_html));
}

std::string printed(const std::string& text) { return "<pre>" + htmlEscaped(text) + "</pre>"; }

}  // namespace angio::apps
