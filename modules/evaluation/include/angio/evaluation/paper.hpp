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

/// The paper's PR ("root mean square error of all the projected source points"): distances from the projections of all
/// of the tree's points, on the detector or off it, to the nearest image point [px]. It is small for a wrong pose that
/// lays the tree over the image, too. Nothing where a point is behind the source, or the image is empty.
///
/// @param points_model  The tree's points, displaced or not, 3 x N [m].
std::optional<double> projectionResidual_px(const Eigen::Matrix3Xd& points_model, const Pose& T_camera_model,
                                            const XrayView& view);

/// Noise-free, everything in view, one 2D point per point of the tree; the view, which the paper does not tell, is
/// another one in every trial.
SimulationSettings paperProtocol(const PaperStart& start, int trials, int seed);

/// All runs of one spread of the starts.
struct PaperLevel {
  PaperStart start;
  std::vector<EntrantRun> runs;
};

/// Tables I and III, those that were run: {"table1": {"paper": ..., "here": {method: figures}}, "table3": [{...,
/// "paper":
/// ..., "here": ...}]}.
Json paperAsJson(const std::vector<EntrantRun>& table1, const std::vector<PaperLevel>& table3);

/// Of that, Table I with the paper's rows above ours, and Table III with them beside ours, Markdown.
std::string paperTable1(const Json& paper);
std::string paperTable3(const Json& paper);

/// The paper's figure of losses, measured: what iterative_pnp leaves over the spread of the starts with each loss. Of
/// levels that were run with methods that differ in their loss alone; Markdown.
std::string lossTable(const Json& levels);

/// What a report shows: what was run of it.
struct PaperReport {
  const std::vector<EntrantRun>& table1;
  const Json& paper;  ///< As paperAsJson() has it; "table2", "losses", "visible_fraction" and "point_sets" beside it
                      ///< where they were run.
  std::string tree_name;
  Json settings_shown;
  Json machine;  ///< Null: the report has neither times nor the machine.
};

/// One self-contained HTML page.
std::string paperReportHtml(const PaperReport& report);

}  // namespace angio::evaluation
