// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "angio/navigation/catheter_loop.hpp"
#include "angio/navigation/view_planner.hpp"
#include "angio/simulation/simulated_catheter.hpp"
#include "angio/simulation/simulated_patient.hpp"

namespace angio {

/// Many journeys of a simulated catheter, each to another branch of a tree.
///
/// The C-arm looks at the stretch around the tip from its best view, and from another when that one ends or leaves
/// doubt (ViewPlanner); while it turns, the drive stands still. With images, a roadmap begins each view and is renewed:
/// one frame with the vessels full of contrast agent, from which the tree is registered; between roadmaps there is no
/// contrast agent, and the catheter is what CatheterTracer finds along the registered tree. Without images, the
/// catheter's line is projected and disturbed instead.
struct NavigateStudySettings {
  bool images = true;
  double frame_rate_hz = 15;
  double roadmap_s = 15;             ///< Between two roadmaps.
  double longest_s = 240;            ///< A journey that takes longer has failed.
  double least_radius_mm = 0.4;      ///< Targets are branches that no narrower vessel leads to.
  double least_way_mm = 60;          ///< From the root to the target.
  double into_branch_mm = 10;        ///< The target in its branch, or four fifths of a shorter one.
  double calibration_error_deg = 1;  ///< Of the start of each view's first registration.
  double calibration_error_mm = 3;
  int detector_px = 512;  ///< Width and height of a detector of 315 mm: fluoroscopy reads its pixels out in fours.
  double noise_px = 0.7;  ///< Without images: of points of the catheter's line ...
  double outlier_share = 0.03;  ///< ... and how many frames show another line.

  void visit(SettingsVisitor& v) {
    v.flag("images", images);
    v.number("frame_rate_hz", frame_rate_hz, 1, 60);
    v.number("roadmap_s", roadmap_s, 0.1, 1e4);
    v.number("longest_s", longest_s, 1, 1e4);
    v.number("least_radius_mm", least_radius_mm, 0, 10);
    v.number("least_way_mm", least_way_mm, 0, 1000);
    v.number("into_branch_mm", into_branch_mm, 0, 100);
    v.number("calibration_error_deg", calibration_error_deg, 0, 10);
    v.number("calibration_error_mm", calibration_error_mm, 0, 50);
    v.integer("detector_px", detector_px, 256, 2048);
    v.number("noise_px", noise_px, 0, 20);
    v.number("outlier_share", outlier_share, 0, 1);
  }
};

/// Who is on the way: all that a journey is made of.
struct NavigateParts {
  CatheterSettings catheter;
  CatheterLoopSettings loop;
  ViewPlannerSettings view;
  SimulatedPatientSettings patient;  ///< The X-ray and the body's motion; its own device and bolus are not used.

  void visit(SettingsVisitor& v) {
    v.section("catheter", [this](SettingsVisitor& s) { catheter.visit(s); });
    loop.visit(v);
    v.section("view", [this](SettingsVisitor& s) { view.visit(s); });
    v.section("patient", [this](SettingsVisitor& s) { patient.visit(s); });
  }
};

/// What became of one journey.
struct NavigateRow {
  TreePlace target;
  bool reached = false;              ///< The tip truly is in the target's branch, and the navigator says so.
  std::string ended;                 ///< "arrived", "given up" and why, or "too long".
  double time_s = 0;                 ///< Simulated.
  double way_m = 0;                  ///< From start to target along the vessels.
  int forks = 0;                     ///< On the way.
  int views = 0;                     ///< That the C-arm took.
  int misses = 0;                    ///< Wrong branches and walls that the navigator noticed.
  int wall_contacts = 0;             ///< True ones.
  double largest_force_n = 0;        ///< At the drive.
  int frames = 0, waited = 0;        ///< And those on which it stood still for doubt.
  std::vector<double> errors_m;      ///< Of the believed tip from the true one, of each frame that was believed.
  std::vector<double> arc_errors_m;  ///< The same along the vessels where the chain is right.
  int wrong_chain = 0;  ///< Frames that were believed with the tip in a wrong chain, 2 mm and more from it.
};

/// Where journeys of a tree go: `count` branches, spread over all that qualify; fewer when there are fewer.
std::vector<TreePlace> navigateTargets(const VesselTree& tree, const NavigateStudySettings& study, int count);

/// One frame of a journey, for those who look on. Borrowed while they do.
struct NavigateMoment {
  double time_s = 0;
  const cv::Mat& image;  ///< Empty without images.
  const SeenPose& pose;
  const std::optional<CatheterTrace>& trace;
  const NavigationInput& input;
  const NavigationAnswer& answer;
  const CatheterTruth& truth;
};
using NavigateObserver = std::function<void(const NavigateMoment&)>;

/// One journey. `look_on` is called with each frame.
NavigateRow studyNavigation(const VesselTree& tree, const TreePlace& target, const NavigateStudySettings& study,
                            const NavigateParts& parts, std::uint64_t seed, const NavigateObserver& look_on = {});

/// Rows of one tree, as JSON and as a table for people.
nlohmann::ordered_json navigateStudyAsJson(const std::string& tree_name, const std::vector<NavigateRow>& rows);
std::string navigateStudyTable(const nlohmann::ordered_json& trees);

}  // namespace angio
