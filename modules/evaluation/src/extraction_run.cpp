// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/extraction_run.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/imaging/device_history.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/results/experiment.hpp"
#include "angio/vessel/projection.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::evaluation {
namespace {

// Edges of a tree that is drawn into an image are no longer than this: a pixel or so.
constexpr double kDrawnEdge_m = 0.25e-3;
constexpr int kMaxDrawnPoints = 200000;

cv::Mat maskOf(const AnnotatedImage& annotated) {
  cv::Mat mask = cv::Mat::zeros(annotated.height_px, annotated.width_px, CV_8U);
  for (const auto& polygon : annotated.polygons_px) {
    std::vector<cv::Point> corners;
    for (const auto& p : polygon) corners.emplace_back(cvRound(p.x()), cvRound(p.y()));
    cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{corners}, 255);
  }
  return mask;
}

// Standard deviation of a simulated image's blur about the isocentre: the detector's light, the focal spot behind the
// patient, and a pixel's own square [px].
double blurOf_px(const SimulationSettings& settings, const XrayCamera& camera) {
  constexpr double kSigmaOfWidth = 0.4247;          // Of a normal curve of full width 1 at half height.
  constexpr double kUsualDetectorDistance_m = 1.1;  // As the renderer takes it.
  const DetectorSettings& detector = settings.fluoroscopy.detector;
  const XrayCamera::Parameters& p = camera.parameters();
  const double spacing_mm =
      1e3 * p.pixel_spacing_m.value_or(p.source_detector_distance_m.value_or(kUsualDetectorDistance_m) / p.fx_px);
  const double behind = std::max(0.0, spacing_mm * p.fx_px / settings.source_isocenter_mm - 1);
  const double light_px = detector.psf_std_mm / spacing_mm;
  const double spot_px = kSigmaOfWidth * detector.focal_spot_mm * behind / spacing_mm;
  return std::sqrt(light_px * light_px + spot_px * spot_px + 1.0 / 12);
}

double lengthOf_px(const Centerline2d& line) {
  double length_px = 0;
  for (int i = 1; i < line.size(); ++i) {
    if (line.branch[i] == line.branch[i - 1]) length_px += (line.points_px.col(i) - line.points_px.col(i - 1)).norm();
  }
  return length_px;
}

// What one extractor leaves of one image.
struct ExtractedSample {
  ExtractionScore score;
  DeviceScore devices;
  bool scored = false;
  double time_s = 0, vessels_px = 0, devices_px = 0;
};

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, ExtractedSample>& one) {
  f("score", one.score);
  f("devices", one.devices);
  f("scored", one.scored);
  f("time_s", one.time_s);
  f("vessels_px", one.vessels_px);
  f("devices_px", one.devices_px);
}

ExtractedSample scored(const Centerline2d& found, const ExtractionSample& sample, double tolerance_px) {
  ExtractedSample one{ExtractionScore(tolerance_px),
                      {},
                      sample.has_truth,
                      0,
                      lengthOf_px(ofKind(found, CurveKind::kVessel)),
                      lengthOf_px(ofKind(found, CurveKind::kDevice))};
  if (!sample.has_truth) return one;
  if (sample.shown.size() > 0) one.devices.add(found, sample.shown, tolerance_px);
  if (sample.mask.empty()) {
    one.score.add(found, sample.required, sample.allowed, sample.own_line);
  } else {
    one.score.addMask(found, sample.mask);
  }
  return one;
}

// What is found in a sample, and in what time [s].
struct Extracted {
  Centerline2d found;
  double time_s = 0;
};

Extracted extractedAlone(const ExtractionSample& sample, CenterlineExtractor& extractor) {
  const Stopwatch stage;
  Centerline2d found = extractor.extract(sample.image, sample.expected);
  return {std::move(found), stage.seconds()};
}

Extracted extractedInRun(const ExtractionSample& sample, CenterlineExtractor& extractor) {
  const double side_px = std::min(sample.image.cols, sample.image.rows);
  const ExtractionSample::Run& run = *sample.run;
  DeviceHistory history;
  std::vector<Centerline2d> found;
  for (int k = 0; k < run.index; ++k) found.push_back(history.named(extractor.extract(run.frame(k)), side_px));
  const Stopwatch stage;
  found.push_back(history.named(extractor.extract(sample.image), side_px));
  const double time_s = stage.seconds();
  if (history.knowsVessels() || !run.looks_ahead) return {found.back(), time_s};
  for (int k = run.index + 1; k < run.count && !history.knowsVessels(); ++k) {
    found.push_back(history.named(extractor.extract(run.frame(k)), side_px));
  }
  if (!history.knowsVessels()) {
    found = DeviceHistory::namedFromEnd(std::move(found), side_px);
    return {found[static_cast<std::size_t>(run.index)], time_s};
  }
  return {history.namedAgain({found.begin() + run.index, found.end() - 1}, side_px).front(), time_s};
}

}  // namespace

ExtractionSamples simulatedSamples(const std::vector<VesselTree>& trees, const std::optional<XrayCamera>& camera,
                                   const SimulationSettings& settings, const SimulatedVessels& wanted_vessels) {
  if (trees.empty()) throw InputError("simulation", "trees", "0", "must be at least one");
  const auto images = std::make_shared<TrialImages>(trees, settings);
  const auto one = [=](int i) {
    const std::size_t t = static_cast<std::size_t>(i) % trees.size();
    const SimulatedTrial trial = simulatedTrial(trees[t], camera, settings, i);
    TrialTruth truth = images->truth(trial, t, 0);
    const double mm_per_px = settings.source_isocenter_mm / trial.true_views.front().camera.parameters().fx_px;
    const Centerline2d vessels = ofKind(truth.visible, CurveKind::kVessel);
    const std::vector<bool> lost = lostInAWider(vessels);
    std::vector<bool> wanted;
    for (int k = 0; k < vessels.size(); ++k) {
      const double diameter_mm = 2 * mm_per_px * vessels.radius_px[k];
      wanted.push_back(diameter_mm >= wanted_vessels.thinnest_mm && diameter_mm <= wanted_vessels.thickest_mm &&
                       !lost[k]);
    }
    std::vector<bool> own_line = haveOwnLine(truth.all, blurOf_px(settings, trial.true_views.front().camera));
    return ExtractionSample{"simulated " + std::to_string(i),
                            images->render(trial, t, 0, i),
                            pointsWhere(vessels, wanted),
                            std::move(truth.all),
                            {},
                            std::move(own_line),
                            wanted_vessels.expected
                                ? projectedCenterline(trees[t], trial.true_views.front().camera, trial.start)
                                : Centerline2d()};
  };
  return {settings.trials, one};
}

ExtractionSamples caseSamples(const CaseSet& set, double radius_px, double contrast) {
  for (const Case& one : set.cases) {
    if (!one.views.front().image_path) throw InputError("case " + one.name, "image", "", "is missing");
    if (!one.truth_pose) throw InputError("case " + one.name, "truth_pose", "", "is missing");
  }
  const auto sample = [=](int i) {
    const Case& one = set.cases[i];
    const View& view = one.views.front();
    const VesselTree tree = resampled(readVesselTree(one.tree_path), kDrawnEdge_m, kMaxDrawnPoints).tree;
    ExtractionSample result;
    result.name = one.name;
    result.image = readXrayImage(*view.image_path, view.camera);
    result.allowed = projectedCenterline(tree, view.camera, *one.truth_pose);
    result.required = shownIn(result.image, result.allowed, radius_px, contrast);
    return result;
  };
  return {static_cast<int>(set.cases.size()), sample};
}

ExtractionSamples annotatedSamples(const std::vector<AnnotatedImage>& images) {
  const auto sample = [=](int i) {
    const AnnotatedImage& annotated = images[i];
    ExtractionSample result;
    result.name = std::filesystem::path(annotated.image_path).stem().string();
    result.image = readXrayImage(annotated.image_path);
    result.mask = maskOf(annotated);
    if (result.image.size() != result.mask.size()) {
      throw InputError(annotated.image_path, "size",
                       std::to_string(result.image.cols) + " x " + std::to_string(result.image.rows),
                       "must be that of the annotations");
    }
    return result;
  };
  return {static_cast<int>(images.size()), sample};
}

ExtractionSamples imageSamples(const std::vector<std::string>& paths) {
  const auto sample = [=](int i) {
    const std::string& path = paths[i];
    ExtractionSample result;
    result.name = std::filesystem::path(path).stem().string();
    result.image = readXrayImage(path);
    result.has_truth = false;
    return result;
  };
  return {static_cast<int>(paths.size()), sample};
}

std::vector<ExtractionRun> runExtraction(const ExtractionSamples& samples,
                                         const std::vector<ExtractionEntrant>& entrants, double tolerance_px,
                                         Pictures pictures, const std::function<void(int done)>& progress,
                                         Campaign* campaign) {
  std::vector<ExtractionRun> runs;
  std::vector<std::unique_ptr<CenterlineExtractor>> extractors;
  for (const auto& entrant : entrants) {
    runs.push_back({entrant.name, ExtractionScore(tolerance_px), {}, 0, {}, {}, {}, {}});
    extractors.push_back(makeExtractor(entrant.settings));
  }
  int done = 0;
  const auto one = [&](int i) {
    const ExtractionSample sample = samples.at(i);
    std::vector<ExtractedSample> extracted(entrants.size());
    for (std::size_t turn = 0; turn < entrants.size(); ++turn) {
      const std::size_t m = (static_cast<std::size_t>(i) + turn) % entrants.size();
      const auto [found, time_s] =
          sample.run ? extractedInRun(sample, *extractors[m]) : extractedAlone(sample, *extractors[m]);
      extracted[m] = scored(found, sample, tolerance_px);
      extracted[m].time_s = time_s;
      if (pictures == Pictures::kKeep) runs[m].pictures.push_back({sample.image, found, sample.name});
      if (progress) progress(++done);
    }
    return extracted;
  };
  constexpr int kThreads = 1;  // Times of one run can be compared.
  const auto all = recordsOf(
      campaign, samples.count, kThreads, [](int i) { return "image " + std::to_string(i); }, one);
  for (const auto& of_image : all) {
    if (of_image.size() != entrants.size()) throw InputError("images", "", "", "must have a score of each extractor");
    for (std::size_t m = 0; m < entrants.size(); ++m) {
      runs[m].score.add(of_image[m].score);
      runs[m].device_score.add(of_image[m].devices);
      runs[m].scored += of_image[m].scored;
      runs[m].times_s.push_back(of_image[m].time_s);
      runs[m].vessels_px.push_back(of_image[m].vessels_px);
      runs[m].devices_px.push_back(of_image[m].devices_px);
    }
  }
  return runs;
}

Json extractionSummaries(const std::vector<ExtractionRun>& runs) {
  Json json;
  for (const auto& run : runs) {
    Json times_ms = Json::array();
    for (const double time_s : run.times_s) times_ms.push_back(1e3 * time_s);
    if (run.scored > 0) json[run.name] = run.score.asJson();
    if (run.device_score.any()) json[run.name]["devices"] = run.device_score.asJson();
    json[run.name]["images"] = run.times_s.size();
    json[run.name]["images_with_truth"] = run.scored;
    json[run.name]["vessels_px"] = figuresOf(Json(run.vessels_px), "mean");
    json[run.name]["devices_px"] = figuresOf(Json(run.devices_px), "mean");
    json[run.name]["time_ms"] = figuresOf(times_ms, "p50 p99");
  }
  return json;
}

std::string extractionTable(const Json& summaries) {
  const bool scored = std::any_of(summaries.begin(), summaries.end(),
                                  [](const Json& summary) { return summary.at("images_with_truth") > 0; });
  if (!scored) {
    return "There is no truth to these images: nothing is scored.\n\n" +
           figureTable(summaries, {{"extractor", ""},
                                   {"images", "{images:%d}"},
                                   {"vessels found, mean", "{vessels_px:%.0f px}"},
                                   {"devices found, mean", "{devices_px:%.0f px}"},
                                   {"ms p50", "{time_ms/p50:%.1f}"},
                                   {"p99", "{time_ms/p99:%.1f}"}});
  }
  const bool devices =
      std::any_of(summaries.begin(), summaries.end(), [](const Json& summary) { return summary.contains("devices"); });
  if (devices) {
    return figureTable(summaries, {{"extractor", ""},
                                   {"frames that show a device", "{devices/frames:%d}"},
                                   {"named in", "{100*devices/named:%.0f %%}"},
                                   {"of its length told", "{100*devices/told:%.1f %%}"},
                                   {"taken for a vessel", "{100*devices/taken_for_vessel:%.1f %%}"},
                                   {"of vessels called a device", "{100*devices/vessels_called_device:%.2f %%}"},
                                   {"all covered", "{100*covered:%.1f %%}"},
                                   {"found is right", "{100*correct:%.1f %%}"},
                                   {"ms p50", "{time_ms/p50:%.1f}"}});
  }
  return figureTable(summaries, {{"extractor", ""},
                                 {"images", "{images:%d}"},
                                 {"truth covered", "{100*covered:%.1f %%}"},
                                 {"found is right", "{100*correct:%.1f %%}"},
                                 {"truth with a line of its own", "{100*own_line_part:%.1f %%}"},
                                 {"covered", "{100*own_line_covered:%.1f %%}"},
                                 {"right", "{100*own_line_correct:%.1f %%}"},
                                 {"median error", "{median_error_px:%.2f px}"},
                                 {"tangent", "{median_tangent_error_deg:%.1f deg}"},
                                 {"error / sigma", "{error_over_sigma:%.2f}"},
                                 {"all points, median", "{median_distance_px:%.2f px}"},
                                 {"ms p50", "{time_ms/p50:%.1f}"},
                                 {"p99", "{time_ms/p99:%.1f}"}});
}

}  // namespace angio::evaluation
