// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/settings_files.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/io/yaml.hpp"

namespace angio {
namespace {

class YamlReader final : public SettingsVisitor {
 public:
  YamlReader(const std::string& path, const YamlNode& node, const std::string& name)
      : path_(path), map_(path, node, name) {}

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
    YamlReader inner(path_, *field->node, key);
    visit_fields(inner);
    inner.refuseOthers();
  }

  void refuseOthers() const { map_.refuseOthers(); }

 private:
  std::string path_;
  YamlMap map_;
};

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

void readSettings(const std::string& path, const std::function<void(SettingsVisitor&)>& visit_fields) {
  const YamlNode root = readYaml(path);
  YamlReader reader(path, root, "settings");
  visit_fields(reader);
  reader.refuseOthers();
}

nlohmann::ordered_json settingsAsJson(const std::function<void(SettingsVisitor&)>& visit_fields) {
  JsonWriter writer;
  visit_fields(writer);
  return std::move(writer.json);
}

}  // namespace angio
