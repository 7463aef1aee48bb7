// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate extraction: how well centrelines are found in X-ray images.
#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/extraction_run.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

struct ExtractionOptions {
  CampaignOptions campaign;
  std::vector<std::string> extractors = {RidgeSettings::kName, OtsuSettings::kName};
  std::vector<std::string> trees, images;
  std::string cases, annotations, camera, settings, out, sheet;
  int trials = 20, seed = 1;
  double tolerance_px = 0;
  double thinnest_mm = 1, thickest_mm = 6;
  double radius_px = 4, shown_contrast = 0.15;
  DeviceKind device = DeviceKind::kNone;
  bool whole_run = false;
  double frames_per_s = 0, breath_mm = 0, from_s = 0;
  double predicted_mm = 0, predicted_deg = 0.3, filled = 1;
  int columns = 5, side_px = 480;
  ModelAxes model_axes = SimulationSettings().model_axes;
};

// The settings file of this command: the extractors' sections, and `fluoroscopy` of simulated images.
struct ExtractionFile {
  ProgramSettings methods;
  FluoroscopySettings fluoroscopy;

  void visit(SettingsVisitor& v) {
    methods.visit(v);
    v.section("fluoroscopy", [&](SettingsVisitor& inner) { fluoroscopy.visit(inner); });
  }
};

// Images of one kind, which one table is about.
struct Source {
  std::string name;
  ExtractionSamples samples;
  double usual_tolerance_px;  // A pixel and a half where the truth is exact, three where people or a fit have drawn it.
};

ExtractionSamples simulatedSamplesOf(const ExtractionOptions& o, const FluoroscopySettings& fluoroscopy) {
  std::vector<VesselTree> trees;
  for (const auto& path : o.trees) trees.push_back(readVesselTree(path));
  SimulationSettings settings;
  settings.trials = o.trials;
  settings.seed = o.seed;
  settings.model_axes = o.model_axes;
  settings.from = TrialSource::kImages;
  settings.fluoroscopy = fluoroscopy;
  settings.filled = o.filled;
  settings.translation_std_mm = o.predicted_mm;
  settings.rotation_std_deg = o.predicted_deg;
  const auto camera = o.camera.empty() ? std::optional<XrayCamera>() : readCamera(o.camera);
  if (o.device != DeviceKind::kNone) {
    return deviceSamples(trees, camera, settings, {o.device, o.frames_per_s, o.whole_run, o.breath_mm, o.from_s});
  }
  return simulatedSamples(trees, camera, settings, {o.thinnest_mm, o.thickest_mm, o.predicted_mm > 0});
}

std::vector<Source> sourcesOf(const ExtractionOptions& o, const ExtractionFile& file) {
  std::vector<Source> sources;
  if (!o.cases.empty()) {
    sources.push_back({"cases", caseSamples(readCaseSet(o.cases), o.radius_px, o.shown_contrast), 3});
  }
  if (!o.annotations.empty()) {
    sources.push_back({"annotations", annotatedSamples(readCocoPolygons(o.annotations)), 3});
  }
  if (!o.images.empty()) sources.push_back({"images", imageSamples(o.images), 3});
  if (!o.trees.empty()) sources.push_back({"simulated", simulatedSamplesOf(o, file.fluoroscopy), 1.5});
  return sources;
}

int evaluateExtraction(const ExtractionOptions& o, const ExtractionFile& file, const std::vector<Source>& sources,
                       const CampaignRun& run) {
  std::vector<ExtractionEntrant> entrants;
  Json json;
  for (const auto& name : o.extractors) {
    if (json["settings"].contains(name)) throw InputError("", "extractor", name, "must be named once");
    entrants.push_back({name, file.methods.extractors.named(name)});
    json["settings"].update(extractorAsJson(entrants.back().settings));
  }
  int total = 0, done = 0;
  for (const auto& source : sources) total += source.samples.count * static_cast<int>(entrants.size());
  ProgressBar bar("extracting", run.share(total));
  std::vector<SheetPicture> pictures;
  std::string tables;
  for (const auto& source : sources) {
    const bool goes_on = finishPart(!tables.empty(), [&] {
      const double tolerance_px = o.tolerance_px > 0 ? o.tolerance_px : source.usual_tolerance_px;
      const auto runs = runExtraction(
          source.samples, entrants, tolerance_px, o.sheet.empty() ? Pictures::kNone : Pictures::kKeep,
          [&](int) { bar.show(++done, source.name); }, run.rows);
      pictures.insert(pictures.end(), runs.front().pictures.begin(), runs.front().pictures.end());
      json["sources"][source.name] = run.shown(extractionSummaries(runs));
      tables += (tables.empty() ? "" : "\n") + source.name + "\n\n" + extractionTable(json["sources"][source.name]);
    });
    if (!goes_on) break;
  }
  if (!run.done()) return 0;
  if (!o.sheet.empty()) writeImage(o.sheet, contactSheet(pictures, o.columns, o.side_px));
  return reported(json, o.out, tables, run.machine);
}

int evaluateExtraction(const ExtractionOptions& o, const Campaigns& campaigns) {
  requireFolderOf(o.out);
  requireImagePath(o.sheet);
  ExtractionFile file;
  if (!o.settings.empty()) file = readSettings(o.settings, file);
  const std::vector<Source> sources = sourcesOf(o, file);
  int most = 0;
  for (const Source& source : sources) most = std::max(most, source.samples.count);
  CampaignJob job{
      o.campaign, o.out, most, {}, [&](const CampaignRun& run) { return evaluateExtraction(o, file, sources, run); }};
  for (const auto& path : {o.settings, o.camera, o.annotations}) addInput(job.inputs, path);
  for (const auto& paths : {o.trees, o.images}) {
    for (const std::string& path : paths) addInput(job.inputs, path);
  }
  if (!o.cases.empty()) addInputs(job.inputs, o.cases, readCaseSet(o.cases));
  if (!o.annotations.empty()) {
    for (const AnnotatedImage& image : readCocoPolygons(o.annotations)) addInput(job.inputs, image.image_path);
  }
  return campaigns.run(job);
}

}  // namespace

void addEvaluateExtraction(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<ExtractionOptions>();
  auto* command = app.addSubcommand("extraction", "Compare extracted centrelines with what X-ray images show");
  command->footer(
      "Examples:\n  angio-evaluate extraction --tree a.swc --trials 50 --sheet sheet.png\n  angio-evaluate extraction "
      "--cases cases.yaml\n  angio-evaluate extraction --annotations annotations.json");
  auto* images = command->addGroup("Images", "At least one of them; a table each", 4);
  images->addOption("--tree", o->trees, "Simulated views of a vessel tree; may be repeated")->takeAll();
  images->addOption("--cases", o->cases, "Case set (.yaml) whose cases have images and true poses");
  images->addOption("--annotations", o->annotations, "Images with polygons drawn by people (COCO, .json)");
  images->addOption("--image", o->images, "Images without a truth: for their times and the sheet")->takeAll();
  command->addOption("--extractor", o->extractors, "Extractors, separated by commas: " + listOfExtractors())
      ->delimiter(',');
  command
      ->addOption("--tolerance-px", o->tolerance_px,
                  "Lines within this of each other are the same; 0: 1.5 of simulated images, 3 of others")
      ->check(cli::between(0.0, 100.0));
  command->addOption("--trials", o->trials, "Number of simulated images, split over the trees")
      ->check(cli::wholeBetween(1, 100000));
  command->addOption("--seed", o->seed, "Seed of all draws")->check(cli::wholeBetween(0, 2147483647));
  command->addOption("--camera", o->camera, "Camera of simulated images (.yaml, ViSP .xml)");
  addModelAxes(*command, o->model_axes);
  auto* thinnest =
      command->addOption("--thinnest-mm", o->thinnest_mm, "Simulated vessels from this width on must be found")
          ->check(cli::between(0.0, 100.0));
  auto* thickest =
      command->addOption("--thickest-mm", o->thickest_mm, "and to this one")->check(cli::between(0.0, 100.0));
  auto* predicted =
      command
          ->addOption("--predicted-mm", o->predicted_mm,
                      "In simulated images the tree is expected where a tracker has it, so far off (standard deviation "
                      "per axis); 0: it is not known")
          ->check(cli::between(0.0, 100.0));
  command->addOption("--predicted-deg", o->predicted_deg, "and turned by so much (standard deviation per axis)")
      ->check(cli::between(0.0, 90.0))
      ->needs(predicted);
  auto* filled =
      command->addOption("--filled", o->filled, "Part of simulated vessels, in view, that has contrast agent")
          ->check(cli::between(0.01, 1.0));
  auto* device =
      command
          ->addOption(
              "--device", o->device,
              "In simulated images there are a device in the tree and an injection that comes and goes; all that "
              "can be seen must be found")
          ->check(cli::choice(std::map<std::string, DeviceKind>{
              {"none", DeviceKind::kNone}, {"catheter", DeviceKind::kCatheter}, {"guidewire", DeviceKind::kGuidewire}}))
          ->defaultText("none")
          ->excludes(predicted)
          ->excludes(filled)
          ->excludes(thinnest)
          ->excludes(thickest);
  auto* run =
      command
          ->addOption(
              "--frames-per-s", o->frames_per_s,
              "Each frame with a device comes last in its run, whose frames from before the injection on are seen "
              "at this rate; 0: it is seen alone")
          ->check(cli::between(0.0, 100.0))
          ->needs(device);
  command
      ->addFlag("--whole-run", o->whole_run,
                "Frames that are not known by those before them are named by what their runs show later, as those of a "
                "file are")
      ->needs(run)
      ->group(cli::kFurtherOptions);
  command->addOption("--from-s", o->from_s, "When such a run begins; the injection does at 0.3 s")
      ->check(cli::between(0.0, 5.0))
      ->needs(run)
      ->group(cli::kFurtherOptions);
  command->addOption("--breath-mm", o->breath_mm, "How far the diaphragm comes down in such a run")
      ->check(cli::between(0.0, 60.0))
      ->needs(device)
      ->group(cli::kFurtherOptions);
  command->addOption("--radius-px", o->radius_px, "Of the vessels of a case set: what an image shows of its tree")
      ->check(cli::between(1.0, 100.0));
  command->addOption("--shown-contrast", o->shown_contrast, "is this much darker than its sides (natural logarithm)")
      ->check(cli::between(0.001, 10.0));
  addSettingsOptions(*command, o->settings, "Settings (.yaml), sections by extractor, and fluoroscopy",
                     settingsInForce<ExtractionFile>);
  command->addOption("--out", o->out, "Scores (.json)");
  auto* sheet =
      command->addOption("--sheet", o->sheet, "Picture of what the first extractor found in each image (.png, .jpg)");
  command->addOption("--columns", o->columns, "Of the sheet")
      ->check(cli::wholeBetween(1, 100))
      ->group(cli::kFurtherOptions);
  command->addOption("--side-px", o->side_px, "Of each picture on it")
      ->check(cli::wholeBetween(50, 2000))
      ->group(cli::kFurtherOptions);
  o->campaign.addTo(*command, {sheet});
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return evaluateExtraction(*o, campaigns); }; });
}

}  // namespace angio::apps
