// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/settings_files.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
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

  void number(const char* key, double& value, double low, double high) override {
    if (const auto field = map_.find(key)) value = requireBetween(field->place(), key, field->number(), low, high);
  }
  void integer(const char* key, int& value, int low, int high) override {
    const auto field = map_.find(key);
    if (!field) return;
    const int found = field->integer();
    requireBetween(field->place(), key, found, low, high);
    value = found;
  }
  void flag(const char* key, bool& value) override {
    if (const auto field = map_.find(key)) value = field->flag();
  }
  void numbers(const char* key, double* values, int count, double low, double high) override {
    const auto field = map_.find(key);
    if (!field) return;
    const auto found = field->numbers(static_cast<std::size_t>(count));
    for (const double value : found) requireBetween(field->place(), key, value, low, high);
    std::copy(found.begin(), found.end(), values);
  }
  void choiceIndex(const char* key, int& index, const std::vector<std::string>& names) override {
    const auto field = map_.find(key);
    if (!field) return;
    const auto at = std::find(names.begin(), names.end(), field->text());
    if (at == names.end()) {
      std::string known;
      for (const auto& name : names) known += (known.empty() ? "" : ", ") + name;
      field->refuse("must be one of " + known);
    }
    index = static_cast<int>(at - names.begin());
  }
  void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields) override {
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
    const auto at = static_cast<std::ptrdiff_t>(i);
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
      node.keys.erase(node.keys.begin() + at);
      node.key_lines.erase(node.key_lines.begin() + at);
      node.items.erase(node.items.begin() + at);
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

class JsonWriter final : public SettingsVisitor {
 public:
  nlohmann::ordered_json json = nlohmann::ordered_json::object();

  void number(const char* key, double& value, double, double) override { json[key] = value; }
  void integer(const char* key, int& value, int, int) override { json[key] = value; }
  void flag(const char* key, bool& value) override { json[key] = value; }
  void numbers(const char* key, double* values, int count, double, double) override {
    json[key] = std::vector<double>(values, values + count);
  }
  void choiceIndex(const char* key, int& index, const std::vector<std::string>& names) override {
    json[key] = names.at(static_cast<std::size_t>(index));
  }
  void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields) override {
    JsonWriter inner;
    visit_fields(inner);
    json[key] = std::move(inner.json);
  }
};

}  // namespace

void readSettings(const std::string& path, const std::function<void(SettingsVisitor&)>& visit_fields,
                  const FormerKeys& table, std::ostream& warnings) {
  Former former{table, {}, {}};
  readFields(path, readYaml(path), "settings", visit_fields, former);
  for (const std::string& line : former.warnings) warnings << line << "\n";
}

nlohmann::ordered_json settingsAsJson(const std::function<void(SettingsVisitor&)>& visit_fields) {
  JsonWriter writer;
  visit_fields(writer);
  return std::move(writer.json);
}

}  // namespace angio::io
