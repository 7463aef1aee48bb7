// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/view_set.hpp"

#include <filesystem>
#include <map>

#include "angio/base/errors.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/yaml.hpp"

namespace angio::calibration {
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
    view.source_detector_distance_m =
        1e-3 * requireBetween(distance->place(), distance->key, distance->number(), 100, 5000);
  }
  if (const auto held_out = map.find("held_out")) view.held_out = held_out->flag();
  if (const auto machine = map.find("machine")) view.machine = machine->text();
  map.refuseOthers();
  return view;
}

}  // namespace

ViewSet readViewSet(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "view set");
  ViewSet set;
  set.path = path;
  if (const auto machine = map.find("machine")) set.machine = machine->text();
  set.phantom_path = besideFile(path, map.need("phantom"));
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
  if (views.node->kind != YamlNode::Kind::kSequence || views.node->items.empty()) {
    views.refuse("must be a list of at least one view");
  }
  std::map<std::string, std::string> names, paths;  // To the key of the view that had them first.
  for (std::size_t i = 0; i < views.node->items.size(); ++i) {
    const YamlField field = views.item(i);
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

}  // namespace angio::calibration
