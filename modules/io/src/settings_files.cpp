// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/settings_files.hpp"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/io/settings_values.hpp"
#include "angio/io/text.hpp"
#include "angio/io/yaml.hpp"

namespace angio::io {
namespace {

// What has become of keys of earlier versions, and what was said about the file's.
struct Former {
  const FormerKeys& table;
  std::vector<std::string> sections;  // The open ones, the outermost first.
  std::vector<std::string> warnings;

  void warn(const std::string& line) {
    if (std::find(warnings.begin(), warnings.end(), line) == warnings.end()) warnings.push_back(line);
  }
};

void readFields(const std::string& path, YamlNode node, const std::string& name,
                const std::function<void(SettingsVisitor&)>& visit_fields, Former& former);

class YamlReader final : public SettingsVisitor {
 public:
  YamlReader(const std::string& path, const YamlNode& node, const std::string& name, Former& former)
      : path_(path), map_(path, node, name), former_(former) {}

  void number(const char* key, double& value, double low, double high, const char*) override {
    if (const auto field = map_.find(key)) value = field->between(low, high);
  }
  void integer(const char* key, int& value, int low, int high, const char*) override {
    if (const auto field = map_.find(key)) value = field->integer(low, high);
  }
  void flag(const char* key, bool& value, const char*) override {
    if (const auto field = map_.find(key)) value = field->flag();
  }
  void numbers(const char* key, double* values, int count, double low, double high, const char*) override {
    const auto field = map_.find(key);
    if (!field) return;
    const auto found = field->numbers(static_cast<std::size_t>(count));
    for (const double value : found) requireBetween(field->place(), key, value, low, high);
    std::copy(found.begin(), found.end(), values);
  }
  void choiceIndex(const char* key, int& index, const std::vector<std::string>& names, const char*) override {
    const auto field = map_.find(key);
    if (!field) return;
    const auto at = std::find(names.begin(), names.end(), field->text());
    if (at == names.end()) field->refuse("must be one of " + joined(names));
    index = static_cast<int>(at - names.begin());
  }
  void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields, const char*) override {
    const auto field = map_.find(key);
    if (!field) return;
    former_.sections.push_back(key);
    readFields(path_, *field->node, key, visit_fields, former_);
    former_.sections.pop_back();
  }

  const YamlMap& map() const { return map_; }

 private:
  std::string path_;
  YamlMap map_;
  Former& former_;
};

// Takes former keys out of a map whose settings have asked for theirs, or gives them their present names. Returns
// whether a key was renamed, so that the settings must ask again.
bool replaceFormerKeys(const std::string& path, YamlNode& node, const YamlMap& map, Former& former) {
  bool renamed = false;
  for (std::size_t i = node.keys.size(); i-- > 0;) {
    const std::string key = node.keys[i];
    if (map.knows(key)) continue;
    const std::string line = atLine(path, node.key_lines[i]) + ": " + key + " = " + formatValue(node.items[i]) + ": ";
    if (const auto now = former.table.nameNow(former.sections, key, map.asked())) {
      if (std::find(node.keys.begin(), node.keys.end(), *now) != node.keys.end()) {
        throw InputError(atLine(path, node.key_lines[i]), key, formatValue(node.items[i]),
                         "is called " + *now + " now, which is given too");
      }
      former.warn(line + "is called " + *now + " now");
      node.keys[i] = *now;
      renamed = true;
    } else if (former.table.isConstant(former.sections, key)) {
      former.warn(line + "is a constant now, ignored");
      node.keys.erase(node.keys.begin() + i);
      node.key_lines.erase(node.key_lines.begin() + i);
      node.items.erase(node.items.begin() + i);
    }
  }
  return renamed;
}

void readFields(const std::string& path, YamlNode node, const std::string& name,
                const std::function<void(SettingsVisitor&)>& visit_fields, Former& former) {
  YamlReader reader(path, node, name, former);
  visit_fields(reader);
  if (replaceFormerKeys(path, node, reader.map(), former)) {
    YamlReader again(path, node, name, former);
    visit_fields(again);
  }
  reader.map().refuseOthers();
}

// A document in memory as a file's would be read. It has no lines.
YamlNode nodeOf(const nlohmann::ordered_json& value) {
  constexpr int kNoLine = 0;
  YamlNode node;
  node.line = kNoLine;
  if (value.is_structured()) {
    node.kind = value.is_object() ? YamlNode::Kind::kMap : YamlNode::Kind::kSequence;
    for (const auto& item : value) node.items.push_back(nodeOf(item));
    if (value.is_object()) {
      for (const auto& item : value.items()) node.keys.push_back(item.key());
      node.key_lines.assign(node.keys.size(), kNoLine);
    }
  } else if (!value.is_null()) {
    node.kind = YamlNode::Kind::kScalar;
    node.quoted = value.is_string();
    // JSON has no word for a number that is not finite.
    node.scalar = value.is_string()         ? value.get<std::string>()
                  : value.is_number_float() ? exact(value.get<double>())
                                            : value.dump();
  }
  return node;
}

class JsonWriter final : public SettingsVisitor {
 public:
  nlohmann::ordered_json json = nlohmann::ordered_json::object();

  void number(const char* key, double& value, double, double, const char*) override { json[key] = value; }
  void integer(const char* key, int& value, int, int, const char*) override { json[key] = value; }
  void flag(const char* key, bool& value, const char*) override { json[key] = value; }
  void numbers(const char* key, double* values, int count, double, double, const char*) override {
    json[key] = std::vector<double>(values, values + count);
  }
  void choiceIndex(const char* key, int& index, const std::vector<std::string>& names, const char*) override {
    json[key] = names.at(static_cast<std::size_t>(index));
  }
  void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields, const char*) override {
    JsonWriter inner;
    visit_fields(inner);
    json[key] = std::move(inner.json);
  }
};

// Words that YAML takes for a text; all else is quoted.
std::string choiceText(const std::string& name) {
  static const std::set<std::string> kOtherwiseRead = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"};
  const bool plain = !name.empty() && !std::isdigit(static_cast<unsigned char>(name[0])) &&
                     name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos &&
                     kOtherwiseRead.count(name) == 0;
  return plain ? name : nlohmann::json(name).dump();
}

class YamlPrinter final : public SettingsVisitor {
 public:
  explicit YamlPrinter(std::string& text, int indent = 0) : text_(text), indent_(indent) {}

  void number(const char* key, double& value, double low, double high, const char* meaning) override {
    line(key, exact(value), meaning, exact(low) + " to " + exact(high));
  }
  void integer(const char* key, int& value, int low, int high, const char* meaning) override {
    line(key, std::to_string(value), meaning, std::to_string(low) + " to " + std::to_string(high));
  }
  void flag(const char* key, bool& value, const char* meaning) override {
    line(key, value ? "true" : "false", meaning, "true or false");
  }
  void numbers(const char* key, double* values, int count, double low, double high, const char* meaning) override {
    std::vector<std::string> each;
    for (int i = 0; i < count; ++i) each.push_back(exact(values[i]));
    line(key, "[" + joined(each) + "]", meaning, "each " + exact(low) + " to " + exact(high));
  }
  void choiceIndex(const char* key, int& index, const std::vector<std::string>& names, const char* meaning) override {
    line(key, choiceText(names.at(static_cast<std::size_t>(index))), meaning, "one of " + joined(names));
  }
  void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields,
               const char* meaning) override {
    text_ += margin() + key + ":" + (*meaning ? std::string("  # ") + meaning : "") + "\n";
    YamlPrinter inner(text_, indent_ + 2);
    visit_fields(inner);
  }

 private:
  std::string margin() const { return std::string(static_cast<std::size_t>(indent_), ' '); }

  void line(const std::string& key, const std::string& value, const std::string& meaning, const std::string& values) {
    text_ += margin() + key + ": " + value + "  # " + meaning + "; " + values + "\n";
  }

  std::string& text_;
  int indent_;
};

}  // namespace

void readSettings(const std::string& path, const std::function<void(SettingsVisitor&)>& visit_fields,
                  const FormerKeys& table, std::ostream& warnings) {
  Former former{table, {}, {}};
  readFields(path, readYaml(path), "settings", visit_fields, former);
  for (const std::string& line : former.warnings) warnings << line << "\n";
}

void setSettings(const std::string& name, const nlohmann::ordered_json& values,
                 const std::function<void(SettingsVisitor&)>& visit_fields, const FormerKeys& table,
                 std::ostream& warnings) {
  Former former{table, {}, {}};
  readFields(name, nodeOf(values), name, visit_fields, former);
  for (const std::string& line : former.warnings) warnings << line << "\n";
}

nlohmann::ordered_json settingsAsJson(const std::function<void(SettingsVisitor&)>& visit_fields) {
  JsonWriter writer;
  visit_fields(writer);
  return std::move(writer.json);
}

std::string settingsAsYaml(const std::function<void(SettingsVisitor&)>& visit_fields) {
  std::string text;
  YamlPrinter printer(text);
  visit_fields(printer);
  return text;
}

namespace {

// Whether an entry of the table, "ridge.sigma" or "sigma", means a key of these sections.
bool means(const std::string& entry, const std::vector<std::string>& sections, const std::string& key) {
  std::string path;
  for (const std::string& section : sections) path += "." + section;
  path += "." + key;
  return endsWith(path, "." + entry);
}

constexpr const char* kConstants = R"(
    acceleration_mean_s acceleration_std_mm_s2 ahead_mm aim_mm along_std_mm along_stiffness amplitude_memory_s
    angle_deg angular_acceleration_std_deg_s2 back_mm background_px background_structure_mm backlash_mm behind_mm
    braking_share breathing_harmonics breaths_to_learn clearly_better clock_drift_ppm cone_deg confirm_mm
    contact_force_n correlation_px dead_band_deg deformation_length_mm depth_std_mm diameter_factor dispersion
    disturbed_s drag_n_per_m drift_std_mm_s effort evidence faintest_absorption fallen_share
    first_angular_speed_std_deg_s first_speed_std_mm_s flex_std_deg flex_std_mm forgotten_deg_s forgotten_mm_s
    forgotten_share forward_mm frames_between_searches frames_to_resume gate halve_every heart_harmonics
    held_out_every hysteresis into_branch_mm judged_horizon_ms judged_over_s jump_probability largest_focal_sigma
    largest_misfit largest_offset_deg largest_offset_mm largest_outlier_share largest_sigma_mm largest_step_deg
    largest_stretch largest_turn_deg learn_s least_acceleration least_acceleration_deg_s2 least_acceleration_mm_s2
    least_contrast least_contrast_to_noise least_probability least_radius_mm least_share least_significance
    least_turn_deg lever_mm limit_margin_deg limit_margin_mm line_factor local_length_mm local_std_mm longest_gap_px
    longest_gap_s longest_horizon_ms look_sigma_deg lost_px marker_ratio max_iterations measured_rotation_std_deg
    measured_std_mm measured_translation_std_mm memory_frames model_std_px most_modes most_overspeed most_points
    most_points_2d most_shift_error_mm most_turn_deg near_mm near_std_mm node_mm noise_factor
    nonrigid_first_scale_px offset_walk_mm opacity_factor other_deg outlier_gate outlier_mass outlier_px
    outlier_sigma outlier_sigmas outlier_view_factor overlap_weight patience_s periods_ahead pixel_std_px
    pose_scatter_deg pose_scatter_mm prior_length_unit prior_widening reach_mm reached_frames recovery_s
    relative_contrast relative_density renew_mm retreat_mm roadmap_patience_s roll_std_deg rotation_step_deg rounds
    samples scale_std_percent scales scatter_sigma_mm segment_points sharpness shift_time_s short_mm
    shortest_branch_radii shortest_curve_px shortest_line_px shortest_piece_px shortest_px slack_mm slack_mm_per_rad
    slip_std slow_mm smoothing_mm smoothing_radii sound_s speed_std_mm_s stall_mm start_std_mm step_deg step_px
    stiffness_n_per_m sure_mm tip_std_px tip_stiffness_n_per_rad tracking_rotation_std_deg
    tracking_translation_std_mm turn_weight uniformity unknown_radius_mm unwind_mm view_within_deg view_within_mm
    washed_out_frames wind_up_deg_per_m)";

std::vector<std::string> wordsOf(const std::string& text) {
  std::istringstream words(text);
  return {std::istream_iterator<std::string>(words), {}};
}

}  // namespace

bool FormerKeys::isConstant(const std::vector<std::string>& sections, const std::string& key) const {
  return std::any_of(constants.begin(), constants.end(),
                     [&](const std::string& entry) { return means(entry, sections, key); });
}

std::optional<std::string> FormerKeys::nameNow(const std::vector<std::string>& sections, const std::string& key,
                                               const std::vector<std::string>& known) const {
  const auto isKnown = [&](const std::string& name) {
    return std::find(known.begin(), known.end(), name) != known.end();
  };
  for (const Renamed& entry : renamed) {
    if (means(entry.former, sections, key) && isKnown(entry.key)) return entry.key;
  }
  for (const Prefix& entry : prefixes) {
    if (key.compare(0, entry.former.size(), entry.former) != 0) continue;
    const std::string name = entry.prefix + key.substr(entry.former.size());
    if (isKnown(name)) return name;
  }
  return std::nullopt;
}

const FormerKeys& formerKeys() {
  static const FormerKeys table = {
      wordsOf(kConstants),
      // Renamed.
      {{"acceleration_std_mm_s2", "acceleration_std_mm_per_s2"},
       {"angle_accelerations_deg_s2", "angle_accelerations_deg_per_s2"},
       {"angle_sigma_deg", "angle_std_deg"},
       {"angle_speeds_deg_s", "angle_speeds_deg_per_s"},
       {"back_speed_mm_s", "back_speed_mm_per_s"},
       {"bend_speed_deg_s", "bend_speed_deg_per_s"},
       {"fork_speed_mm_s", "fork_speed_mm_per_s"},
       {"largest_bend_speed_deg_s", "max_bend_speed_deg_per_s"},
       {"largest_insertion_speed_mm_s", "max_insertion_speed_mm_per_s"},
       {"largest_roll_speed_deg_s", "max_roll_speed_deg_per_s"},
       {"largest_speed_mm_s", "max_speed_mm_per_s"},
       {"least_way_mm", "min_route_mm"},
       {"most_bend_mm", "max_deformation_mm"},
       {"most_correction_deg", "max_calibration_offset_deg"},
       {"most_correction_mm", "max_calibration_offset_mm"},
       {"most_jump_deg", "max_innovation_deg"},
       {"most_jump_depth_mm", "max_innovation_depth_mm"},
       {"most_jump_mm", "max_innovation_mm"},
       {"most_lag_deg", "max_following_error_deg"},
       {"most_lag_mm", "max_following_error_mm"},
       {"most_stray_deg", "max_deviation_deg"},
       {"most_stray_mm", "max_deviation_mm"},
       {"psf_sigma_mm", "psf_std_mm"},
       {"rehearsal", "scenario"},
       {"roll_speed_deg_s", "roll_speed_deg_per_s"},
       {"room", "lab"},
       {"shift_sigma_mm", "shift_std_mm"},
       {"sigma_px", "std_px"},
       {"speed_mm_s", "speed_mm_per_s"},
       {"table_accelerations_mm_s2", "table_accelerations_mm_per_s2"},
       {"table_speeds_mm_s", "table_speeds_mm_per_s"}},
      // Prefixes.
      {{"most_", "max_"},
       {"largest_", "max_"},
       {"longest_", "max_"},
       {"furthest_", "max_"},
       {"least_", "min_"},
       {"shortest_", "min_"},
       {"smallest_", "min_"}},
  };
  return table;
}

}  // namespace angio::io
