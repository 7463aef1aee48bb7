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
  double primary_deg = 30;
  double secondary_deg = 15;
  int segment_first = -1;
  int segment_last = -1;
  int branch = 0;
  BestViewSettings best_view;              ///< How it is searched for.
  Pose T_camera_model = Pose::Identity();  ///< For kPose; not part of a settings file: poses have files of their own.

  double reached_deg = 0.1;
  double reached_mm = 0.5;
  static constexpr int reached_frames = 5;  ///< The view is reached after so many trusted frames in a row.

  // Bounds of the trajectory, of any law, where the arm would come to rest if it braked now. Where one is broken the
  // task holds until the machine is back inside, by a tenth of the bound, or another view is asked for. The trajectory
  // starts where the machine was when it began to move for this goal; the goal is where it is seen now.
  double max_table_excursion_mm = 20;
  double max_target_excursion_mm = 10;

  /// Share of the acceleration that the approach counts on: faster than it can brake from it does not come in.
  static constexpr double braking_share = 0.7;

  void visit(SettingsVisitor& v) {
    v.choice("goal", goal, {"angles", "best_view", "pose", "requested"}, "What says which view is to be reached");
    v.number("primary_deg", primary_deg, -180, 180, "With goal angles: LAO, in the patient's own axes; negative: RAO");
    v.number("secondary_deg", secondary_deg, -90, 90,
             "With goal angles: CRA, in the patient's own axes; negative: CAU");
    v.integer("segment_first", segment_first, -1, 1000000000,
              "With goal best_view: first tree point of the segment, upstream; -1: the branch counts");
    v.integer("segment_last", segment_last, -1, 1000000000,
              "With goal best_view: last tree point of the segment; -1: the branch counts");
    v.integer("branch", branch, 0, 1000000000, "With goal best_view and no segment: the branch of this number");
    v.section("best_view", [&](SettingsVisitor& fields) { best_view.visit(fields); });
    v.number("reached_deg", reached_deg, 1e-4, 10,
             "The view is reached when the beam is as near as this, its standard deviation added");
    v.number("reached_mm", reached_mm, 1e-3, 100,
             "The view is reached when the target is as near as this, its standard deviation added");
    v.number(
        "max_table_excursion_mm", max_table_excursion_mm, 0, 1000,
        "How far from the box that its positions at start and goal span the table may come to rest; 0: not watched");
    v.number("max_target_excursion_mm", max_target_excursion_mm, 0, 1000,
             "How much farther from its goal than at the start the target may come to rest; 0: not watched");
  }
};

/// How a joint follows a predicted path: the first step of a plan over the next periods.
struct PathPlanSettings {
  static constexpr int periods_ahead =
      8;  ///< Over which a command is planned, as far as the motion is predicted at all.
  double acceleration_share = 0.9;
  static constexpr double effort = 0.3;  ///< Weight of changes of velocity against distances: against following noise.

  void visit(SettingsVisitor& v) {
    v.number("acceleration_share", acceleration_share, 0.01, 1,
             "Share of the joints' acceleration and jerk that plans use");
  }
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
  bool predict = true;
  double offset_px[2] = {0, 0};
  PathPlanSettings plan;
  double reached_mm = 1;
  double max_std_mm = 8;

  /// How far around the target the image is looked at for how the place itself lies, where a tree that deforms is
  /// registered as a rigid one; 0: not at all. And how far off it may lie, as a standard deviation.
  static constexpr double near_mm = 15;
  static constexpr double near_std_mm = 2;

  /// Of the registered depth, besides what the registration says itself: a breath or a heartbeat that stretches the
  /// tree by 3 % across the beam is taken for 20 mm along it, at 0.75 m.
  static constexpr double depth_std_mm = 20;

  MotionPredictorSettings motion;

  void visit(SettingsVisitor& v) {
    v.choice("on", on, {"target", "catheter_tip"}, "What is kept centred");
    v.flag("predict", predict, "The motion is predicted; without, the target is taken to stay where it was seen last");
    v.numbers("offset_px", offset_px, 2, -1e4, 1e4, "The wanted pixel, from the principal point: right, down");
    plan.visit(v);
    v.number("reached_mm", reached_mm, 1e-3, 100,
             "The target is centred when its image is as near as this, measured at the target");
    v.number("max_std_mm", max_std_mm, 1e-3, 1000,
             "Standard deviation of the predicted place across the beam, beyond which the task holds");
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
  }
};

/// Keep the view as it was when the task began: angles and table go along with the patient.
struct HoldTaskSettings {
  static constexpr const char* kName = "hold";
  static constexpr bool kPatientMoves = true;  ///< Frames are looked for where the motion is predicted to be.
  static TargetNeed targetNeed() { return TargetNeed::kEverywhere; }

  bool predict = true;
  double reached_deg = 0.2;
  double reached_mm = 1;
  double max_std_mm = 8;
  double max_std_deg = 3;
  PathPlanSettings plan;
  MotionPredictorSettings motion;

  void visit(SettingsVisitor& v) {
    v.flag("predict", predict, "The motion is predicted; without, the patient is taken to stay as seen last");
    v.number("reached_deg", reached_deg, 1e-4, 10, "The view is kept while the beam is as near as this");
    v.number("reached_mm", reached_mm, 1e-3, 100, "The view is kept while the target is as near as this");
    v.number("max_std_mm", max_std_mm, 1e-3, 1000,
             "Standard deviation of the target's predicted place in its worst direction, beyond which the task holds");
    v.number("max_std_deg", max_std_deg, 1e-3, 90,
             "Standard deviation of the predicted rotation, beyond which the task holds");
    plan.visit(v);
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
  }
};

/// Find the target's depth by a small turn of the arm, when one view leaves it open: see GatedPerception::resolveDepth.
struct ResolveDepthTaskSettings {
  static constexpr const char* kName = "resolve_depth";
  static constexpr bool kPatientMoves = true;  ///< Frames are looked for where the motion is predicted to be.
  static TargetNeed targetNeed() { return TargetNeed::kResolvingDepth; }

  double max_std_mm = 3;
  double max_turn_deg = 6;
  bool first = false;
  static constexpr double speed_deg_per_s = 6;
  static constexpr double watch_s = 4;  ///< Before the turn, standing: a breath, of which way and size are then known.

  void visit(SettingsVisitor& v) {
    v.number("max_std_mm", max_std_mm, 1e-3, 1000,
             "Standard deviation of the target in its worst direction, from which on its depth is known");
    v.number("max_turn_deg", max_turn_deg, 1, 6, "Largest turn of the primary angle, in all");
    v.flag("first", first, "Depth is resolved before view or hold, whenever those have to know it and it is open");
  }
};

}  // namespace angio::servo
