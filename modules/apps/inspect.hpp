// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"

namespace angio::apps {

/// One thing a person wants to know of a file: for people a label and words, for programs a key with its unit and a
/// value.
struct Finding {
  std::string label;
  std::string words;
  std::string key;
  nlohmann::ordered_json value;
};

/// What a DICOM run says of itself and of one frame; no name or number of a patient. Throws InputError as XaRun.
std::vector<Finding> inspectRun(const std::string& path, int frame);

/// A number for people: four digits behind the point at most, and the unit after a blank.
std::string inWords(double number, const std::string& unit);

}  // namespace angio::apps
