// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/perception/target_need.hpp"
#include "angio/servo/best_view.hpp"

namespace angio::servo {

/// What says which view a ViewTask is to reach.
enum class ViewGoal {
  kAngles,    ///< Beam angles in the patient's own axes, the target at the isocentre.
  kBestView,  ///< Those of bestView() for a segment, its middle at the isocentre.
  kPose,      ///< Another registered pose: its beam and its source; its roll is out of the arm's hands.
  kRequested  ///< What VIEW_REQUEST asks for; at rest while nothing does, and when it is reached.
};

/// Reach a view of the anatomy and keep it.
struct ViewTaskSettings {
  static constexpr const char* kName = "view";
  static constexpr bool kPatientMoves = false;
  static constexpr TargetNeed kTargetNeed = TargetNeed::kEverywhere;

  ViewGoal goal = ViewGoal::kAngles;
  double primary_deg = 30;    ///< LAO positive. For kAngles.
  double secondary_deg = 15;  ///< CRA positive.
  int segment_first = -1;     ///< Tree points that the segment of kBestView runs between, the first upstream; or ...
  int segment_last = -1;
  int branch = 0;                          ///< ... while these are -1, the branch of this number.
  BestViewSettings best_view;              ///< How it is searched for.
  Pose T_camera_model = Pose::Identity();  ///< For kPose; not part of a settings file: poses have files of their own.

  double reached_deg = 0.1;                 ///< The view is reached when the beam is as near as this ...
  double reached_mm = 0.5;                  ///< ... and the target, both with their standard deviations added ...
  static constexpr int reached_frames = 5;  ///< ... for so many trusted frames in a row.

  /// Share of the acceleration that the approach counts on: faster than it can brake from it does not come in.
  static constexpr double braking_share = 0.7;

  void visit(SettingsVisitor& v) {
    v.choice("goal", goal, {"angles", "best_view", "pose", "requested"});
    v.number("primary_deg", primary_deg, -180, 180);
    v.number("secondary_deg", secondary_deg, -90, 90);
    v.integer("segment_first", segment_first, -1, 1000000000);
    v.integer("segment_last", segment_last, -1, 1000000000);
    v.integer("branch", branch, 0, 1000000000);
    v.section("best_view", [&](SettingsVisitor& fields) { best_view.visit(fields); });
    v.number("reached_deg", reached_deg, 1e-4, 10);
    v.number("reached_mm", reached_mm, 1e-3, 100);
  }
};

}  // namespace angio::servo
