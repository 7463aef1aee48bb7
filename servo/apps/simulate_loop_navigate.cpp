// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate-loop navigate: a simulated catheter's journeys to many branches of a tree, images and registration in
// the loop.
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/base/formatted.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/experiments/navigate_experiment.hpp"
#include "angio/io/curve_folder.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/registration/message_conversion.hpp"
#include "angio/results/experiment.hpp"
#include "angio/results/film_writer.hpp"
#include "angio/results/live_overlay.hpp"
#include "angio/vessel/prune.hpp"
#include "catheter_options.hpp"
#include "simulate_loop.hpp"

namespace angio::apps {
namespace {

struct NavigateOptions {
  std::vector<std::string> trees, target_names;
  std::vector<double> root_mm;
  std::string calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string settings, out, film;  // The film is of the first journey.
  CampaignOptions campaign;
  int targets = 20, first_seed = 1, threads = 1;
  double max_edge_mm = 10;
  CatheterOptions catheter;
};

// All that the settings file may say.
struct NavigateSettings {
  NavigateExperimentSettings experiment;
  NavigateParts parts;

  void visit(SettingsVisitor& v) {
    v.section("study", [this](SettingsVisitor& s) { experiment.visit(s); });
    parts.visit(v);
  }
};

constexpr int kTimesFaster = 3;

LiveScene sceneOf(const NavigateMoment& m, ModelId model_id) {
  LiveScene scene{m.frame, {}, m.status, {}, {}, {}, {}};
  if (m.report.registration) {
    scene.registration = registrationMessage(*m.report.registration, model_id, m.frame.time_us, m.frame.sequence);
  }
  if (m.report.loop.trace) scene.device_px = m.report.loop.trace->seen.points_px;
  if (const auto& belief = m.report.loop.input.belief) {
    CatheterTip tip;
    tip.model_id = model_id;
    tip.status = CatheterTipStatus::kLocated;
    tip.tip_model = belief->tip.tip_model;
    tip.branch = belief->tip.branch;
    tip.arc_length_m = belief->tip.path_m;
    scene.tip = tip;
  }
  scene.title = formatted("%.0f s: %s", m.time_s, stateName(m.report.loop.answer.state));
  return scene;
}

// A journey as a film, three times as fast as it was: the X-ray with the registered tree, what is seen of the catheter,
// where its tip is believed, the target, and what the navigator does.
class NavigateFilm {
 public:
  NavigateFilm(const std::string& path, const VesselTree& tree, const TreeLocation& target, double frame_rate_hz)
      : film_(path, frame_rate_hz),
        model_id_(modelId(tree)),
        overlay_(tree),
        target_(TreeTopology(tree).point(target)) {}

  void show(const NavigateMoment& moment) {
    if (frames_++ % kTimesFaster != 0) return;
    LiveScene scene = sceneOf(moment, model_id_);
    scene.target_model = target_;
    film_.write(overlay_.draw(scene));
  }

  void finish() { film_.finish(); }

 private:
  FilmWriter film_;
  ModelId model_id_;
  LiveOverlay overlay_;
  Eigen::Vector3d target_;
  int frames_ = 0;
};

VesselTree readTree(const std::string& file, const NavigateOptions& o) {
  const VesselTree tree = withoutLongEdges(readVesselTree(file), 1e-3 * o.max_edge_mm);
  if (o.root_mm.empty()) return tree;
  return beginningAt(tree, 1e-3 * Eigen::Vector3d(o.root_mm[0], o.root_mm[1], o.root_mm[2]));
}

std::vector<TreeLocation> targetsOf(const std::string& file, const VesselTree& tree, const NavigateOptions& o,
                                    const NavigateExperimentSettings& experiment) {
  if (o.target_names.empty()) return navigateTargets(tree, experiment, o.targets);
  const std::vector<NamedCurve> curves = readCurveFolder(file);
  std::vector<Eigen::Matrix3Xd> named;
  for (const std::string& name : o.target_names) named.emplace_back(curveOfName(file, curves, name).points_mm / 1e3);
  return targetsAlong(tree, experiment, named, o.targets);
}

Json simulateTree(const std::string& file, const NavigateOptions& o, const NavigateSettings& s,
                  const CampaignRun& campaign) {
  const VesselTree tree = readTree(file, o);
  const std::vector<TreeLocation> targets = targetsOf(file, tree, o, s.experiment);
  if (targets.empty()) throw InputError(file, "", "", "has no branch that is wide and far enough to go to");
  const CArmCalibration nominal = readCArmCalibration(o.calibration);
  std::optional<NavigateFilm> film;
  if (!o.film.empty()) film.emplace(o.film, tree, targets.front(), s.experiment.lab.frame_rate_hz);
  const std::filesystem::path path = std::filesystem::path(file).lexically_normal();
  const std::string name = (path.has_filename() ? path : path.parent_path()).filename().string();
  const auto count = static_cast<int>(targets.size());
  ProgressBar bar("navigating " + name, campaign.share(count));
  const auto one = [&](int k) {
    const bool filmed = film && k == 0;
    const NavigateObserver look_on = filmed ? [&](const NavigateMoment& m) { film->show(m); } : NavigateObserver();
    return runNavigationExperiment(tree, nominal, targets[static_cast<std::size_t>(k)], s.experiment, s.parts,
                                   o.first_seed + k, look_on);
  };
  const auto rows = recordsOf(
      campaign.rows, count, o.threads, [&](int k) { return "journey of seed " + std::to_string(o.first_seed + k); },
      one, [&](int done) { bar.show(done); });
  if (film) film->finish();
  return navigateExperimentAsJson(name, rows);
}

Json catheterAsJson(const CatheterSettings& catheter) {
  if (!catheter.elastic) return {{"model", "kinematic"}};
  const ElasticCatheterSettings& elastic = *catheter.elastic;
  return {{"model", "elastic"},
          {"shaft_bending_n_mm2", elastic.shaft_bending_n_mm2},
          {"tip_bending_n_mm2", elastic.tip_bending_n_mm2},
          {"soft_length_mm", elastic.soft_length_mm},
          {"wall_friction", elastic.wall_friction}};
}

int simulateNavigation(const NavigateOptions& o, const NavigateSettings& settings, const CampaignRun& campaign) {
  Json json;
  for (const std::string& file : o.trees) {
    const bool goes_on =
        finishPart(!json.empty(), [&] { json["trees"].push_back(simulateTree(file, o, settings, campaign)); });
    if (!goes_on) break;
  }
  if (!campaign.done()) return 0;
  json["catheter"] = catheterAsJson(settings.parts.catheter);
  json = campaign.shown(std::move(json));
  const std::string table = navigateExperimentTable(json["trees"]);
  return report(std::move(json), table, settingsAsJson(settings), campaign.machine, o.out);
}

int simulateNavigation(const NavigateOptions& o, const Campaigns& campaigns) {
  for (const auto& path : {o.out, o.film}) requireFolderOf(path);
  if (!o.film.empty() && o.trees.size() > 1) throw InputError("--film", "", o.film, "is of one tree's first journey");
  NavigateSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  o.catheter.applyTo(settings.parts.catheter);
  CampaignJob job{o.campaign, o.out, o.targets, {}, [&](const CampaignRun& campaign) {
                    return simulateNavigation(o, settings, campaign);
                  }};
  for (const auto& path : {o.calibration, o.settings}) addInput(job.inputs, path);
  for (const std::string& path : o.trees) addInput(job.inputs, path);
  return campaigns.run(job);
}

}  // namespace

void addSimulateNavigate(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<NavigateOptions>();
  o->trees = {exampleDataFile("hepatic-tace/tree.csv")};
  cli::Command* command =
      app.addSubcommand("navigate", "Bring a catheter to branches: reached, wall contacts, tip errors");
  command->addOption("--tree", o->trees, "Vessel trees; their own row each");
  command->addOption("--calibration", o->calibration,
                     "C-arm geometry (.yaml); the tree's centroid is at the isocentre");
  command->addOption("--max-edge-mm", o->max_edge_mm, "Longer edges join what no vessel joins")
      ->check(cli::between(0.1, 1e4));
  command->addOption("--targets", o->targets, "Branches of each tree to go to")->check(cli::wholeBetween(1, 100000));
  command
      ->addOption("--target-names", o->target_names,
                  "Curves of a folder of .mrk.json files to go to, by name or its last word: LCCA,LVA")
      ->delimiter(',');
  command
      ->addOption("--root", o->root_mm,
                  "Where catheters come in: the tree is cut there, and its longer side stays: x,y,z [mm]")
      ->delimiter(',')
      ->expected(3);
  o->catheter.addTo(*command);
  command->addOption("--first-seed", o->first_seed, "Seed of the first journey")
      ->check(cli::wholeBetween(0, 2147000000));
  command->addOption("--threads", o->threads, "Journeys at a time")->check(cli::wholeBetween(1, 256));
  auto* film =
      command->addOption("--film", o->film, "Film of the first journey (.mp4, or numbered pictures), of one tree");
  addSettingsOptions(*command, o->settings, "Settings (.yaml)", settingsInForce<NavigateSettings>);
  command->addOption("--out", o->out, "All journeys and the settings (.json)");
  o->campaign.addTo(*command, {film});
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return simulateNavigation(*o, campaigns); }; });
}

}  // namespace angio::apps
