// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/evaluation/simulation_run.hpp"
#include "angio/io/case_files.hpp"

namespace angio::evaluation {

// Table II of the Iterative PnP paper is of 278 in-vivo frames that are not public. Its analogue is of public ones.

/// Cases that methods are compared on, each by itself: no frame starts from another one's result.
struct RealCases {
  std::string name;  ///< "static phantom, from images".
  CaseSet set;
  bool has_images = false;  ///< Whether methods that look at the image can run.
};

/// Each case of `set` `count` times, from draws about its reference pose: a turn and a shift about the tree's centroid,
/// standard deviations per axis. Cases are named "im1, 3". The same for one seed. Throws InputError when a case has no
/// reference.
CaseSet withDrawnStarts(const CaseSet& set, double rotation_std_deg, double translation_std_mm, int count, int seed);

/// The set without the centrelines of its files: an extractor finds them in its images.
CaseSet seenByImages(CaseSet set);

/// What became of one set: methods that cannot run on it are left out.
struct RealRuns {
  std::string name;
  std::vector<EntrantRun> runs;
};

/// The entrants that can run on a set: not those that look at the image where it has none.
std::vector<Entrant> ableToRun(const RealCases& cases, const std::vector<Entrant>& entrants);

/// Runs every entrant that can on every case of a set. `progress` counts registrations.
RealRuns runRealCases(const RealCases& cases, const std::vector<Entrant>& entrants, const ExtractorSettings& extractor,
                      const Progress& progress = {}, Campaign* campaign = nullptr);

/// {"paper": {method: figures}, "here": [{"name": ..., "methods": {method: figures}}]}.
Json paperTable2AsJson(const std::vector<RealRuns>& all);

/// Of that, the paper's rows above ours, Markdown, with what the comparison cannot say.
std::string paperTable2(const Json& table2);

}  // namespace angio::evaluation
