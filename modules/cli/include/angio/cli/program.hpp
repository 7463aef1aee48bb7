// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/cli/command_line.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/cli/run_time.hpp"

namespace angio::cli {

/// The version all programs print.
std::string programVersion();

/// Gives a program --version, and --help that ends with `example`.
void describeProgram(Command& app, const std::string& example);

/// Gives a program or one of its sub-commands --settings, whose file is `path`, and --print-settings, which ends the
/// program with exit code 0 once `as_yaml(path)` is on stdout, whatever else the command line lacks; `path` is empty
/// when no file is given. Options that `as_yaml` depends on must have been added before.
void addSettingsOptions(Command& app, std::string& path, const std::string& help,
                        const std::function<std::string(const std::string& path)>& as_yaml);

/// Parses the command line and runs `work`, which returns the exit code, with one OpenCV thread.
///
/// Exit codes: 0 done, --help, --version and --print-settings; 1 wrong input or failed work, with one line on stderr (a
/// result that stdout does not take is failed work); 2 wrong command line; 3 see kExitNotReached.
int runProgram(Command& app, int argc, char** argv, const Work& work);

/// Reads a command line that stands in a file, the words behind the program's name. Throws InputError with `place`
/// where runProgram() would end with exit code 2, or with 0 before any work.
void readArguments(Command& app, const std::string& place, std::vector<std::string> arguments);

}  // namespace angio::cli
