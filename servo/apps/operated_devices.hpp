// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <map>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/cli/program.hpp"
#include "angio/servo/operator.hpp"

namespace angio::apps {

/// The option --machine.
inline void addMachineOption(cli::Command& app, OperatedMachine& machine, const std::string& what) {
  static const std::map<std::string, OperatedMachine> kMachines{{"c-arm", OperatedMachine::kCArm},
                                                                {"catheter", OperatedMachine::kCatheter}};
  app.addOption("--machine", machine, what)->check(choice(kMachines))->defaultText("c-arm");
}

}  // namespace angio::apps
