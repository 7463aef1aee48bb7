// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/simulation_run.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/evaluation/paper.hpp"
#include "angio/perception/gated_perception.hpp"
#include "angio/results/case_row.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"
#include "simulation_claims.hpp"

namespace angio::evaluation {
namespace {

using O = const CaseOutcome&;

constexpr double kGrossFailure_mm = 5;

// The newest frame of a sequence, as a loop that has tracked the ones before sees it.
RegistrationResult resultOfSequence(const Entrant& entrant, const VesselTree& tree, const SimulatedTrial& trial,
                                    const SimulationSettings& settings, CaseOutcome& outcome) {
  GatedPerceptionSettings tracked;
  tracked.perception.search = tracked.perception.tracking = entrant.registration;
  tracked.perception.search_starts = entrant.starts;
  tracked.perception.tracker.follow_motion = true;
  tracked.perception.tracker.calibration_rotation_std_deg = settings.rotation_std_deg;
  tracked.perception.tracker.calibration_translation_std_mm = settings.translation_std_mm;
  tracked.perception.tracker.max_deformation_mm = 2 * std::max(2.0, settings.deformation_rms_mm);
  tracked.need = TargetNeed::kResolvingDepth;
  // The patient's frame is the newest camera's; calibration has the model where the trial starts.
  tracked.T_dsa_cb = trial.start;
  GatedPerception perception(tracked, tree);
  GatedObservation seen;
  const XrayViews views = trial.views();
  for (std::size_t f = 0; f < views.size(); ++f) {
    const CameraPlace place{std::llround(1e6 * trial.times_s[f]), views[f].T_view_first};
    seen = perception.observe({XrayView{views[f].centerline, views[f].camera}}, place);
    perception.learn();
  }
  outcome.rejection = seen.rejection;
  outcome.followed = !seen.rejection;
  const Stopwatch stage;
  perception.resolveDepth();
  const auto& resolved = perception.resolved();
  if (!resolved || !resolved->T_camera_patient.isApprox(views.back().T_view_first)) {
    return seen.observation.registration;
  }
  RegistrationResult result = resolved->fit.registration;
  result.times.total_s = stage.seconds();
  return result;
}

// `images` are those of the views; none where no method needs them.
CaseOutcome outcomeOf(Registration& registration, const Entrant& entrant, const SimulatedTrial& trial,
                      const std::vector<cv::Mat>& images, const SimulationSettings& settings) {
  const VesselTree& tree = registration.tree();
  CaseOutcome outcome;
  if (trial.times_s.empty()) {
    XrayViews views = trial.views();
    for (std::size_t v = 0; v < images.size(); ++v) views[v].image = &images[v];
    outcome.result = registration.search(views, {trial.start, {}}, entrant.starts);
  } else {
    outcome.result = resultOfSequence(entrant, tree, trial, settings, outcome);
  }
  const PlacedTree truth{trial.truth, trial.displacements_m};
  const XrayCamera& camera = trial.cameras.front();
  outcome.pixel_at_isocenter_m = (trial.truth * tree.centroid()).z() / camera.parameters().fx_px;
  outcome.start_error = poseError(tree, camera, {trial.start, {}}, truth);
  outcome.error = poseError(tree, camera, {outcome.result.T_camera_model, outcome.result.displacements_m}, truth);
  if (trial.times_s.empty()) {  // Of a sequence the tree has moved since the first view.
    Eigen::Matrix3Xd points = tree.points();
    if (outcome.result.displacements_m.cols() == points.cols()) points += outcome.result.displacements_m;
    outcome.projection_residual_px =
        projectionResidual_px(points, outcome.result.T_camera_model, trial.views().front());
  }
  outcome.claim = claimOf(tree, outcome.result, trial);
  return outcome;
}

void certifyOutcome(const VesselTree& tree, const SimulatedTrial& trial, const CertificateSettings& settings,
                    CaseOutcome& outcome) {
  const Pose& found = outcome.result.T_camera_model;
  outcome.certificate = certify(tree, trial.views().front(), trial.start, found, settings);
  outcome.certificate_false =
      outcome.certificate->proven && 1e3 * poseDistance_m(tree, found, trial.truth) > settings.distance_mm;
}

bool trialSucceeded(O o) { return o.error && o.error->mtre_m < kSuccessMtre_m; }

// Beside summaryOf's, of trials with their truth.
std::vector<Column<CaseOutcome>> trialColumns() {
  return {
      {"", "start_mtre_mm", kSpread, [](O o) { return 1e3 * o.start_error->mtre_m; }},
      {"", "gfr_true_isocentre_5mm_percent", "percent",
       [](O o) { return !(o.error->mpd_isocenter_m && 1e3 * *o.error->mpd_isocenter_m <= kGrossFailure_mm); }},
      {"", "gfr_nearest_isocentre_5mm_percent", "percent",
       [](O o) { return !(1e3 * o.pixel_at_isocenter_m * o.result.alignment.model_residual_px <= kGrossFailure_mm); }},
      {"", "converged_percent", "percent", isConverged},
      {"", "converged_and_wrong_percent", "percent", isConvergedAndWrong},
      {"", "depth_in_90_percent", kSpread, [](O o) { return o.claim ? Json(100 * o.claim->depth_in) : Json(nullptr); }},
      {"", "plane_in_90_percent", kSpread, [](O o) { return o.claim ? Json(100 * o.claim->plane_in) : Json(nullptr); }},
      {"", "claimed_spread_mm", kSpread,
       [](O o) { return o.result.spread ? Json(1e3 * o.result.spread->all_m) : Json(nullptr); }},
      {"", "in_plane_below_2mm_percent", "percent", [](O o) { return o.error->in_plane_m < kSuccessMtre_m; }}};
}

// Whether claims hold where fits are poor; empty where there are too few trials.
std::string quarterTable(const Json& summaries) {
  const auto lacks = [](const Json& summary) { return summary["claims_by_quarter"].is_null(); };
  if (std::any_of(summaries.begin(), summaries.end(), lacks)) return "";
  const auto cell = [](const std::string& name, const std::string& format) {
    std::string text;
    for (const char* quarter : {"0", "1", "2", "3"}) {
      if (!text.empty()) text += " / ";
      text += "{claims_by_quarter/" + std::string(quarter) + "/" + name + ":" + format + "}";
    }
    return text;
  };
  const std::string wrong = cell("converged_and_wrong_percent", "%.1f %%"),
                    depth = cell("depth_in_90_percent", "%.0f %%"), plane = cell("plane_in_90_percent", "%.0f %%");
  return "\n" + figureTable(summaries, {{"in quarters, best score first", ""},
                                        {"converged and wrong", wrong.c_str()},
                                        {"depth in its 90 %", depth.c_str()},
                                        {"in-plane in its 90 %", plane.c_str()}});
}

// Of trials that other programs ran: one outcome for each entrant, against the truth.
void requireOutcomes(const SimulationSetup& setup, const std::vector<CaseOutcome>& outcomes) {
  const auto refuse = [](const std::string& name, const char* rule) {
    throw InputError("trial " + name, "", "", rule);
  };
  if (outcomes.size() != setup.entrants.size()) refuse("", "must have an outcome of each method");
  for (const CaseOutcome& o : outcomes) {
    if (!o.error || !o.start_error) refuse(o.name, "must have its errors");
    if (setup.certificate.has_value() != o.certificate.has_value()) refuse(o.name, "must have what was asked for");
  }
}

}  // namespace

std::vector<EntrantRun> runSimulation(const SimulationSetup& setup, const SimulationSettings& settings,
                                      const Progress& progress) {
  checkSettings("simulation", settings);
  if (setup.trees.empty()) throw InputError("simulation", "trees", "0", "must be at least one");
  if (setup.certificate && settings.views > 1) {
    throw InputError("simulation", "views", std::to_string(settings.views), "must be 1: a certificate is of one view");
  }
  const std::size_t entrants = setup.entrants.size(), trees = setup.trees.size();
  std::vector<EntrantRun> runs;
  std::vector<std::vector<std::unique_ptr<Registration>>> registrations(entrants);
  for (std::size_t m = 0; m < entrants; ++m) {
    runs.push_back({setup.entrants[m].name, {}});
    for (const auto& tree : setup.trees) {
      registrations[m].push_back(makeRegistration(setup.entrants[m].registration, tree));
    }
  }
  // Methods that look at the image have it also where the others are given the centreline as it projects.
  const bool extracts = settings.from == TrialSource::kImages;
  const bool looks = std::any_of(setup.entrants.begin(), setup.entrants.end(),
                                 [](const Entrant& entrant) { return imageNeeded(entrant.registration); });
  if (looks && settings.turn_s > 0) {
    throw InputError("simulation", "turn_s", formatValue(settings.turn_s), "must be 0: a method needs images");
  }
  std::optional<TrialImages> renderer;
  if (extracts || looks) {
    SimulationSettings rendered = settings;
    if (!extracts) rendered.noise_px = rendered.tangent_noise_deg = 0;  // Of the centreline, not of the image.
    renderer.emplace(setup.trees, rendered);
  }
  const auto extractor = makeExtractor(setup.extractor);
  int done = 0;
  const auto nameOf = [](int i) { return formatted("%04d", i); };
  const auto one = [&](int i) {
    std::vector<CaseOutcome> outcomes(entrants);
    const std::size_t t = static_cast<std::size_t>(i) % trees;
    // Each tree meets each motion.
    const std::size_t turn_of_motion = static_cast<std::size_t>(i) + static_cast<std::size_t>(i) / trees;
    const MeasuredMotion* motion =
        setup.motions.empty() ? nullptr : &setup.motions[turn_of_motion % setup.motions.size()];
    SimulatedTrial trial = simulatedTrial(setup.trees[t], setup.camera, settings, i, motion);
    double image_s = 0;
    std::vector<cv::Mat> images;
    for (std::size_t v = 0; renderer && v < trial.cameras.size(); ++v) {
      images.push_back(renderer->render(trial, t, v, i));
      if (!extracts) continue;
      const Stopwatch stage;
      trial.centerlines[v] = vesselsToMatch(extractor->extract(images.back()));
      image_s += stage.seconds();
    }
    for (std::size_t turn = 0; turn < entrants; ++turn) {
      const std::size_t m = (static_cast<std::size_t>(i) + turn) % entrants;
      outcomes[m] = outcomeOf(*registrations[m][t], setup.entrants[m], trial, images, settings);
      outcomes[m].name = nameOf(i);
      if (setup.certificate) certifyOutcome(setup.trees[t], trial, *setup.certificate, outcomes[m]);
      outcomes[m].image_s = image_s;
      if (progress) progress(++done);
    }
    return outcomes;
  };
  constexpr int kThreads = 1;  // Times of one run can be compared.
  auto trials = recordsOf(
      setup.campaign, settings.trials, kThreads, [&](int i) { return "trial " + nameOf(i); }, one);
  for (auto& outcomes : trials) {
    requireOutcomes(setup, outcomes);
    for (std::size_t m = 0; m < entrants; ++m) runs[m].outcomes.push_back(std::move(outcomes[m]));
  }
  return runs;
}

CaptureBins captureBins(const std::vector<CaseOutcome>& outcomes) {
  CaptureBins bins;
  for (const auto& o : outcomes) {
    if (!o.start_error) continue;
    const double start_mm = 1e3 * o.start_error->mtre_m;
    if (!(start_mm < CaptureBins::kBins)) continue;
    const auto b = static_cast<std::size_t>(start_mm);
    ++bins.trials[b];
    bins.successes[b] += trialSucceeded(o);
  }
  return bins;
}

// With `unbroken` only up to the first bad bin.
std::optional<double> CaptureBins::farthest_mm(bool unbroken) const {
  std::optional<double> edge_mm;
  for (int b = 0; b < kBins; ++b) {
    const int count = trials[b];
    if (count < kMinTrials) continue;
    const bool good = successes[b] >= kSuccess * count;
    if (good) edge_mm = b + 1;
    if (!good && unbroken) break;
  }
  return edge_mm;
}

ShareBounds shareBounds(int successes, int trials) {
  if (trials <= 0) return {};
  constexpr double kZ = 1.959964;  // 97.5 % of the normal distribution.
  const double n = trials, share = successes / n, z2 = kZ * kZ;
  const double middle = (share + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kZ / (1 + z2 / n) * std::sqrt(share * (1 - share) / n + z2 / (4 * n * n));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

Json simulationSummary(const std::vector<CaseOutcome>& outcomes, std::optional<double> pixel_spacing_m) {
  Json summary = summaryOf(outcomes);
  summarise(outcomes, trialColumns(), summary);
  if (pixel_spacing_m) {
    const auto detector_mm = [&](O o) {
      return o.error->mpd_px ? Json(1e3 * *pixel_spacing_m * *o.error->mpd_px) : Json(nullptr);
    };
    summarise(outcomes, {{"", "mpd_detector_mm", kSpread, detector_mm}}, summary);
  }
  if (!outcomes.empty() && outcomes.front().certificate) {
    summarise(outcomes,
              {{"", "certificate/proven_percent", "percent", [](O o) { return o.certificate->proven; }},
               {"", "certificate/false_percent", "percent", [](O o) { return o.certificate_false; }},
               {"", "certificate/seconds", "p50 p99 max", [](O o) { return o.certificate->seconds; }}},
              summary);
  }
  summary["claims_by_quarter"] = claimsByQuarter(outcomes);
  const auto successes = static_cast<int>(std::count_if(outcomes.begin(), outcomes.end(), trialSucceeded));
  const ShareBounds bounds = shareBounds(successes, static_cast<int>(outcomes.size()));
  summary["success_mtre_2mm_bounds_percent"] = {100 * bounds.low, 100 * bounds.high};
  const CaptureBins bins = captureBins(outcomes);
  summary["capture_range_mm"] = orNull(bins.range_mm());
  summary["capture_range_unbroken_mm"] = orNull(bins.unbroken_range_mm());
  summary["capture_bins_1mm"] = {{"trials", bins.trials}, {"successes", bins.successes}};
  return summary;
}

Json simulationSummaries(const std::vector<EntrantRun>& runs, std::optional<double> pixel_spacing_m,
                         const std::string& reference) {
  Json summaries = Json::object();
  for (const auto& run : runs) summaries[run.name] = simulationSummary(run.outcomes, pixel_spacing_m);
  if (runs.empty()) return summaries;
  const std::string base = summaries.contains(reference) ? reference : runs.front().name;
  const double base_ms = summaries[base]["time_ms"]["total"]["p50"];
  for (auto& summary : summaries) {
    if (base_ms > 0) {
      summary["time_p50_relative"] = {{"to", base},
                                      {"ratio", summary["time_ms"]["total"]["p50"].get<double>() / base_ms}};
    }
  }
  return summaries;
}

std::string simulationTable(const Json& summaries) {
  const std::string start = "Starts are off by {start_mtre_mm/median:%.1f mm} mTRE (median).\n\n";
  return (summaries.empty() ? "" : filled(start, summaries.front())) +
         figureTable(summaries, {{"method", ""},
                                 {"success, mTRE < 2 mm", "{success_mtre_2mm_percent:%.0f %%}"},
                                 {"in-plane < 2 mm", "{in_plane_below_2mm_percent:%.0f %%}"},
                                 {"pose ok", "{pose_ok_percent:%.0f %%}"},
                                 {"mPD > 5 px", "{gfr_true_5px_percent:%.0f %%}"},
                                 {"mPD > 5 mm at the isocentre", "{gfr_true_isocentre_5mm_percent:%.0f %%}"},
                                 {"capture range", "{capture_range_mm:%.0f mm}"},
                                 {"unbroken", "{capture_range_unbroken_mm:%.0f mm}"},
                                 {"failed, noticed", "{failed_and_noticed_percent:%.0f %%}"},
                                 {"failed, trusted", "{failed_and_trusted_percent:%.0f %%}"}}) +
         "\n" +
         figureTable(summaries, {{"method", ""},
                                 {"converged", "{converged_percent:%.0f %%}"},
                                 {"converged and wrong", "{converged_and_wrong_percent:%.1f %%}"},
                                 {"claimed spread", "{claimed_spread_mm/median:%.2f mm}"},
                                 {"depth in its 90 %", "{depth_in_90_percent/mean:%.0f %%}"},
                                 {"in-plane in its 90 %", "{plane_in_90_percent/mean:%.0f %%}"}}) +
         quarterTable(summaries) + "\n" +
         figureTable(summaries, {{"method", ""},
                                 {"mTRE", "{mtre_mm/median:%.3f mm}"},
                                 {"p95", "{mtre_mm/p95:%.3f mm}"},
                                 {"depth", "{depth_mm/median:%.3f mm}"},
                                 {"in-plane", "{in_plane_mm/median:%.3f mm}"},
                                 {"across the beam", "{across_beam_mm/median:%.3f mm}"},
                                 {"mPD", "{mpd_px/median:%.3f px}"},
                                 {"at the detector", "{mpd_detector_mm/median:%.3f mm}"},
                                 {"at the isocentre", "{mpd_isocentre_mm/median:%.3f mm}"},
                                 {"rotation", "{rotation_deg/median:%.4f deg}"},
                                 {"centroid", "{centroid_mm/median:%.3f mm}"},
                                 {"nearest residual", "{mean_projection_residual_px/median:%.2f px}"}}) +
         "\n" +
         figureTable(summaries, {{"method", ""},
                                 {"ms p50", "{time_ms/total/p50:%.2f}"},
                                 {"p99", "{time_ms/total/p99:%.2f}"},
                                 {"max", "{time_ms/total/max:%.2f}"},
                                 {"p50 relative", "{time_p50_relative/ratio:%.2f}"}}) +
         (!summaries.empty() && summaries.front().contains("certificate")
              ? "\n" + figureTable(summaries, {{"method", ""},
                                               {"certificate proven", "{certificate/proven_percent:%.0f %%}"},
                                               {"false", "{certificate/false_percent:%.1f %%}"},
                                               {"s p50", "{certificate/seconds/p50:%.1f}"},
                                               {"max", "{certificate/seconds/max:%.1f}"}})
              : "") +
         "\nMedians over the trials; \"pose ok\" is within 0.1 deg and 1 mm of the truth at the tree's centroid. "
         "Trusted is what the method itself calls converged.\n";
}

}  // namespace angio::evaluation
