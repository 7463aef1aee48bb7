// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <map>
#include <string>

#include "angio/cli/app_fwd.hpp"
#include "angio/cli/run_time.hpp"

namespace angio::cli {

/// The version all programs print.
std::string programVersion();

/// Gives a program --version, and --help that ends with `example`.
void describeProgram(CLI::App& app, const std::string& example);

/// Accepts a number within [low, high]; CLI::Range would let "nan" pass.
CLI::Validator between(double low, double high);

/// Accepts the names of choices and gives their values; --help lists the names, where CLI11's own text has the values
/// too, of which some are not printable.
template <typename T>
CLI::Validator choice(const std::map<std::string, T>& choices) {
  std::string names;
  for (const auto& [name, value] : choices) names += (names.empty() ? "{" : ",") + name;
  return CLI::CheckedTransformer(choices).description(names + "}");
}

/// Gives a program or one of its sub-commands --settings, whose file is `path`, and --print-settings, which ends the
/// program with exit code 0 once `as_yaml(path)` is on stdout, whatever else the command line lacks; `path` is empty
/// when no file is given. Options that `as_yaml` depends on must have been added before.
void addSettingsOptions(CLI::App& app, std::string& path, const std::string& help,
                        const std::function<std::string(const std::string& path)>& as_yaml);

/// Parses the command line and runs `work`, which returns the exit code, with one OpenCV thread.
///
/// Exit codes: 0 done, --help, --version and --print-settings; 1 wrong input or failed work, with one line on stderr (a
/// result that stdout does not take is failed work); 2 wrong command line; 3 see kExitNotReached.
int runProgram(CLI::App& app, int argc, char** argv, const Work& work);

}  // namespace angio::cli
