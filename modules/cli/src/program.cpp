// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/cli/program.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <iostream>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/interruption.hpp"
#include "angio/cli/further_options.hpp"

namespace angio::cli {
namespace {

volatile std::sig_atomic_t ended = 0;

int fail(const Command& app, std::string line) {
  std::replace(line.begin(), line.end(), '\n', ' ');
  std::cerr << app.name() << ": " << line << "\n";
  return 1;
}

// Options' names of the version before, for one minor version.
constexpr std::pair<const char*, const char*> kFormerOptions[] = {
    {"--largest-calibration-age-days", "--max-calibration-age-days"},
    {"--least-turn-deg", "--min-turn-deg"},
    {"--longest-edge-mm", "--max-edge-mm"}};

// The command line with options under their present names; says so on stderr for each that was renamed.
std::vector<std::string> withPresentNames(const Command& app, std::vector<std::string> arguments) {
  for (std::string& argument : arguments) {
    const std::string name = argument.substr(0, argument.find('='));
    for (const auto& [former, present] : kFormerOptions) {
      if (name != former) continue;
      std::cerr << app.name() << ": " << former << " is called " << present << " now\n";
      argument = present + argument.substr(name.size());
    }
  }
  return arguments;
}

// Help that names further options only when all is asked for.
class ShortHelp final : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
    all_ = mode == CLI::AppFormatMode::All;
    return Formatter::make_help(app, std::move(name), mode);
  }

  std::string make_group(std::string group, bool is_positional,
                         std::vector<const CLI::Option*> options) const override {
    if (!all_ && group == kFurtherOptions) return "Further options: --help-all\n";
    return Formatter::make_group(std::move(group), is_positional, std::move(options));
  }

 private:
  mutable bool all_ = false;
};

void shortenHelp(CLI::App& app, const std::shared_ptr<ShortHelp>& formatter) {
  app.formatter(formatter);
  // A group of options is an application without a name.
  if (!app.get_name().empty()) app.set_help_all_flag("--help-all", "Print this help with all options and exit");
  for (CLI::App* command : app.get_subcommands({})) shortenHelp(*command, formatter);
}

}  // namespace

std::string programVersion() { return ANGIO_VERSION; }

void describeProgram(Command& app, const std::string& example) {
  app.app().set_version_flag("--version", app.name() + " " + programVersion());
  app.app().option_defaults()->always_capture_default();
  app.footer("Example:\n  " + example + "\n\nResearch software, not a medical device.");
}

void addSettingsOptions(Command& app, std::string& path, const std::string& help,
                        const std::function<std::string(const std::string& path)>& as_yaml) {
  app.addOption("--settings", path, help);
  // Like --help it goes before the check of what is required; options are read in the order in which they were added.
  const auto print = [&path, as_yaml] {
    if (!(std::cout << as_yaml(path)).flush()) throw std::runtime_error("stdout: cannot be written");
    throw CLI::Success();
  };
  app.addFlag("--print-settings", print,
              "Print all settings with their meanings and ranges, for a file of --settings, and exit")
      ->group(kFurtherOptions);
}

int runProgram(Command& app, int argc, char** argv, const Work& work) {
  std::vector<std::string> arguments = withPresentNames(app, {argv, argv + argc});
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  shortenHelp(app.app(), std::make_shared<ShortHelp>());
  try {
    app.app().parse(argc, pointers.data());
  } catch (const CLI::ParseError& error) {
    return app.app().exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {  // Of settings that were to be printed.
    return fail(app, error.what());
  }
  // A second thread is for the user to ask for; and images come out the same whatever the machine.
  cv::setNumThreads(1);
  try {
    const int code = work();
    if (!std::cout.flush()) throw std::runtime_error("stdout: cannot be written");
    if (interrupted()) return fail(app, "interrupted: what was finished before is reported, and no more");
    return code;
  } catch (const std::exception& error) {
    return fail(app, error.what());
  }
}

void readArguments(Command& app, const std::string& place, std::vector<std::string> arguments) {
  arguments = withPresentNames(app, std::move(arguments));
  std::reverse(arguments.begin(), arguments.end());  // As CLI11 takes them.
  try {
    app.app().parse(std::move(arguments));
  } catch (const CLI::ParseError& error) {
    std::string why = std::string(error.what()).substr(0, 200);
    std::replace_if(
        why.begin(), why.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
    throw InputError(place, "arguments", "", "are not understood: " + why);
  }
}

RunTime::RunTime(double duration_s) : duration_s_(duration_s) {
  for (const int number : {SIGINT, SIGTERM}) std::signal(number, [](int) { end(); });
}

bool RunTime::over() const { return ended != 0 || (duration_s_ > 0 && elapsed_s() >= duration_s_); }

double RunTime::elapsed_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
}

void RunTime::end() { ended = 1; }

}  // namespace angio::cli
