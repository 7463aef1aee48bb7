// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/motion/motion_predictor_settings.hpp"
#include "angio/perception/target_need.hpp"
#include "angio/servo/best_view.hpp"
#include "angio/servo/namespace.hpp"

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

  /// A requested view is for looking, and is corrected by what is seen from there.
  TargetNeed targetNeed() const {
    return goal == ViewGoal::kRequested ? TargetNeed::kAcrossBeam : TargetNeed::kEverywhere;
  }

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

  /// Bounds of the trajectory, of any law, where the arm would come to rest if it braked now; 0: not watched. Where one
  /// is broken the task holds until the machine is back inside, by a tenth of the bound, or another view is asked for.
  /// The trajectory starts where the machine was when it began to move for this goal; the goal is where it is seen now.
  double max_table_excursion_mm = 20;   ///< Of the table from the box that its positions at start and goal span.
  double max_target_excursion_mm = 10;  ///< Of the target's distance from its goal beyond what it was at the start.

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
    v.number("max_table_excursion_mm", max_table_excursion_mm, 0, 1000);
    v.number("max_target_excursion_mm", max_target_excursion_mm, 0, 1000);
  }
};

/// How a joint follows a predicted path: the first step of a plan over the next periods.
struct PathPlanSettings {
  static constexpr int periods_ahead =
      8;                                 ///< Over which a command is planned, as far as the motion is predicted at all.
  double acceleration_share = 0.9;       ///< Of the joints' acceleration and jerk, that plans use.
  static constexpr double effort = 0.3;  ///< Weight of changes of velocity against distances: against following noise.

  void visit(SettingsVisitor& v) { v.number("acceleration_share", acceleration_share, 0.01, 1); }
};

/// What is kept: a point of the tree, or the tip of a catheter, wherever that goes.
enum class CenterOn { kTarget, kCatheterTip };

/// Keep the target at a pixel by the table alone, while the patient breathes, the heart beats and both drift.
///
/// The depth along the beam is not followed. A table of 0.2 m/s^2 can follow breathing: Lujan's sin^4 of 15 mm in 4 s
/// has a largest speed of 15 mm/s and a largest acceleration of 37 mm/s^2, half as much again in a deep breath. It can
/// not follow a heartbeat of some millimetres, whose systole alone asks for 200 mm/s^2 a millimetre: commands are
/// planned so that the table goes through the middle of it.
struct CenterTaskSettings {
  static constexpr const char* kName = "centre";
  static constexpr bool kPatientMoves = true;  ///< Frames are looked for where the motion is predicted to be.
  static TargetNeed targetNeed() { return TargetNeed::kAcrossBeam; }  ///< The image's middle has no depth.

  CenterOn on = CenterOn::kTarget;
  bool predict = true;           ///< Not: the target is taken to stay where it was seen last.
  double offset_px[2] = {0, 0};  ///< The wanted pixel, from the principal point: right, down.
  PathPlanSettings plan;
  double reached_mm = 1;  ///< At the target: the target is centred when its image is as near as this.
  double max_std_mm = 8;  ///< Of the predicted place across the beam: beyond it the task holds.

  /// How far around the target the image is looked at for how the place itself lies, where a tree that deforms is
  /// registered as a rigid one; 0: not at all. And how far off it may lie, as a standard deviation.
  static constexpr double near_mm = 15;
  static constexpr double near_std_mm = 2;

  /// Of the registered depth, besides what the registration says itself: a breath or a heartbeat that stretches the
  /// tree by 3 % across the beam is taken for 20 mm along it, at 0.75 m.
  static constexpr double depth_std_mm = 20;

  MotionPredictorSettings motion;

  void visit(SettingsVisitor& v) {
    v.choice("on", on, {"target", "catheter_tip"});
    v.flag("predict", predict);
    v.numbers("offset_px", offset_px, 2, -1e4, 1e4);
    plan.visit(v);
    v.number("reached_mm", reached_mm, 1e-3, 100);
    v.number("max_std_mm", max_std_mm, 1e-3, 1000);
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
  }
};

/// Keep the view as it was when the task began: angles and table go along with the patient.
struct HoldTaskSettings {
  static constexpr const char* kName = "hold";
  static constexpr bool kPatientMoves = true;  ///< Frames are looked for where the motion is predicted to be.
  static TargetNeed targetNeed() { return TargetNeed::kEverywhere; }

  bool predict = true;       ///< Not: the patient is taken to stay as seen last.
  double reached_deg = 0.2;  ///< The view is kept while the beam is as near as this ...
  double reached_mm = 1;     ///< ... and the target.
  double max_std_mm = 8;     ///< Of the target's predicted place, its worst direction: beyond it the task holds.
  double max_std_deg = 3;    ///< Of the predicted rotation.
  PathPlanSettings plan;
  MotionPredictorSettings motion;

  void visit(SettingsVisitor& v) {
    v.flag("predict", predict);
    v.number("reached_deg", reached_deg, 1e-4, 10);
    v.number("reached_mm", reached_mm, 1e-3, 100);
    v.number("max_std_mm", max_std_mm, 1e-3, 1000);
    v.number("max_std_deg", max_std_deg, 1e-3, 90);
    plan.visit(v);
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
  }
};

/// Find the target's depth by a small turn of the arm, when one view leaves it open: see GatedPerception::resolveDepth.
struct ResolveDepthTaskSettings {
  static constexpr const char* kName = "resolve_depth";
  static constexpr bool kPatientMoves = true;  ///< Frames are looked for where the motion is predicted to be.
  static TargetNeed targetNeed() { return TargetNeed::kResolvingDepth; }

  double max_std_mm = 3;    ///< Of the target in its worst direction: from there on its depth is known.
  double max_turn_deg = 6;  ///< Of the primary angle, in all.
  bool first = false;       ///< Before view or hold, whenever those have to know a depth that is open.
  static constexpr double speed_deg_per_s = 6;
  static constexpr double watch_s = 4;  ///< Before the turn, standing: a breath, of which way and size are then known.

  void visit(SettingsVisitor& v) {
    v.number("max_std_mm", max_std_mm, 1e-3, 1000);
    v.number("max_turn_deg", max_turn_deg, 1, 6);
    v.flag("first", first);
  }
};

}  // namespace angio::servo
