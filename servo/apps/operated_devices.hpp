// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <map>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/cli/program.hpp"
#include "angio/servo/operator.hpp"

namespace angio::apps {

/// The option --machine.
inline void addMachineOption(CLI::App& app, OperatedMachine& machine, const std::string& what) {
  static const std::map<std::string, OperatedMachine> kMachines{{"c-arm", OperatedMachine::kCArm},
                                                                {"catheter", OperatedMachine::kCatheter}};
  app.add_option("--machine", machine, what)->transform(choice(kMachines))->default_str("c-arm");
}

}  // namespace angio::apps
