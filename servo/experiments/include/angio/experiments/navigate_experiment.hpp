// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/experiments/closed_loop.hpp"
#include "angio/navigation/catheter_node.hpp"
#include "angio/results/record_row.hpp"

namespace angio::experiments {

/// Many journeys of a simulated catheter, each to another branch of a tree.
///
/// The shipped nodes of both machines (ServoNode, CatheterNode) run on one bus in simulated time against a simulated
/// lab. The catheter's controller asks for views, the C-arm's loop goes there by what the images show, and an injector
/// fills the vessels with contrast agent while a view is being reached and until a roadmap can have been made.
struct NavigateExperimentSettings {
  double roadmap_contrast_s = 1.5;
  double max_s = 240;
  static constexpr double min_radius_mm = 0.4;  ///< Targets are branches that no narrower vessel leads to.
  double min_route_mm = 60;
  static constexpr double into_branch_mm = 10;  ///< The target in its branch, or four fifths of a shorter one.
  double calibration_error_deg = 1;
  double calibration_error_mm = 3;
  int detector_px = 512;
  LabSettings lab;

  void visit(SettingsVisitor& v) {
    v.number("roadmap_contrast_s", roadmap_contrast_s, 0, 60,
             "How long contrast agent is injected after a view is reached");
    v.number("max_s", max_s, 1, 1e4, "A journey that takes longer has failed");
    v.number("min_route_mm", min_route_mm, 0, 1000, "Least way from the root to the target");
    v.number("calibration_error_deg", calibration_error_deg, 0, 10, "Error of the rotation of T_dsa_cb");
    v.number("calibration_error_mm", calibration_error_mm, 0, 50, "Error of the translation of T_dsa_cb");
    v.integer("detector_px", detector_px, 256, 2048,
              "Width and height of the detector's image: fluoroscopy reads its pixels out in fours");
    v.section("lab", [this](SettingsVisitor& s) { lab.visit(s); });
  }
};

/// What a journey is made of, beside the anatomy.
struct NavigateParts {
  CatheterSettings catheter;
  CatheterControllerSettings controller;
  ServoLoopSettings carm_loop = withHybridLaw();  ///< Its task becomes the view that is asked for.
  SimulatedPatientSettings patient;  ///< The X-ray and the body's motion; its own device and bolus are not used.

  /// The hybrid law keeps the target near its straight path. By the position-based law whole trees leave a detector of
  /// 315 mm on their way to another view, and no registration brings them back.
  static ServoLoopSettings withHybridLaw() {
    ServoLoopSettings loop;
    loop.law = HybridSettings{};
    return loop;
  }

  void visit(SettingsVisitor& v) {
    v.section("catheter", [this](SettingsVisitor& s) { catheter.visit(s); });
    controller.visit(v);
    v.section("patient", [this](SettingsVisitor& s) { patient.visit(s); });
  }
};

/// What became of one journey.
struct NavigateResult {
  TreeLocation target;
  int seed = 0;
  bool reached = false;               ///< The tip truly is in the target's branch, and the navigator says so.
  std::string ended;                  ///< "arrived", "given up" and why, or "too long".
  double time_s = 0;                  ///< Simulated.
  double route_m = 0;                 ///< From start to target along the vessels.
  int forks = 0;                      ///< On the route.
  int views = 0;                      ///< That the C-arm took.
  int misses = 0;                     ///< Wrong branches and walls that the navigator noticed.
  int wall_contacts = 0;              ///< True ones.
  double max_force_n = 0;             ///< At the drive, pushing or pulling, at every step of 5 ms.
  double max_tip_force_n = 0;         ///< Of the wall on the tip.
  int frames = 0, held = 0;           ///< And those on which the drive stood still.
  int looked = 0;                     ///< Frames that were searched for the catheter.
  std::optional<std::string> breach;  ///< A limit that the C-arm exceeded.
  int near_of_all = 0;                ///< Frames whose tip was within 1.5 mm of the estimate, believed or not.
  std::vector<double> errors_m;       ///< Of the believed tip from the true one, of each frame that was believed.
  std::vector<double> arc_errors_m;   ///< The same along the vessels where the branch is right.
  int wrong_branch = 0;  ///< Frames that were believed with the tip in a wrong branch, 2 mm and more from it.
};

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, NavigateResult>& result) {
  f("branch", result.target.branch);
  f("arc_m", result.target.arc_m);
  f("seed", result.seed);
  f("reached", result.reached);
  f("ended", result.ended);
  f("time_s", result.time_s);
  f("route_m", result.route_m);
  f("forks", result.forks);
  f("views", result.views);
  f("misses", result.misses);
  f("wall_contacts", result.wall_contacts);
  f("max_force_n", result.max_force_n);
  f("max_tip_force_n", result.max_tip_force_n);
  f("frames", result.frames);
  f("held", result.held);
  f("looked", result.looked);
  f("breach", result.breach);
  f("near_of_all", result.near_of_all);
  f("errors_m", result.errors_m);
  f("arc_errors_m", result.arc_errors_m);
  f("wrong_branch", result.wrong_branch);
}

/// Where journeys of a tree go: `count` branches, spread over all that qualify; fewer when there are fewer.
std::vector<TreeLocation> navigateTargets(const VesselTree& tree, const NavigateExperimentSettings& experiment,
                                          int count);

/// A patient whose vessels fill when contrast agent is demanded, for a lab that shows a catheter of its own.
SimulatedPatientSettings navigatePatient(SimulatedPatientSettings patient);

/// The catheter with the roll that its tip has at the drive's zero [deg]: another one for each seed.
CatheterSettings navigateCatheter(CatheterSettings catheter, int seed);

/// What the catheter's controller is told of the C-arm.
CArmSetup navigateSetup(const Scenario& world, const CArmLimits& limits);

/// The same along given curves, 3 x N each, model frame [m]: `count` places spread evenly over the curves in turn and
/// over the length of each, none at its end, where others may go on. A curve counts where its points are the tree's.
std::vector<TreeLocation> targetsAlong(const VesselTree& tree, const NavigateExperimentSettings& experiment,
                                       const std::vector<Eigen::Matrix3Xd>& curves, int count);

/// One frame of a journey, for those who look on. Borrowed while they do.
struct NavigateMoment {
  double time_s = 0;
  const XrayFrame& frame;
  const CatheterControllerReport& report;
  ServoStatus status;  ///< Of the catheter's node.
  const CatheterTruth& truth;
};
using NavigateObserver = std::function<void(const NavigateMoment&)>;

/// One journey through the tree of a C-arm's laboratory: of `nominal`, with the tree's centroid at the isocentre.
/// `observer` is called with each frame that the catheter's node answers.
NavigateResult runNavigationExperiment(const VesselTree& tree, const CArmCalibration& nominal,
                                       const TreeLocation& target, const NavigateExperimentSettings& experiment,
                                       const NavigateParts& parts, int seed, const NavigateObserver& observer = {});

/// Rows of one tree, as JSON and as a table for people.
Json navigateExperimentAsJson(const std::string& tree_name, const std::vector<NavigateResult>& rows);
std::string navigateExperimentTable(const Json& trees);

}  // namespace angio::experiments
