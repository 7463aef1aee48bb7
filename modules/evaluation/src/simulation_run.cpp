// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/simulation_run.hpp"

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/evaluation/trial_images.hpp"

namespace angio::evaluation {
namespace {

CaseOutcome outcomeOf(Registration& registration, const SimulatedTrial& trial, const StartSettings& starts) {
  const VesselTree& tree = registration.tree();
  CaseOutcome outcome;
  outcome.result = registration.search(trial.views(), {trial.start, {}}, starts);
  const PlacedTree truth{trial.truth, trial.displacements_m};
  const XrayCamera& camera = trial.cameras.front();
  outcome.pixel_at_isocenter_m = (trial.truth * tree.centroid()).z() / camera.parameters().fx_px;
  outcome.start_error = poseError(tree, camera, {trial.start, {}}, truth);
  outcome.error = poseError(tree, camera, {outcome.result.T_camera_model, outcome.result.displacements_m}, truth);
  return outcome;
}

}  // namespace

std::vector<EntrantRun> runSimulation(const SimulationSetup& setup, const SimulationSettings& settings,
                                      const CaseProgress& progress) {
  checkSettings("simulation", settings);
  if (setup.trees.empty()) throw InputError("simulation", "trees", "0", "must be at least one");
  const std::size_t entrants = setup.entrants.size(), trees = setup.trees.size();
  std::vector<EntrantRun> runs;
  std::vector<std::vector<std::unique_ptr<Registration>>> registrations(entrants);
  for (std::size_t m = 0; m < entrants; ++m) {
    runs.push_back({setup.entrants[m].name, {}});
    for (const auto& tree : setup.trees) {
      registrations[m].push_back(makeRegistration(setup.entrants[m].registration, tree));
    }
  }
  std::optional<TrialImages> images;
  if (settings.from == TrialSource::kImages) images.emplace(setup.trees, settings);
  const auto extractor = makeExtractor(setup.extractor);
  int done = 0;
  for (int i = 0; i < settings.trials; ++i) {
    const std::size_t t = static_cast<std::size_t>(i) % trees;
    SimulatedTrial trial = simulatedTrial(setup.trees[t], setup.camera, settings, i);
    double image_s = 0;
    for (std::size_t v = 0; images && v < trial.cameras.size(); ++v) {
      const cv::Mat image = images->render(trial, t, v, i);
      const Stopwatch stage;
      trial.centerlines[v] = vesselsToMatch(extractor->extract(image));
      image_s += stage.seconds();
    }
    for (std::size_t turn = 0; turn < entrants; ++turn) {
      const std::size_t m = (static_cast<std::size_t>(i) + turn) % entrants;
      runs[m].outcomes.push_back(outcomeOf(*registrations[m][t], trial, setup.entrants[m].starts));
      runs[m].outcomes.back().name = formatted("%04d", i);
      runs[m].outcomes.back().image_s = image_s;
      if (progress) progress(++done);
    }
  }
  return runs;
}

}  // namespace angio::evaluation
