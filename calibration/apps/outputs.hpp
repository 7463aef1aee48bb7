// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/claimed_folder.hpp"

namespace angio::apps {

/// Where a calibration writes, tried before its work: no other program writes into the report's folder while this
/// lives.
class ClaimedOutputs {
 public:
  /// @param out     The result's file; empty: none.
  /// @param report  The report's folder, which is made when it is missing; empty: none.
  /// Throws InputError that names the one that cannot be written.
  ClaimedOutputs(const std::string& out, const std::string& report);

 private:
  std::optional<ClaimedFolder> report_;
};

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

/// Writes pictures, a page of them (index.html) and overview.jpg, some of them beside each other, into a folder that
/// ClaimedOutputs has made. Throws InputError when that cannot be done.
void writeReport(const std::string& folder, const std::string& title, const std::string& subtitle,
                 const std::vector<ReportSection>& sections);

/// A table or text as programs print it: as it stands, in a face of one width.
std::string printed(const std::string& text);

/// A transform for a person, two lines: translation and rotation vector, each number with its sigma.
std::string transformRow(const std::string& name, const Pose& T, const Eigen::MatrixXd& covariance);

}  // namespace angio::apps
