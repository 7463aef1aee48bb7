// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/joined.hpp"
#include "angio/conventions/namespace.hpp"
#include "angio/conventions/world_frame.hpp"
#include "angio/io/yaml.hpp"

namespace angio::conventions {

/// The names of an enum's values in files.
template <typename Enum, std::size_t N>
using Names = std::array<std::pair<const char*, Enum>, N>;

/// The first name of a value.
template <typename Enum, std::size_t N>
const char* nameOf(Enum value, const Names<Enum, N>& names) {
  for (const auto& [name, its_value] : names) {
    if (value == its_value) return name;
  }
  return "";
}

constexpr Names<ModelAxes, 3> kModelAxes = {
    {{"LPS", ModelAxes::kLps}, {"RAS", ModelAxes::kRas}, {"world", ModelAxes::kWorld}}};

constexpr double kFarthest_mm = 1e5;  // Of any point, as in pose files.
constexpr int kWidest_px = 32768;     // As in XrayCamera.

/// Reads the fields that a convention visits from the keys of a map. Each throws InputError with file, line and rule.
class FieldReader {
 public:
  explicit FieldReader(YamlMap& map) : map_(map) {}

  void number(const char* key, double& value) { value = map_.need(key).number(); }
  void length(const char* key, double& value_mm) { value_mm = map_.need(key).between(-kFarthest_mm, kFarthest_mm); }
  void positive(const char* key, double& value) { value = map_.need(key).positive(); }
  void pixels(const char* key, int& value) { value = map_.need(key).integer(1, kWidest_px); }
  template <typename Derived>
  void numbers(const char* key, Eigen::MatrixBase<Derived>& values) {
    const auto read = map_.need(key).numbers(static_cast<std::size_t>(values.size()), -1e9, 1e9);
    for (Eigen::Index k = 0; k < values.size(); ++k) values(k / values.cols(), k % values.cols()) = read[k];
  }
  void list(const char* key, std::vector<double>& values) {
    values.clear();
    for (const YamlField& item : map_.need(key).items("must be a list of numbers")) values.push_back(item.number());
  }
  template <typename Enum, std::size_t N>
  void choice(const char* key, Enum& value, const Names<Enum, N>& names) {
    const YamlField field = map_.need(key);
    std::vector<std::string> known;
    for (const auto& [name, its_value] : names) {
      if (field.text() == name) {
        value = its_value;
        return;
      }
      known.emplace_back(name);
    }
    field.refuse("must be one of " + joined(known));
  }
  void flag(const char* key, bool& value) { value = map_.need(key).flag(); }

  /// Visits a field only when its key is there: a default is left as it is.
  template <typename Visit>
  void whenGiven(const char* key, bool, const Visit& visit) {
    if (map_.find(key)) visit(*this);
  }

 private:
  YamlMap& map_;
};

/// Writes the fields that a convention visits as keys.
class FieldWriter {
 public:
  void number(const char* key, double value) { json_[key] = value; }
  void length(const char* key, double value_mm) { json_[key] = value_mm; }
  void positive(const char* key, double value) { json_[key] = value; }
  void pixels(const char* key, int value) { json_[key] = value; }
  template <typename Derived>
  void numbers(const char* key, const Eigen::MatrixBase<Derived>& values) {
    for (Eigen::Index k = 0; k < values.size(); ++k) json_[key].push_back(values(k / values.cols(), k % values.cols()));
  }
  void list(const char* key, const std::vector<double>& values) { json_[key] = values; }
  template <typename Enum, std::size_t N>
  void choice(const char* key, Enum value, const Names<Enum, N>& names) {
    json_[key] = nameOf(value, names);
  }
  void flag(const char* key, bool value) { json_[key] = value; }

  /// Visits a field only when it `differs` from what a reader takes without it.
  template <typename Visit>
  void whenGiven(const char*, bool differs, const Visit& visit) {
    if (differs) visit(*this);
  }

  nlohmann::ordered_json json() const { return json_; }

 private:
  nlohmann::ordered_json json_ = nlohmann::ordered_json::object();
};

/// Where the model lies in the other program's world: both keys may be left out.
template <typename Fields, typename Frame>
void visitWorld(Fields& fields, Frame& world) {
  fields.whenGiven("model_axes", true, [&](auto& f) { f.choice("model_axes", world.model_axes, kModelAxes); });
  fields.whenGiven("isocentre_mm", !world.isocenter_mm.isZero(0),
                   [&](auto& f) { f.numbers("isocentre_mm", world.isocenter_mm); });
}

}  // namespace angio::conventions
