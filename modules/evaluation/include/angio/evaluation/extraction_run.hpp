// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "angio/evaluation/device_score.hpp"
#include "angio/evaluation/simulation.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/polygon_files.hpp"
#include "angio/results/campaign.hpp"
#include "angio/results/overlay.hpp"
#include "angio/results/statistics.hpp"
#include "angio/simulation/patient_settings.hpp"

namespace angio::evaluation {

/// The shadow of a vessel across its axis: its radius [px] and its absorption through the axis.
struct ShadowProfile {
  double radius_px = 1;
  double contrast = 0;
};

/// Whether the sum of two parallel vessels' shadows has a minimum between their axes. Without one there is a single
/// line to be seen: Sparrow's limit (Sparrow, On spectroscopic resolving power, Astrophys J 44, 1916), 2 sigma for
/// equal normal curves. Shadows are a circle's chords under a blur of standard deviation `blur_px`; no noise.
bool resolved(const ShadowProfile& one, const ShadowProfile& other, double apart_px, double blur_px);

/// For each point of the projected vessels of a frame (with branch, radius and contrast) whether it has a line of its
/// own there: false where another branch runs along within Sparrow's limit and the one line that both cast lies nearer
/// to that one's axis. The nearer axis keeps the line, both do where it lies in the middle. Branches that meet at more
/// than 30 degrees are taken for resolved: either is seen on both sides of the other. Looks at the truth alone, so that
/// it is the same for every extractor. Throws InputError where radius or contrast is missing.
std::vector<bool> haveOwnLine(const Centerline2d& vessels, double blur_px);

/// Which points lie in the shadow of a wider vessel, as a branch does before it leaves its trunk: there is no line of
/// their own to be seen there.
std::vector<bool> lostInAWider(const Centerline2d& vessels);

/// How well extracted centrelines are the true ones, over one image or many. Shares are of length: lines are counted
/// every pixel.
class ExtractionScore {
 public:
  /// Within `tolerance_px` of each other a true and an extracted line are the same.
  explicit ExtractionScore(double tolerance_px = 0) : tolerance_px_(tolerance_px) {}

  /// Adds an image. What must be found may be less than what may be: `required` is what the image shows, `allowed` all
  /// that is there. `own_line` (a flag for each allowed point, or empty) says which of that has a line of its own
  /// (haveOwnLine): it is counted apart as well.
  void add(const Centerline2d& found, const Centerline2d& required, const Centerline2d& allowed,
           const std::vector<bool>& own_line = {});
  void add(const Centerline2d& found, const Centerline2d& truth) { add(found, truth, truth); }

  /// Adds the images of another score of the same tolerance.
  void add(const ExtractionScore& other);

  /// Adds an image whose truth is a mask (CV_8UC1, zero is background): what lies within the tolerance of it is right,
  /// and its regions' thinned lines are to be found.
  void addMask(const Centerline2d& found, const cv::Mat& mask);

  /// Of what must be found, how much is ("covered"), and of what was found, how much may be ("correct"). The same
  /// without what two vessels that run as one line cast ("own_line_covered", "own_line_correct"), of images whose own
  /// lines are known: required points without a line of their own, and found ones that lie nearest to such a truth and
  /// within its vessel; and how much of what must be found has a line of its own ("own_line_part"). Of the extracted
  /// points within the tolerance the medians of the distance to the true line and of the angle between the two, of all
  /// of them the median distance, and the root mean square of error over the uncertainty that a point claims
  /// ("error_over_sigma", where one claimed any): 1 when it is right.
  Json asJson() const;

  template <typename Fields>
  friend void visitRow(Fields& f, RecordOf<Fields, ExtractionScore>& score) {
    f("tolerance_px", score.tolerance_px_);
    f("covered", score.covered_);
    f("required", score.required_);
    f("correct", score.correct_);
    f("found", score.found_);
    f("own_covered", score.own_covered_);
    f("own_required", score.own_required_);
    f("own_correct", score.own_correct_);
    f("own_found", score.own_found_);
    f("scored_required", score.scored_required_);
    f("errors_px", score.errors_px_);
    f("tangent_errors_rad", score.tangent_errors_rad_);
    f("distances_px", score.distances_px_);
    f("squared_ratios", score.squared_ratios_);
    f("ratios", score.ratios_);
  }

 private:
  double tolerance_px_;
  double covered_ = 0, required_ = 0, correct_ = 0, found_ = 0;
  double own_covered_ = 0, own_required_ = 0, own_correct_ = 0, own_found_ = 0, scored_required_ = 0;
  std::vector<double> errors_px_, tangent_errors_rad_, distances_px_;
  double squared_ratios_ = 0;
  int ratios_ = 0;
};

/// The part of a projected centreline that an image shows: where it is darker than both of its sides by at least
/// `contrast` (natural logarithm) over some pixels of its length. Looks at the image only, so that it is the same for
/// every extractor. `radius_px` is that of the vessels; the projection may be off by as much.
Centerline2d shownIn(const cv::Mat& image, const Centerline2d& projected, double radius_px, double contrast);

/// An X-ray image and what is to be found in it.
struct ExtractionSample {
  std::string name;
  cv::Mat image;
  Centerline2d required;       ///< What must be found,
  Centerline2d allowed;        ///< and what may be; or, in their place:
  cv::Mat mask;                ///< the regions that people have drawn, CV_8UC1; empty when there are none.
  std::vector<bool> own_line;  ///< Of what may be: whether it has a line of its own (haveOwnLine); empty: not known.
  /// Where a tracker expects the vessels; empty: it is not known.
  Centerline2d expected = {};
  /// What the image shows of vessels and devices, by kind; empty: whether devices are told from vessels is not scored.
  Centerline2d shown = {};
  bool has_truth = true;  ///< False: nobody knows what is to be found, and nothing is scored.
  /// The other frames of its run: from number 0 on, without its own, `index`, up to `count`; none: the image stands
  /// alone. If the run `looks_ahead`, those after it are looked at until contrast agent arrives, or all of them.
  struct Run {
    int index = 0, count = 0;
    bool looks_ahead = false;
    std::function<cv::Mat(int frame)> frame;
  };
  std::optional<Run> run = {};
};

/// Images that are made or read when they are asked for.
struct ExtractionSamples {
  int count = 0;
  std::function<ExtractionSample(int index)> at;
};

/// What of a simulated view must be found, and what is known of it before.
struct SimulatedVessels {
  double thinnest_mm = 1, thickest_mm = 6;  ///< Widths that must be found.
  bool expected = false;                    ///< Where the trial's start has the tree, vessels are expected.
};

/// Rendered views of trees as in simulated trials (SimulationSettings), one tree after the other. Vessels that are
/// `thinnest_mm` to `thickest_mm` wide, visible at the dose and not in the shadow of a wider vessel must be found; all
/// others with contrast agent in them, and devices, may be.
ExtractionSamples simulatedSamples(const std::vector<VesselTree>& trees, const std::optional<XrayCamera>& camera,
                                   const SimulationSettings& settings, const SimulatedVessels& vessels);

/// The runs that frames with a device are of.
struct DeviceRuns {
  DeviceKind device = DeviceKind::kCatheter;
  double frames_per_s = 0;   ///< Of the frames from the run's beginning on, which are seen first; 0: none is.
  bool looks_ahead = false;  ///< The run is known as a whole, to 5 s, as a file is.
  double breath_mm = 0;      ///< How far the diaphragm comes down.
  double from_s = 0;         ///< When the first frame is taken; the injection begins at 0.3 s.
};

/// Rendered frames of an injection of two seconds into trees with a device in them: its tip in a branch, and the time
/// from before the injection until 3 s after it, are drawn. All that can be seen must be found; a device hides where it
/// lies in a vessel that absorbs more.
ExtractionSamples deviceSamples(const std::vector<VesselTree>& trees, const std::optional<XrayCamera>& camera,
                                const SimulationSettings& settings, const DeviceRuns& runs);

/// What the images of a case set show of its trees at their true poses. What must be found is what the image itself
/// shows of it (shownIn, with `radius_px` and `contrast`). Throws InputError for a case without image or true pose.
ExtractionSamples caseSamples(const CaseSet& set, double radius_px, double contrast);

/// Images with regions drawn by people.
ExtractionSamples annotatedSamples(const std::vector<AnnotatedImage>& images);

/// Images without a truth: nothing is scored.
ExtractionSamples imageSamples(const std::vector<std::string>& paths);

/// An extractor as it takes part, under the name it has in results.
struct ExtractionEntrant {
  std::string name;
  ExtractorSettings settings;
};

/// One entrant's score over all samples that have a truth, its times, and what it saw.
struct ExtractionRun {
  std::string name;
  ExtractionScore score;
  DeviceScore device_score;
  int scored = 0;                                       ///< Samples that have a truth.
  std::vector<double> times_s, vessels_px, devices_px;  ///< Of each sample; lengths of what was found.
  std::vector<SheetPicture> pictures;
};

enum class Pictures { kNone, kKeep };

/// Lets every entrant extract from every image; they take turns at being the first. `progress` counts extractions.
/// Rows of a `campaign` have no pictures.
std::vector<ExtractionRun> runExtraction(const ExtractionSamples& samples,
                                         const std::vector<ExtractionEntrant>& entrants, double tolerance_px,
                                         Pictures pictures, const std::function<void(int done)>& progress = {},
                                         Campaign* campaign = nullptr);

/// Scores, lengths and times by entrant, for other programs and for people (Markdown). Where no image has a truth there
/// are no scores.
Json extractionSummaries(const std::vector<ExtractionRun>& runs);
std::string extractionTable(const Json& summary_by_entrant);

}  // namespace angio::evaluation
