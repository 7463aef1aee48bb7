// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/evaluation/catheter_runs.hpp"
#include "angio/io/case_files.hpp"
#include "angio/localisation/sequence_localiser.hpp"
#include "angio/results/campaign.hpp"

namespace angio::apps {

/// One frame as one way of looking at the sequence sees it.
struct Located {
  TipBelief belief;
  Pose T_camera_model = Pose::Identity();
  double time_s = 0;  ///< Of this frame alone, where frames come one by one.
};

/// One way of looking at a sequence.
struct CatheterRoute {
  std::string name;
  std::vector<Located> frames;
  VesselTree tree;           ///< As displaced.
  std::vector<bool> learnt;  ///< Frames that pose and displacements were learnt from.
};

/// The settings file of `angio-evaluate catheter`.
struct CatheterSequenceSettings {
  SequenceSettings sequence;
  SeenCatheterSettings catheter;

  void visit(SettingsVisitor& v) {
    v.section("sequence", [&](SettingsVisitor& inner) { sequence.visit(inner); });
    v.section("catheter", [&](SettingsVisitor& inner) { catheter.visit(inner); });
  }
};

/// How the frames of a sequence are searched for a catheter's tip.
struct CatheterSequenceAsked {
  CatheterSequenceSettings settings;
  double period_s = 0.5;         ///< From frame to frame.
  int learn_frames = 1;          ///< Of the run frame by frame: these come first, to learn the pose from.
  bool rigid = false;            ///< The vessels are where the tree has them, but for one pose.
  Campaign* campaign = nullptr;  ///< As CaseRunSettings has it; each way of looking is a run.

  /// The settings that are in force.
  CatheterSequenceSettings inForce() const;
};

/// Ways of looking at a sequence: all frames at once; one by one, learnt from the first; from every second.
constexpr int kCatheterWays = 3;

/// The catheter in each frame of a case set, with the frame's pose. Throws InputError for a case without the curve of
/// one, or of another tree than the first.
std::vector<SequenceFrame> catheterFrames(const CaseSet& set, const CatheterSequenceAsked& asked);

/// Locates the tip in each frame in each way: {"ways": {name: {"cases": ..., "summary": ...}}, "settings": ...}. After
/// an interruption the ways that are finished.
///
/// `look_on` is called with each way as it is found; `progress` with how many there are so far.
Json catheterSequenceResults(const CaseSet& set, const CatheterSequenceAsked& asked,
                             const std::function<void(int way, const CatheterRoute& route)>& look_on = {},
                             const Progress& progress = {});

/// Which simulated runs of catheters are made.
struct CatheterRunsAsked {
  std::vector<std::string> trees;  ///< Paths; runs take turns.
  int runs = 20;
  CatheterRunSettings run;
  Campaign* campaign = nullptr;  ///< As CaseRunSettings has it.
};

/// Registers trees by a simulated catheter that is pushed on in them: {"runs": [{"tree": ..., "frames": ...}],
/// "summary": ...}. After an interruption the runs that are finished. Throws InputError when there is no tree or no
/// run, or a setting is out of its range.
Json catheterRunsResults(const CatheterRunsAsked& asked, const Progress& progress = {});

}  // namespace angio::apps
