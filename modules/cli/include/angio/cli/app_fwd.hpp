// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

// For headers: only sources that define options need CLI11 itself, which angio/cli/program.hpp includes.
namespace CLI {
class App;
class Option;
}  // namespace CLI
