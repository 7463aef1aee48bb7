// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/evaluation/extraction_score.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/evaluation/simulation.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/polygon_files.hpp"

namespace angio::evaluation {

/// An X-ray image and what is to be found in it.
struct ExtractionSample {
  std::string name;
  cv::Mat image;
  Centerline2d required;       ///< What must be found,
  Centerline2d allowed;        ///< and what may be; or, in their place:
  cv::Mat mask;                ///< the regions that people have drawn, CV_8UC1; empty when there are none.
  std::vector<bool> own_line;  ///< Of what may be: whether it has a line of its own (haveOwnLine); empty: not known.
};

/// Images that are made or read when they are asked for.
struct ExtractionSamples {
  int count = 0;
  std::function<ExtractionSample(int index)> at;
};

/// Rendered views of trees as in simulated trials (SimulationSettings), one tree after the other. Vessels that are
/// `thinnest_mm` to `thickest_mm` wide, visible at the dose and not in the shadow of a wider vessel must be found; all
/// others, and devices, may be.
ExtractionSamples simulatedSamples(const std::vector<VesselTree>& trees, const std::optional<XrayCamera>& camera,
                                   const SimulationSettings& settings, double thinnest_mm, double thickest_mm);

/// What the images of a case set show of its trees at their true poses. What must be found is what the image itself
/// shows of it (shownIn, with `radius_px` and `contrast`). Throws InputError for a case without image or true pose.
ExtractionSamples caseSamples(const CaseSet& set, double radius_px, double contrast);

/// Images with regions drawn by people.
ExtractionSamples annotatedSamples(const std::vector<AnnotatedImage>& images);

/// Images without a truth: nothing must be found, and nothing is right.
ExtractionSamples imageSamples(const std::vector<std::string>& paths);

/// An extractor as it takes part, under the name it has in results.
struct ExtractionEntrant {
  std::string name;
  ExtractorSettings settings;
};

/// One entrant's score over all samples, its times, and what it saw.
struct ExtractionRun {
  std::string name;
  ExtractionScore score;
  std::vector<double> times_s;
  std::vector<SheetPicture> pictures;
};

enum class Pictures { kNone, kKeep };

/// Lets every entrant extract from every image; they take turns at being the first. `progress` counts extractions.
std::vector<ExtractionRun> runExtraction(const ExtractionSamples& samples,
                                         const std::vector<ExtractionEntrant>& entrants, double tolerance_px,
                                         Pictures pictures, const std::function<void(int done)>& progress = {});

/// Scores and times by entrant, for other programs and for people (Markdown).
nlohmann::ordered_json extractionSummaries(const std::vector<ExtractionRun>& runs);
std::string extractionTable(const nlohmann::ordered_json& summary_by_entrant);

}  // namespace angio::evaluation
