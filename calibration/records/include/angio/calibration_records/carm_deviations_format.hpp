// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>

#include "angio/geometry/carm_deviations.hpp"
#include "angio/io/yaml.hpp"

namespace angio {

/// Reads the section `deviations` of a C-arm file. Throws InputError that names file, line, key and rule.
void readCArmDeviations(const YamlField& section, CArmDeviations& deviations);

/// The same section; an empty object when there are none.
nlohmann::ordered_json carmDeviationsAsJson(const CArmDeviations& deviations);

}  // namespace angio
