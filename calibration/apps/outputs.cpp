// SPDX-License-Identifier: GPL-2.0-or-later
#include "outputs.hpp"

#include <algorithm>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/overlay.hpp"

namespace angio::apps {

ClaimedOutputs::ClaimedOutputs(const std::string& out, const std::string& report) {
  requireFolderOf(out);
  if (!report.empty()) report_.emplace(report);
}

void writeReport(const std::string& folder, const std::string& title, const std::string& subtitle,
                 const std::vector<ReportSection>& sections) {
  constexpr double kOverviewHeight_px = 480;
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

std::string transformRow(const std::string& name, const Pose& T, const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  const Eigen::Vector3d t = 1e3 * T.translation(), w = radToDeg(1) * logSO3(T.linear());
  std::string row = formatted("%-15s", name.c_str());
  for (int k = 0; k < 3; ++k) row += formatted("  %9.3f +- %-7.3f", t[k], 1e3 * sigma[k]);
  row += " mm\n" + std::string(15, ' ');
  for (int k = 0; k < 3; ++k) row += formatted("  %9.4f +- %-7.4f", w[k], radToDeg(sigma[3 + k]));
  return row + " deg (rotation vector; sigma of turns about the parent's axes)\n";
}

}  // namespace angio::apps
