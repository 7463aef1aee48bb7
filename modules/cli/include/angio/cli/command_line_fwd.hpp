// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/cli/namespace.hpp"

// For headers: only sources that define options need the types themselves.
namespace angio::cli {

class Command;
class Option;

/// What a program does, or the sub-command that its command line chose; returns the exit code.
using Work = std::function<int()>;

}  // namespace angio::cli
