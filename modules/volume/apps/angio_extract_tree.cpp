// SPDX-License-Identifier: GPL-2.0-or-later
// angio-extract-tree: from a volume, a mask or a mesh to a vessel tree.
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/volume/coverage.hpp"
#include "angio/volume/extract_tree.hpp"
#include "angio/volume/labels.hpp"
#include "angio/volume/mesh_files.hpp"
#include "angio/volume/projections.hpp"
#include "angio/volume/shape.hpp"
#include "angio/volume/volume_files.hpp"

namespace angio::apps {
namespace {

struct Options {
  std::string volume, mask, out, result, settings, picture, compare;
  std::string frame = "LPS", compare_frame = "LPS", mesh_frame = "LPS", inside = "above";
  double mesh_voxel_mm = 0.5;
  std::vector<std::string> box;
  std::vector<int> labels;
  std::optional<double> threshold;
  std::vector<std::string> seeds;
  std::string root, ends, cycles = "cut", kissing = "cut";
  std::vector<Eigen::Vector3d> seeds_m, box_m;  // The texts, read.
  std::optional<Eigen::Vector3d> root_m;
  std::optional<double> compare_mm;
};

// The settings file of this program: a section per stage.
struct ExtractionSettings {
  VesselnessSettings vesselness;
  SelectionSettings selection;
  CentrelineSettings centreline;

  void visit(SettingsVisitor& v) {
    v.section(VesselnessSettings::kName, [&](SettingsVisitor& inner) { vesselness.visit(inner); });
    v.section(SelectionSettings::kName, [&](SettingsVisitor& inner) { selection.visit(inner); });
    v.section(CentrelineSettings::kName, [&](SettingsVisitor& inner) { centreline.visit(inner); });
  }
};

PatientFrame frameNamed(const std::string& name) { return name == "RAS" ? PatientFrame::kRas : PatientFrame::kLps; }

// "x,y,z" in millimetres of the frame, as a point in the patient's L, P, S.
Eigen::Vector3d pointOf(const std::string& text, const std::string& frame) {
  double x = 0, y = 0, z = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf,%lf%c", &x, &y, &z, &rest) != 3) {
    cli::refuseValue(text, "must be x,y,z in millimetres");
  }
  const Eigen::Vector3d point_mm(x, y, z);
  if (!(point_mm.cwiseAbs().maxCoeff() < 1e4)) cli::refuseValue(text, "must lie within 10,000 mm");
  return (frame == "RAS" ? Eigen::Vector3d(-1, -1, 1) : Eigen::Vector3d(1, 1, 1)).cwiseProduct(point_mm / 1e3);
}

std::vector<Eigen::Vector3d> pointsOf(const std::vector<std::string>& texts, const std::string& frame) {
  std::vector<Eigen::Vector3d> points_m;
  for (const std::string& text : texts) points_m.push_back(pointOf(text, frame));
  return points_m;
}

void readPoints(Options& o) {
  o.seeds_m = pointsOf(o.seeds, o.frame);
  o.box_m = pointsOf(o.box, o.frame);
  if (!o.root.empty()) o.root_m = pointOf(o.root, o.frame);
}

ShapeSettings shapeOf(const Options& o, const ExtractionSettings& settings) {
  if (!o.mask.empty() || !o.labels.empty()) return LabelSettings{o.labels};
  if (o.threshold) return ThresholdSettings{*o.threshold, o.inside == "below" ? Inside::kBelow : Inside::kAbove};
  return settings.vesselness;
}

void printCoverage(const char* what, const Coverage& coverage, double distance_m) {
  std::printf("%s: %.1f %% within %.3g mm (median %.2f mm, worst %.2f mm)\n", what, 100 * coverage.share,
              1e3 * distance_m, 1e3 * coverage.median_m, 1e3 * coverage.worst_m);
}

void compare(const Options& o, const VesselTree& tree, const VoxelGrid& grid) {
  VesselTree reference = readVesselTree(o.compare);
  if (o.compare_frame == "RAS" && !saysItsFrame(o.compare)) reference = withOtherFrame(reference);
  const double distance_m = o.compare_mm ? *o.compare_mm / 1e3 : grid.spacing_m.minCoeff();
  printCoverage("reference near tree", coverage(reference, tree, distance_m), distance_m);
  printCoverage("tree near reference", coverage(tree, reference, distance_m), distance_m);
  printCoverage("tree within the reference's vessels, near reference",
                coverage(tree, reference, distance_m, CoverageScope::kInsideOther), distance_m);
}

// What the files show: a volume to look at, and where the vessels are in it when that is known.
struct Seen {
  Volume volume;
  std::optional<Volume> labels;
  std::optional<VoxelMask> mask;
  std::vector<Repair> repairs;  // Of a surface.
};

std::vector<Opening> openingsOf(const std::vector<Repair>& repairs) {
  std::vector<Opening> openings;
  for (const Repair& repair : repairs) {
    if (repair.flaw == Flaw::kOpenEnd) openings.push_back({repair.at_m, repair.radius_m});
  }
  return openings;
}

Volume boxOf(const Volume& volume, const Options& o) {
  if (o.box_m.empty()) return volume;
  const Eigen::Vector3d a_m = o.box_m[0], b_m = o.box_m[1];
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d point_m(corner & 1 ? a_m.x() : b_m.x(), corner & 2 ? a_m.y() : b_m.y(),
                                  corner & 4 ? a_m.z() : b_m.z());
    low = low.cwiseMin(volume.grid.indexAt(point_m));
    high = high.cwiseMax(volume.grid.indexAt(point_m));
  }
  const Eigen::Vector3d last = volume.grid.size.cast<double>().array() - 1;
  low = low.cwiseMax(0).array().round();
  high = high.cwiseMin(last).array().round();
  if ((low.array() > high.array()).any())
    throw InputError(o.volume, "--box", o.box[0] + " " + o.box[1], "must meet the volume");
  return cropped(volume, low.cast<int>(), high.cast<int>(), 0, 0);
}

Seen readSeen(const Options& o, const ExtractionSettings& settings) {
  Seen seen;
  if (isMesh(o.volume)) {
    const double voxel_mm = settings.centreline.voxel_mm > 0 ? settings.centreline.voxel_mm : o.mesh_voxel_mm;
    FilledMesh mesh = readMesh(o.volume, voxel_mm / 1e3, frameNamed(o.mesh_frame));
    seen.mask = std::move(mesh.mask);
    seen.repairs = std::move(mesh.repairs);
    seen.volume.grid = seen.mask->grid;
    seen.volume.values.assign(seen.mask->inside.begin(), seen.mask->inside.end());
    return seen;
  }
  seen.volume = boxOf(readVolume(o.volume), o);
  if (!o.mask.empty()) seen.labels = boxOf(readVolume(o.mask), o);
  return seen;
}

// The labels that are vessels: those named, which have to be there, or a map's only one. Vesselness would find tubes in
// a label map too, and none of them would be a vessel.
std::vector<int> labelsOf(const Options& o, const Seen& seen) {
  const std::string& path = seen.labels ? o.mask : o.volume;
  const Volume& volume = seen.labels ? *seen.labels : seen.volume;
  if (!o.labels.empty()) requireLabels(path, volume, o.labels);
  const bool said = !o.labels.empty() || o.threshold || seen.mask || seen.labels;
  if (said || !isLabelMap(volume)) return o.labels;
  const std::vector<LabelSize> labels = labelsIn(volume);
  if (labels.size() > 1) {
    throw InputError(path, "--label", "", "is needed, as this is a label map. It has " + listOfLabels(labels));
  }
  std::cerr << "angio-extract-tree: " << path << " is a mask: vessels are its label " << listOfLabels(labels) << "\n";
  return {labels.front().label};
}

struct Summary {
  int trees = 0, branches = 0, ends = 0, cycles_cut = 0, small_trees_dropped = 0;
  double length_mm = 0, seconds = 0;
};

Summary summaryOf(const ExtractedTree& found, double seconds) {
  Summary s;
  for (int i = 0; i < found.tree.size(); ++i) {
    s.trees += found.tree.parents()[i] < 0;
    s.ends += found.tree.children()[i].empty();
  }
  s.branches = static_cast<int>(found.tree.branches().size());
  s.cycles_cut = found.count(Flaw::kCycle) + found.count(Flaw::kSelfTouch);
  s.small_trees_dropped = found.count(Flaw::kSmallTree);
  s.length_mm = 1e3 * found.tree.length();
  s.seconds = seconds;
  return s;
}

nlohmann::ordered_json asJson(const Options& o, const ExtractionSettings& settings, const Summary& s,
                              const std::vector<Repair>& repairs) {
  nlohmann::ordered_json json = {{"volume", o.volume},
                                 {"tree", o.out},
                                 {"frame", o.frame},
                                 {"trees", s.trees},
                                 {"branches", s.branches},
                                 {"ends", s.ends},
                                 {"length_mm", s.length_mm},
                                 {"cycles_cut", s.cycles_cut},
                                 {"small_trees_dropped", s.small_trees_dropped},
                                 {"seconds", s.seconds}};
  json["repairs"] = repairsAsJson(repairs, frameNamed(o.frame));
  json["settings"] = settingsAsJson(settings);
  json["settings"]["cycles"] = o.cycles;
  json["settings"]["kissing"] = o.kissing;
  return json;
}

int extract(Options o) {
  for (const auto& path : {o.out, o.picture, o.result}) requireFolderOf(path);
  ExtractionSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  if (!o.ends.empty()) settings.centreline.ends = o.ends == "sphere" ? CentrelineEnd::kSphere : CentrelineEnd::kWall;
  settings.centreline.cycles = o.cycles == "refuse" ? CycleRule::kRefuse : CycleRule::kCut;
  settings.centreline.kissing = o.kissing == "keep" ? KissingRule::kKeep : KissingRule::kCut;
  const Stopwatch watch;
  ProgressBar bar("extracting", kExtractionStages + 2);
  bar.show(0, "reading");
  const Seen seen = readSeen(o, settings);
  o.labels = labelsOf(o, seen);
  bar.show(1, "vessels");
  const VesselShape shape = seen.mask ? vesselShape(*seen.mask, settings.selection, o.seeds_m)
                                      : vesselShape(seen.labels ? *seen.labels : seen.volume, shapeOf(o, settings),
                                                    settings.selection, o.seeds_m);
  const ExtractedTree result = extractTree(
      shape, settings.centreline, o.root_m, [&](int done, const char* stage) { bar.show(2 + done, stage); },
      openingsOf(seen.repairs));
  std::vector<Repair> repairs = seen.repairs;
  for (const auto* more : {&shape.repairs, &result.repairs}) repairs.insert(repairs.end(), more->begin(), more->end());
  const Summary summary = summaryOf(result, watch.seconds());
  if (!o.picture.empty()) writeImage(o.picture, drawProjections(seen.volume, result.tree));
  writeVesselTree(o.out, result.tree, frameNamed(o.frame));
  if (!o.result.empty()) writeWholeFile(o.result, asJson(o, settings, summary, repairs).dump(2) + "\n");
  std::printf("%d trees, %d branches, %d ends, %.1f mm, %d cycles cut, %d small trees dropped, %.1f s\n", summary.trees,
              summary.branches, summary.ends, summary.length_mm, summary.cycles_cut, summary.small_trees_dropped,
              summary.seconds);
  constexpr std::size_t kPlaces = 5;  // All of them are in the result.
  for (const std::string& line : repairLines(repairs, frameNamed(o.frame), kPlaces)) std::puts(line.c_str());
  if (!o.compare.empty()) compare(o, result.tree, seen.volume.grid);
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Extracts a vessel tree from a volume.", "angio-extract-tree");
  angio::apps::describeProgram(
      app, "angio-extract-tree aorta.mha --threshold 1000 --seed 20,30,40 --out tree.csv --picture tree.png");
  angio::apps::Options o;
  app.addOption("volume", o.volume,
                "Volume (.mha, .mhd, .nii, .nii.gz, .nrrd, .nhdr), folder of a DICOM series, or surface (.stl, .obj, "
                ".vtp, .vtk)")
      ->required();
  app.addOption("--out", o.out, "Vessel tree (.csv, .swc, .vtp, .mrk.json, .tre)")->required();
  app.addOption("--mask", o.mask, "Label volume of the vessels; the volume itself is only shown");
  app.addOption(
         "--label", o.labels,
         "Label of vessels in the mask or volume; may be given again. A label map without it is not read, and its "
         "labels are listed")
      ->oneAtATime();
  app.addOption("--threshold", o.threshold, "Vessels are above this value; without it, what looks like a tube");
  app.addOption("--inside", o.inside, "Side of the threshold")->check(angio::cli::oneOf({"above", "below"}));
  app.addOption("--seed", o.seeds, "x,y,z [mm] in a vessel: only what is connected; may be given again")->oneAtATime();
  app.addOption("--root", o.root, "x,y,z [mm]: the tree begins at the end nearest to it");
  app.addOption("--ends", o.ends, "Where lines end: at the wall, or in the last sphere that fits, as VMTK's")
      ->check(angio::cli::oneOf({"wall", "sphere"}));
  app.addOption("--cycles", o.cycles, "Loops of vessels: cut each at one place, or refuse the input")
      ->check(angio::cli::oneOf({"cut", "refuse"}));
  app.addOption("--kissing", o.kissing, "Vessels that only touch: part them, or keep them as one tree")
      ->check(angio::cli::oneOf({"cut", "keep"}));
  app.addOption("--result", o.result, "What was found and mended, where, and all settings (.json)");
  app.addOption("--frame", o.frame, "Axes of the result, of seeds and of the root")
      ->check(angio::cli::oneOf({"LPS", "RAS"}));
  app.addOption("--box", o.box, "Two corners x,y,z [mm]: only what lies between them")->expected(2);
  app.addOption("--mesh-frame", o.mesh_frame, "Axes of a mesh")->check(angio::cli::oneOf({"LPS", "RAS"}));
  app.addOption("--mesh-voxel-mm", o.mesh_voxel_mm, "Voxels that a mesh is filled with [mm]")
      ->check(angio::apps::between(0.01, 20));
  angio::apps::addSettingsOptions(app, o.settings, "Settings (.yaml): vesselness, selection, centreline",
                                  angio::io::settingsInForce<angio::apps::ExtractionSettings>);
  app.addOption("--picture", o.picture, "Projections of the volume with the tree (.png, .jpg)");
  app.addOption("--compare", o.compare, "Another tree: prints how much of each lies near the other");
  app.addOption("--compare-frame", o.compare_frame, "Its axes, where its file does not say them")
      ->check(angio::cli::oneOf({"LPS", "RAS"}));
  app.addOption("--compare-mm", o.compare_mm, "What is near; default: the volume's smallest spacing")
      ->check(angio::apps::between(1e-3, 1e3));
  app.onRead([&] { angio::apps::readPoints(o); });
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::extract(o); });
}
