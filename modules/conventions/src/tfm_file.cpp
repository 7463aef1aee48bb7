// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/tfm_file.hpp"

#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "checks.hpp"
#include "itk_names.hpp"

namespace angio::conventions {
namespace {

constexpr const char* kHeading = "#Insight Transform File V1.0";
constexpr std::size_t kMaxTransformFile = std::size_t{1} << 20;

// What stands behind "Parameters:", if that is how the line begins.
std::optional<std::string_view> behind(std::string_view line, std::string_view key) {
  if (line.substr(0, key.size()) != key || line.substr(key.size(), 1) != ":") return std::nullopt;
  return trimmed(line.substr(key.size() + 1));
}

ItkTransformType typeOf(const std::string& place, std::string_view text) {
  std::vector<std::string> known;
  for (const auto& [name, type] : kItkTransforms) {
    for (const char* number : {"_double_3_3", "_float_3_3"}) {
      if (text == std::string(name) + number) return type;
    }
    known.emplace_back(name);
  }
  throw InputError(place, "Transform", std::string(text),
                   "must be one of " + joined(known) + " with _double_3_3 or _float_3_3");
}

std::vector<double> numbersIn(const std::string& place, const std::string& field, std::string_view text) {
  std::vector<std::string_view> words;
  splitAtBlanks(text, words);
  std::vector<double> numbers;
  for (const std::string_view word : words) numbers.push_back(parseNumber(place, field, word));
  return numbers;
}

std::string line(const char* key, const std::vector<double>& numbers) {
  std::string text = std::string(key) + ":";
  for (const double number : numbers) text += " " + exact(number);
  return text + "\n";
}

}  // namespace

ItkTransform readTfm(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxTransformFile);
  TextLines lines(path, content);
  if (!lines.next() || trimmed(lines.text()) != kHeading) {
    throw InputError(atLine(path, 1), "", "", std::string("must begin with ") + kHeading);
  }
  ItkTransform transform;
  bool typed = false, parameters = false, fixed = false;
  const auto once = [&](bool& given, const char* field) {
    if (given) throw InputError(lines.place(), field, "", "must stand once: files of one transform are read");
    if (field != std::string("Transform") && !typed)
      throw InputError(lines.place(), field, "", "must follow Transform");
    given = true;
  };
  while (lines.next()) {
    const std::string_view text = trimmed(lines.text());
    if (text.empty() || text.front() == '#') continue;
    if (const auto type = behind(text, "Transform")) {
      once(typed, "Transform");
      transform.type = typeOf(lines.place(), *type);
    } else if (const auto numbers = behind(text, "Parameters")) {
      once(parameters, "Parameters");
      transform.parameters = numbersIn(lines.place(), "Parameters", *numbers);
    } else if (const auto center = behind(text, "FixedParameters")) {
      once(fixed, "FixedParameters");
      transform.fixed_parameters = numbersIn(lines.place(), "FixedParameters", *center);
    } else {
      throw InputError(lines.place(), "", std::string(text.substr(0, 40)),
                       "must be a line of Transform:, Parameters: or FixedParameters:");
    }
  }
  if (!typed || !parameters || !fixed) {
    throw InputError(path, !typed ? "Transform" : !parameters ? "Parameters" : "FixedParameters", "", "is missing");
  }
  poseOf(transform, path);
  return transform;
}

void writeTfm(const std::string& path, const ItkTransform& transform) {
  for (const double x : transform.parameters) requireFinite(path, "Parameters", x);
  for (const double x : transform.fixed_parameters) requireFinite(path, "FixedParameters", x);
  writeWholeFile(path, std::string(kHeading) + "\n#Transform 0\nTransform: " + nameOf(transform.type, kItkTransforms) +
                           "_double_3_3\n" + line("Parameters", transform.parameters) +
                           line("FixedParameters", transform.fixed_parameters));
}

}  // namespace angio::conventions
