// SPDX-License-Identifier: GPL-2.0-or-later
// angio-check-machine: whether a C-arm and an X-ray on the bus keep what the messages promise.
#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/machine_check/machine_check.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/types/channels.hpp"
#include "program_bus.hpp"
#include "servo_settings.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string bus = cli::kUsualBus, key_file, settings, json;
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  MachineCheckSettings check;
};

constexpr std::int64_t kPeriod_us = 20'000;  // Of commands.

Json jsonOf(const std::vector<CheckRow>& rows) {
  constexpr const char* kVerdicts[] = {"pass", "fail", "not_seen"};
  Json json = Json::array();
  for (const CheckRow& row : rows) {
    json.push_back({{"name", row.name},
                    {"verdict", kVerdicts[static_cast<int>(row.verdict)]},
                    {"measured", row.measured},
                    {"asked", row.asked}});
  }
  return json;
}

// A command with NaN in it is refused where messages are encoded: it is written over the bytes of one that stands
// still.
std::vector<std::uint8_t> bytesOf(CArmCommand command) {
  const bool broken = !command.velocity.allFinite();
  if (broken) command.velocity.setZero();
  std::vector<std::uint8_t> bytes = encode(command);
  constexpr std::size_t kVelocities = kCArmJointCount * sizeof(double);  // They stand last, big-endian.
  if (broken) bytes[bytes.size() - kVelocities] = 0x7f, bytes[bytes.size() - kVelocities + 1] = 0xf8;
  return bytes;
}

int check(const Options& o) {
  requireFolderOf(o.json);
  MachineCheckSettings settings = o.check;
  const VesselTree tree = readVesselTree(o.tree);
  const CArmCalibration calibration = readCArmCalibration(o.calibration, tree);
  settings.carm = calibration.carm;
  settings.T_dsa_cb = calibration.T_dsa_cb;
  settings.limits = readServoSettings(o.settings).loop(calibration).limits;
  const auto bus = openSharedBus(o.bus, "", o.key_file, "angio-check-machine");
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-check-machine: " << *warning << "\n";
  // Nobody else must steer the machine meanwhile; this program's own commands, as they come round, do not count.
  std::int64_t sent = 0, asked_us = 0;
  MessageQueue<CArmState> states(*bus, kCArmStateChannel);
  MessageQueue<XrayFrame> frames(*bus, kXrayFrameChannel);
  bool steered = false;
  std::string by;
  bus->overhear(kCArmCommandChannel, [&](const std::uint8_t* data, std::size_t size) {
    if (steered || !decode<CArmCommand>(data, size).value) return;
    steered = true;
    by = bus->sender();
  });
  MachineCheck machine(settings, tree);
  const RunTime run;
  std::string doing;
  while (!machine.finished() && !run.over()) {
    bus->handle(std::chrono::milliseconds(10));
    const std::int64_t now_us = monotonic_us();
    for (const CArmState& state : states.take()) machine.see(state, now_us);
    for (const XrayFrame& frame : frames.take()) machine.see(frame, now_us);
    if (steered) break;
    // Its own commands come round and end the wait: without a period each would be answered by the next.
    if (now_us - asked_us < kPeriod_us) continue;
    asked_us = now_us;
    if (const auto command = machine.command(now_us)) {
      bus->publish(kCArmCommandChannel, bytesOf(*command));
      ++sent;
    }
    if (machine.doing() != doing) std::cerr << (doing = machine.doing()) << "\n";
  }
  // Whatever ended it, the machine is told to stand.
  if ((run.over() || steered) && sent > 0) {
    CArmCommand rest;
    rest.sequence = sent + 1;
    rest.valid_for_us = 200'000;
    publish(*bus, kCArmCommandChannel, rest);
  }
  if (steered)
    throw InputError(o.bus, "CARM_COMMAND", "", "comes from another program, " + by + ": end that one first");
  const std::vector<CheckRow> rows = machine.rows();
  std::cout << table(rows);
  if (!o.json.empty()) writeWholeFile(o.json, jsonOf(rows).dump(2) + "\n");
  if (run.over()) std::cerr << "angio-check-machine: was ended before it had finished\n";
  return passed(rows) && !run.over() ? 0 : 1;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app(
      "Whether a C-arm and an X-ray on the bus keep what the messages promise: rates, clocks, units, geometry and "
      "orientation of the image by watching; with --move also sign, unit and axis of each joint by what the X-ray "
      "shows, latency, watchdog and stop. Exit code 1 when a row fails.",
      "angio-check-machine");
  angio::apps::describeProgram(app, "angio-check-machine --move --angle-deg 1 --table-mm 5");
  using angio::apps::between;
  angio::apps::Options o;
  app.addOption("--bus", o.bus, angio::cli::busHelp("Bus"));
  app.addOption("--key-file", o.key_file, "Key that the machine's commands are authenticated with");
  app.addOption("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt) of what the X-ray shows");
  app.addOption("--calibration", o.calibration, "C-arm geometry and T_dsa_cb (.yaml)");
  angio::apps::addSettingsOptions(app, o.settings, "Settings (.yaml), of which the section limits counts",
                                  angio::apps::servoSettingsAsYaml);
  auto* move = app.addFlag("--move", o.check.move, "Move each joint a little, out and back: nobody near the machine");
  app.addOption("--angle-deg", o.check.angle_deg, "How far, of the angles")->check(between(0.1, 10))->needs(move);
  app.addOption("--table-mm", o.check.table_mm, "How far, of the table")->check(between(0.5, 50))->needs(move);
  app.addOption("--watch-s", o.check.watch_s, "How long it watches first")->check(between(0.5, 600));
  app.addOption("--json", o.json, "File for the table (.json)");
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::check(o); });
}
