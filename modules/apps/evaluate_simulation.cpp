// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate simulation: trials with known truth.
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/simulation_report.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/measured_motion_file.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/experiment.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

struct SimulationOptions {
  MethodOptions method;
  CampaignOptions campaign;
  std::vector<std::string> trees, motions;
  std::string camera, sweep, out, report;
  ModelAxes model_axes = SimulationSettings().model_axes;
  TrialSource from = SimulationSettings().from;
  bool certify = false;
  CertificateSettings certificate;

  // Those that are given come before the settings file's.
  std::vector<std::function<void(SimulationSettings&)>> given;
};

// The settings file of this command: the methods' sections and `simulation`.
struct SimulationFile {
  ProgramSettings methods;
  SimulationSettings simulation;

  void visit(SettingsVisitor& v) {
    methods.visit(v);
    v.section("simulation", [&](SettingsVisitor& inner) { simulation.visit(inner); });
  }
};

int evaluateSimulation(const SimulationOptions& o, const SimulationSettings& settings, SimulationSetup setup,
                       const CampaignRun& run) {
  setup.campaign = run.rows;
  std::vector<std::string> tree_names;
  for (const auto& path : o.trees) {
    setup.trees.push_back(readVesselTree(path));
    tree_names.push_back(std::filesystem::path(path).filename().string());
  }
  for (const auto& path : o.motions) setup.motions.push_back(readMeasuredMotion(path));
  if (!setup.motions.empty() && !(settings.deformation_rms_mm > 0)) {
    throw InputError("--deformation-field", "--deformation-mm", "0", "must be above 0: the size of the deformation");
  }
  if (o.certify) {
    if (o.method.nonrigid) cli::refuseBoth("--certify", "--nonrigid");
    setup.certificate = o.certificate;
  }
  if (!o.camera.empty()) setup.camera = readCamera(o.camera);
  const std::vector<Sweep> sweeps = o.sweep.empty() ? std::vector<Sweep>() : sweepsNamed(o.sweep, settings);

  const int run_size = settings.trials * static_cast<int>(setup.entrants.size());
  int total = run_size, done = 0;
  for (const auto& sweep : sweeps) total += run_size * static_cast<int>(sweep.points.size());
  ProgressBar bar("registering", run.share(total));
  const auto runs = runSimulation(setup, settings, [&](int) { bar.show(++done); });
  const auto spacing_m = setup.camera.value_or(simulatedCamera()).parameters().pixel_spacing_m;
  const auto summaries = run.shown(simulationSummaries(runs, spacing_m));
  std::vector<Json> swept;
  for (const auto& sweep : sweeps) {
    if (interrupted()) break;
    swept.push_back(run.shown(runSweep(setup, sweep, [&](int) { bar.show(++done, sweep.name); })));
  }
  if (!run.done()) return 0;

  Json json = run.shown(simulationResults(setup, settings, runs, summaries));
  for (const Json& sweep : swept) json["sweeps"][sweep["name"].get<std::string>()] = sweep;
  json["settings"]["simulation"]["trees"] = tree_names;
  if (!o.report.empty()) {
    writeWholeFile(o.report, simulationReportHtml(
                                 {setup, settings, runs, summaries, swept, json["settings"], tree_names, run.machine}));
  }
  std::string tables = simulationTable(summaries);
  for (const Json& sweep : swept) tables += "\n" + sweepTable(sweep);
  return reported(json, o.out, tables, run.machine);
}

int evaluateSimulation(const SimulationOptions& o, const Campaigns& campaigns) {
  SimulationFile file;
  for (const auto& path : {o.out, o.report}) requireFolderOf(path);
  if (!o.method.settings.empty()) file = readSettings(o.method.settings, file);
  for (const auto& set : o.given) set(file.simulation);
  checkSettings("simulation", file.simulation);
  SimulationSetup setup;
  setup.entrants = o.method.entrants(file.methods);
  setup.extractor = chosenExtractor(file.methods, o.method.extractor);
  CampaignJob job{o.campaign, o.out, file.simulation.trials, {}, [&](const CampaignRun& run) {
                    return evaluateSimulation(o, file.simulation, setup, run);
                  }};
  for (const auto& path : {o.method.settings, o.camera}) addInput(job.inputs, path);
  for (const auto& paths : {o.trees, o.motions}) {
    for (const std::string& path : paths) addInput(job.inputs, path);
  }
  return campaigns.run(job);
}

// The range of one field, by its key.
class RangeOf final : public SettingsVisitor {
 public:
  explicit RangeOf(const std::string& key) : key_(key) { SimulationSettings().visit(*this); }

  cli::Check validator() const { return between(low_, high_); }

  void number(const char* key, double&, double low, double high, const char*) override { found(key, low, high); }
  void integer(const char* key, int&, int low, int high, const char*) override { found(key, low, high); }
  void flag(const char*, bool&, const char*) override {}
  void numbers(const char*, double*, int, double, double, const char*) override {}
  void choiceIndex(const char*, int&, const std::vector<std::string>&, const char*) override {}
  void section(const char*, const std::function<void(SettingsVisitor&)>&, const char*) override {}

 private:
  void found(const char* key, double low, double high) {
    if (key_ == key) low_ = low, high_ = high;
  }

  std::string key_;
  double low_ = 0, high_ = 0;
};

// Options that set one field when they are given. "--noise-px" is the key noise_px, whose range holds here as well.
class GivenFields {
 public:
  GivenFields(cli::Command& command, std::shared_ptr<SimulationOptions> o, std::string group)
      : command_(command), o_(std::move(o)), group_(std::move(group)) {}

  template <typename Value>
  void add(const std::string& name, Value SimulationSettings::*field, const std::string& help,
           const std::string& more_names = "") {
    std::string key = name.substr(2);
    std::replace(key.begin(), key.end(), '-', '_');
    const auto set = [o = o_, field](const Value& value) {
      o->given.push_back([field, value](SimulationSettings& s) { s.*field = value; });
    };
    command_.addSetter<Value>(name + more_names, set, help, SimulationSettings{}.*field)
        ->group(group_)
        ->check(RangeOf(key).validator());
  }

 private:
  cli::Command& command_;
  std::shared_ptr<SimulationOptions> o_;
  std::string group_;
};

void addFields(cli::Command& command, const std::shared_ptr<SimulationOptions>& o) {
  using S = SimulationSettings;
  GivenFields fields(command, o, "Options"), further(command, o, cli::kFurtherOptions);
  fields.add("--trials", &S::trials, "Number of trials, split over the trees");
  fields.add("--seed", &S::seed, "Seed of all draws");
  fields.add("--rotation-std-deg", &S::rotation_std_deg, "Spread of the starts per axis");
  fields.add("--translation-std-mm", &S::translation_std_mm, "Spread of the starts per axis");
  further.add("--even-starts-mm", &S::even_starts_mm,
              "Starts spread evenly from 0 to this mTRE, for the capture range");
  fields.add("--views", &S::views, "Views of one moment; the second about 90 deg from the first");
  further.add("--turn-deg", &S::turn_deg, "Spread the views over such a turn of the C-arm instead");
  further.add("--turn-s", &S::turn_s,
              "The turn's frames, after 4 s of standing: a sequence, and its last frame's depth");
  further.add("--breath-mm", &S::breath_mm, "How far the diaphragm comes down meanwhile");
  fields.add("--visible-fraction", &S::visible_fraction, "Share of the tree in the field of view");
  fields.add("--missing", &S::missing, "Share of the tree without contrast agent, whole branches",
             ",--missing-branches");
  fields.add("--filled", &S::filled, "Share of the tree in view that is filled, downstream of drawn injection sites");
  fields.add("--spurious", &S::spurious, "Curves per view that are no vessel");
  fields.add("--noise-px", &S::noise_px, "Noise of each image coordinate");
  fields.add("--deformation-rms-mm", &S::deformation_rms_mm, "Smooth deformation of the tree", ",--deformation-mm");
  further.add("--deformation-anisotropy", &S::deformation_anisotropy,
              "How much more it moves from feet to head than along the other axes");
  further.add("--focal-error-percent", &S::focal_error_percent, "Error of the focal length the method is told");
  further.add("--calibration-rotation-error-deg", &S::calibration_rotation_error_deg,
              "Error of the second view against the first, about the isocentre");
  further.add("--calibration-translation-error-mm", &S::calibration_translation_error_mm, "The same");
}

}  // namespace

void addEvaluateSimulation(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<SimulationOptions>();
  auto* command = app.addSubcommand("simulation", "Run simulated trials with known truth");
  command->footer(
      "Example:\n  angio-evaluate simulation --tree a.swc --tree b.swc --trials 200 --visible-fraction 0.5 "
      "--noise-px 1 --spurious 5 --sweep noise --report report.html\n\nAll fields of the simulation, also "
      "views, model axes and spacings, can be set in the section `simulation` of --settings.");
  command->addOption("--tree", o->trees, "Vessel tree (.csv, .swc, .vtp, HMM .txt); may be repeated")
      ->required()
      ->takeAll();
  command
      ->addOption("--deformation-field", o->motions,
                  "Measured motion (.csv: x_mm, y_mm, z_mm, moved_x_mm, moved_y_mm, moved_z_mm) that deforms the tree, "
                  "scaled to it and turned; may be repeated")
      ->takeAll();
  command->addOption(
      "--camera", o->camera,
      "X-ray camera (.yaml, ViSP .xml); when not given 1024 x 1024 pixels of 0.308 mm, 1195 mm from the source");
  o->method.addTo(*command, settingsInForce<SimulationFile>);
  command->addFlag("--nonrigid", o->method.nonrigid, "Let the tree deform after the rigid registration");
  addFields(*command, o);
  auto* certify =
      command->addFlag("--certify", o->certify, "Certify every result in a box of +-45 deg / +-60 mm about its start");
  command->addOption("--certify-seconds", o->certificate.seconds, "Time for each proof")
      ->check(between(0.1, 86400))
      ->needs(certify);
  auto* from =
      command
          ->addOption("--from", o->from,
                      "What methods are given: projected centerlines, or what the extractor finds in X-ray images")
          ->check(choice(std::map<std::string, TrialSource>{{"centerlines", TrialSource::kCenterlines},
                                                            {"images", TrialSource::kImages}}))
          ->defaultText("centerlines");
  auto* axes = addModelAxes(*command, o->model_axes);
  std::string names;
  for (const auto& name : sweepNames()) names += name + ", ";
  command->addOption("--sweep", o->sweep, "Besides, over a range of: " + names + "or all");
  command->addOption("--out", o->out, "All results (.json)");
  auto* report = command->addOption("--report", o->report, "Report with curves and pictures (.html)");
  o->campaign.addTo(*command, {report});
  command->onChosen([o, axes, from, &work, &campaigns] {
    if (from->given()) o->given.push_back([o](SimulationSettings& s) { s.from = o->from; });
    if (axes->given()) o->given.push_back([o](SimulationSettings& s) { s.model_axes = o->model_axes; });
    work = [o, &campaigns] { return evaluateSimulation(*o, campaigns); };
  });
}

}  // namespace angio::apps
