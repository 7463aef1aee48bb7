// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/cli/namespace.hpp"

namespace angio::cli {

/// Path of a file of the bundled example data ("hepatic-tace/tree.csv"): beside the build's programs in the checkout,
/// or in share/angio/data of an installation. When neither is there, the checkout's path, for the message that it is
/// missing.
std::string exampleDataFile(const std::string& name);

}  // namespace angio::cli
