// SPDX-License-Identifier: GPL-2.0-or-later
// angio-operator: arms, starts and stops a servo loop on the bus, and waits for its answer.
#include <chrono>
#include <iostream>
#include <map>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/program.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_state_machine.hpp"
#include "operated_devices.hpp"

namespace angio::apps {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  OperatedMachine machine = OperatedMachine::kCArm;
  std::string request, bus = cli::kUsualBus, key_file;
  double timeout_s = 3;
};

const std::map<std::string, ServoRequestKind> kRequests{{"arm", ServoRequestKind::kArm},
                                                        {"start", ServoRequestKind::kStart},
                                                        {"stop", ServoRequestKind::kStop},
                                                        {"emergency-stop", ServoRequestKind::kEmergencyStop},
                                                        {"reset", ServoRequestKind::kReset}};

// Whether the loop's state is what the request was about.
bool answers(ServoRequestKind request, ServoState state) {
  switch (request) {
    case ServoRequestKind::kArm:
      return state == ServoState::kArmed;
    case ServoRequestKind::kStart:
      return state == ServoState::kServo || state == ServoState::kHold;
    case ServoRequestKind::kStop:
    case ServoRequestKind::kReset:
      return state == ServoState::kIdle;
    case ServoRequestKind::kEmergencyStop:
      return state == ServoState::kEmergencyStop;
  }
  return false;
}

int ask(const Options& o) {
  const ServoRequestKind kind = kRequests.at(o.request);
  const auto bus = withKeyFile(openSharedBus(o.bus), o.key_file,
                               [](const std::string& line) { std::cerr << "angio-operator: " << line << "\n"; });
  if (const auto warning = unprotectedWarning(o.bus, o.key_file)) std::cerr << "angio-operator: " << *warning << "\n";
  Operator person(*bus, o.machine);
  const auto end = Clock::now() + std::chrono::duration<double>(o.timeout_s);
  // A stop does not wait to be told how things stand.
  bool asked = kind == ServoRequestKind::kStop || kind == ServoRequestKind::kEmergencyStop;
  if (asked) person.ask(kind, monotonic_us());
  while (Clock::now() < end) {
    bus->handle(std::chrono::milliseconds(20));
    if (!person.status()) continue;
    if (asked && answers(kind, person.status()->state)) {
      std::cout << nameOf(person.status()->state) << "\n";
      return 0;
    }
    if (!asked) person.ask(kind, monotonic_us());
    asked = true;
  }
  throw InputError(o.bus, "request", o.request,
                   person.status() ? std::string("was not obeyed: the loop is in ") + nameOf(person.status()->state) +
                                         (person.status()->reason.empty() ? "" : ", " + person.status()->reason)
                                   : "was not answered: no loop says how it stands");
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Arms, starts and stops a servo loop on the bus, and waits for its answer.",
                          "angio-operator");
  angio::apps::describeProgram(app, "angio-operator arm && angio-operator start; angio-operator emergency-stop");
  angio::apps::Options o;
  std::vector<std::string> names;
  for (const auto& [name, kind] : angio::apps::kRequests) names.push_back(name);
  app.addOption("request", o.request, "What is asked for")->required()->check(angio::cli::oneOf(names));
  angio::apps::addMachineOption(app, o.machine, "Whose loop is asked; an emergency stop stops both");
  app.addOption("--bus", o.bus, angio::cli::busHelp("Bus"));
  app.addOption("--key-file", o.key_file, angio::cli::kKeyFileHelp);
  app.addOption("--timeout-s", o.timeout_s, "How long to wait for the answer")->check(angio::apps::between(0.1, 3600));
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::ask(o); });
}
