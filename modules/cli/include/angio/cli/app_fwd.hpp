// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/cli/namespace.hpp"

// For headers: only sources that define options need CLI11 itself, which angio/cli/program.hpp includes.
namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace angio::cli {

/// What a program does, or the sub-command that its command line chose; returns the exit code.
using Work = std::function<int()>;

}  // namespace angio::cli
