// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/cli/program.hpp"

#include <algorithm>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <sstream>
#include <stdexcept>

namespace angio {
namespace {

int fail(const CLI::App& app, std::string line) {
  std::replace(line.begin(), line.end(), '\n', ' ');
  std::cerr << app.get_name() << ": " << line << "\n";
  return 1;
}

}  // namespace

std::string programVersion() { return ANGIO_VERSION; }

void describeProgram(CLI::App& app, const std::string& example) {
  app.set_version_flag("--version", app.get_name() + " " + programVersion());
  app.option_defaults()->always_capture_default();
  app.footer("Example:\n  " + example + "\n\nResearch software, not a medical device.");
}

CLI::Validator between(double low, double high) {
  std::ostringstream range;
  range << "FLOAT in [" << low << " - " << high << "]";
  const auto check = [low, high](const std::string& input) {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(input, value) && value >= low && value <= high;
    return good ? std::string()
                : "Value " + input + " must lie between " + CLI::detail::to_string(low) + " and " +
                      CLI::detail::to_string(high);
  };
  return CLI::Validator(check, range.str());
}

int runProgram(CLI::App& app, int argc, char** argv, const std::function<int()>& work) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  // A second thread is for the user to ask for; and images come out the same whatever the machine.
  cv::setNumThreads(1);
  try {
    const int code = work();
    if (!std::cout.flush()) throw std::runtime_error("stdout: cannot be written");
    return code;
  } catch (const std::exception& error) {
    return fail(app, error.what());
  }
}

}  // namespace angio
