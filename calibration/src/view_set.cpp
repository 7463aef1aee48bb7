// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/view_set.hpp"

#include <filesystem>
#include <map>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/table.hpp"
#include "angio/io/yaml.hpp"
#include "grid_photograph.hpp"

namespace angio::calibration {
namespace {

constexpr double kMaxPixel_px = 32768;
constexpr int kMaxSeenBeads = 2000;

std::optional<double> positiveIn(const TableRow& row, const char* column) {
  if (!row.has(column)) return std::nullopt;
  const auto value = row.numberOrBlank(column);
  if (value) requirePositive(row.place(), column, *value);
  return value;
}

}  // namespace

std::vector<BeadDetection> readBeadTable(const std::string& path) {
  std::vector<BeadDetection> beads;
  readTable(path, {{"x_px", "y_px"}, {"sigma_px", "radius_px", "contrast", "bead"}}, [&](const TableRow& row) {
    BeadDetection seen;
    const auto position = [&](const char* column) {
      return requireBetween(row.place(), column, row.number(column), -0.5, kMaxPixel_px);
    };
    seen.center_px = {position("x_px"), position("y_px")};
    seen.std_px = positiveIn(row, "sigma_px").value_or(1);
    seen.radius_px = positiveIn(row, "radius_px");
    seen.contrast = positiveIn(row, "contrast");
    if (row.has("bead") && !row.text("bead").empty()) {
      seen.bead = row.integer("bead");
      requireBetween(row.place(), "bead", *seen.bead, 0, kMaxSeenBeads - 1);
    }
    if (!beads.empty() && beads.front().bead.has_value() != seen.bead.has_value()) {
      throw InputError(row.place(), "bead", std::string(row.text("bead")), "must be given for all beads or for none");
    }
    if (beads.size() == kMaxSeenBeads) throw InputError(row.place(), "", "", "there must not be more than 2000 beads");
    beads.push_back(seen);
  });
  return beads;
}

namespace {

constexpr int kMaxSide_px = 32768;

std::string besideFile(const std::string& file, const YamlField& field) {
  return (std::filesystem::path(file).parent_path() / field.text()).lexically_normal().string();
}

std::optional<CArmJoints> joints(YamlMap& map) {
  if (!map.find("primary_deg") && !map.find("secondary_deg") && !map.find("table_mm")) return std::nullopt;
  return readJoints(map);
}

PhantomView readView(const std::string& path, const YamlField& field) {
  YamlMap map(path, *field.node, field.key);
  PhantomView view;
  view.name = map.need("name").text();
  const auto image = map.find("image"), beads = map.find("beads");
  if (image.has_value() == beads.has_value()) {
    throw InputError(field.place(), field.key, "", "must have either an image or a table of beads");
  }
  view.path = besideFile(path, image ? *image : *beads);
  view.is_table = beads.has_value();
  view.joints = joints(map);
  if (const auto distance = map.find("source_detector_distance_mm")) {
    view.source_detector_distance_m = 1e-3 * distance->between(100, 5000);
  }
  if (const auto held_out = map.find("held_out")) view.held_out = held_out->flag();
  if (const auto machine = map.find("machine")) view.machine = machine->text();
  map.refuseOthers();
  return view;
}

constexpr int kMaxMarksInRow = 44;  // As many rows, and no more than kMaxSeenBeads in all.

FlatPattern readPattern(const YamlField& field, bool chessboard) {
  YamlMap map(field.path, *field.node, field.key);
  FlatPattern pattern;
  const YamlField size = map.need(chessboard ? "corners" : "circles");
  const auto sides = size.items("must be a list of 2 integers: in a row, and rows", 2, 2);
  pattern.columns = sides[0].integer(2, kMaxMarksInRow);
  pattern.rows = sides[1].integer(2, kMaxMarksInRow);
  pattern.spacing_m = 1e-3 * map.need(chessboard ? "square_mm" : "spacing_mm").between(0.1, 1000);
  const auto shifted = chessboard ? std::nullopt : map.find("shifted");
  pattern.kind = chessboard                   ? FlatPattern::Kind::kChessboard
                 : shifted && shifted->flag() ? FlatPattern::Kind::kShiftedCircles
                                              : FlatPattern::Kind::kCircles;
  map.refuseOthers();
  return pattern;
}

// What the views are of: one of three keys.
void readPhantom(const std::string& path, YamlMap& map, ViewSet& set) {
  const auto chessboard = map.find("chessboard"), circles = map.find("circle_grid");
  if (!chessboard && !circles) {
    set.phantom_path = besideFile(path, map.need("phantom"));
    return;
  }
  if ((chessboard && circles) || map.find("phantom")) {
    (chessboard ? *chessboard : *circles).refuse("must be the only one of phantom, chessboard and circle_grid");
  }
  set.pattern = readPattern(chessboard ? *chessboard : *circles, chessboard.has_value());
}

}  // namespace

BeadPhantom phantomOf(const ViewSet& set) {
  return set.pattern ? phantomOf(*set.pattern) : readBeadPhantom(set.phantom_path);
}

ViewSet readViewSet(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "view set");
  ViewSet set;
  set.path = path;
  if (const auto machine = map.find("machine")) set.machine = machine->text();
  readPhantom(path, map, set);
  if (const auto size = map.find("image_size_px")) {
    const std::vector<double> sides = size->numbers(2);
    for (std::size_t i = 0; i < 2; ++i) {
      requireBetween(size->item(i).place(), size->item(i).key, size->item(i).integer(), 1, kMaxSide_px);
    }
    set.image_width_px = static_cast<int>(sides[0]);
    set.image_height_px = static_cast<int>(sides[1]);
  }
  if (const auto spacing = map.find("pixel_spacing_mm")) set.pixel_spacing_m = 1e-3 * spacing->positive();
  const YamlField views = map.need("views");
  map.refuseOthers();
  std::map<std::string, std::string> names, paths;  // To the key of the view that had them first.
  for (const YamlField& field : views.items("must be a list of at least one view", 1)) {
    PhantomView view = readView(path, field);
    if (const auto [at, fresh] = names.emplace(view.name, field.key); !fresh) {
      throw InputError(field.place(), field.key + ".name", view.name, "is the name of " + at->second + " already");
    }
    if (const auto [at, fresh] = paths.emplace(view.path, field.key); !fresh) {
      throw InputError(field.place(), field.key, view.path, "is the file of " + at->second + " already");
    }
    if (set.machine.empty()) set.machine = view.machine;
    if (!view.machine.empty() && view.machine != set.machine) {
      throw InputError(field.place(), field.key + ".machine", view.machine,
                       "must be of one machine with the others, " + set.machine);
    }
    if (view.is_table && set.image_width_px == 0) {
      throw InputError(path, "image_size_px", "", "is missing: views that are tables of beads do not tell it");
    }
    set.views.push_back(std::move(view));
  }
  return set;
}

std::vector<CalibrationInput> hashedViews(const ViewSet& set) {
  std::vector<CalibrationInput> inputs;
  std::map<std::string, std::string> first;  // From hash to name.
  for (const PhantomView& view : set.views) {
    inputs.push_back(hashedInput(view.path));
    const auto [at, fresh] = first.emplace(inputs.back().sha256, view.name);
    if (!fresh) {
      throw InputError(set.path, "views", view.name,
                       "is a copy of " + at->second + ": every view must be a measurement of its own");
    }
  }
  return inputs;
}

namespace {

std::vector<BeadDetection> beadsOf(const PhantomView& view, const BeadPhantom& phantom,
                                   const std::optional<FlatPattern>& pattern, const BeadDetectionSettings& settings,
                                   DetectorOfViews& detector) {
  if (view.is_table) return readBeadTable(view.path);
  if (!phantom.isCoded() && !pattern) {
    throw InputError(view.path, "image", "",
                     "must be a table: the phantom " + phantom.name +
                         " is a grid of marks; photographs are read of a chessboard or a circle_grid");
  }
  const cv::Mat image = readXrayImage(view.path);
  if (detector.width_px == 0) {
    detector.width_px = image.cols;
    detector.height_px = image.rows;
  }
  if (image.cols != detector.width_px || image.rows != detector.height_px) {
    throw InputError(view.path, "image_size_px", std::to_string(image.cols) + " x " + std::to_string(image.rows),
                     "must be " + std::to_string(detector.width_px) + " x " + std::to_string(detector.height_px) +
                         " as the view set or its first image says");
  }
  return pattern ? detectPattern(view.path, image, *pattern) : detectBeads(image, settings);
}

}  // namespace

SeenViewSet seenViews(const ViewSet& set, const BeadPhantom& phantom, const BeadDetectionSettings& settings,
                      const std::function<void(int done)>& progress) {
  SeenViewSet seen;
  seen.inputs = hashedViews(set);
  seen.detector = {set.image_width_px, set.image_height_px, set.pixel_spacing_m};
  std::vector<Eigen::Matrix3d> likely;
  for (const PhantomView& view : set.views) {
    std::vector<BeadDetection> beads = beadsOf(view, phantom, set.pattern, settings, seen.detector);
    BeadView labelled{view.name,
                      {},
                      view.source_detector_distance_m,
                      view.held_out,
                      view.joints.value_or(CArmJoints(CArmJoints::Zero()))};
    if (beads.empty() || !beads.front().bead) {
      if (!phantom.isCoded()) {
        throw InputError(view.path, "bead", "", "is missing: marks of " + phantom.name + " have no sizes to tell by");
      }
      const BeadMatch match = matchBeads(view.path, phantom, beads, likely);
      likely.insert(likely.begin(), match.R_camera_phantom);
      for (std::size_t i = 0; i < beads.size(); ++i) beads[i].bead = match.bead[i];
    }
    for (const BeadDetection& bead : beads) {
      if (bead.bead) labelled.beads.push_back({*bead.bead, bead.center_px, bead.std_px});
    }
    seen.views.push_back(std::move(labelled));
    if (progress) progress(static_cast<int>(seen.views.size()));
  }
  return seen;
}

}  // namespace angio::calibration
