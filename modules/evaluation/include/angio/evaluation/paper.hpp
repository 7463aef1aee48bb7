// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/evaluation/simulation_run.hpp"

namespace angio::evaluation {

// The simulation experiments of the Iterative PnP paper ("Iterative PnP and its application in 3D-2D vascular image
// registration for robot navigation"): its protocol as far as it says, and its printed figures to compare with.

/// The paper's PR in millimetres is so many for a pixel (its Table III).
constexpr double kPaperPixel_mm = 0.30;

/// Spread of the starts, standard deviation per axis, and what the paper's method leaves (its Table III).
struct PaperStart {
  double rotation_std_deg, translation_std_mm;
  double mean_pr_mm, gfr_percent, rotation_deg, translation_mm;
};
const std::vector<PaperStart>& paperStarts();

/// The spread of Table I: 2 deg, 5 mm.
const PaperStart& paperTable1Start();

/// Noise-free, everything in view, one 2D point per point of the tree; the view, which the paper does not tell, is
/// another one in every trial.
SimulationSettings paperProtocol(const PaperStart& start, int trials, int seed);

/// What the tables say of one run. PR is a trial's root mean square distance from projected model points to the nearest
/// image points: small for a wrong pose, too. The pose errors are against the truth.
struct PaperFigures {
  std::string name;
  double gfr_percent = 0;  ///< Share of trials with PR > 5 px.
  double mean_pr_mm = 0, p75_pr_mm = 0, p95_pr_mm = 0;
  double rotation_deg = 0, centroid_mm = 0;  ///< Means over the trials.
  double median_rotation_deg = 0, median_centroid_mm = 0;
  double pose_ok_percent = 0;  ///< Within 0.1 deg and 1 mm.
  double time_ms = 0;          ///< Median.
};
PaperFigures paperFigures(const EntrantRun& run);

/// All runs of one spread of the starts.
struct PaperLevel {
  PaperStart start;
  std::vector<EntrantRun> runs;
};

/// Table I with the paper's rows above ours, Markdown.
std::string paperTable1(const std::vector<EntrantRun>& runs);

/// Table III with the paper's rows beside ours, Markdown.
std::string paperTable3(const std::vector<PaperLevel>& levels);

nlohmann::ordered_json paperAsJson(const std::vector<EntrantRun>& table1, const std::vector<PaperLevel>& table3);

/// One self-contained HTML page.
std::string paperReportHtml(const std::vector<EntrantRun>& table1, const std::vector<PaperLevel>& table3,
                            const std::string& tree_name, const nlohmann::ordered_json& settings_shown);

}  // namespace angio::evaluation
