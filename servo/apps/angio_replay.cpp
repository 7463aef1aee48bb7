// SPDX-License-Identifier: GPL-2.0-or-later
// angio-replay: a log of the bus through the same loop again.
#include <iostream>
#include <optional>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/navigation/catheter_node.hpp"
#include "angio/recording/log_conversion.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/replay.hpp"
#include "angio/servo/servo_node.hpp"
#include "navigate_options.hpp"
#include "operated_devices.hpp"
#include "recorded_run.hpp"
#include "servo_settings.hpp"

namespace angio::apps {
namespace {

constexpr int kBarSteps = 1000;

struct Options {
  std::string log, tree = exampleDataFile("hepatic-tace/tree.csv"),
                   calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string settings, out, to_mcap, to_lcm, compression = "zstd";
  OperatedMachine machine = OperatedMachine::kCArm;
  LoopOptions loop;
  RouteOptions way;
  bool compare = false, ask_for_views = false;
};

// What a replay gives: a row for each command, and what became of all.
struct Replayed {
  std::string table;
  ReplaySummary summary;
};

// Numbers with all their digits: read again, they are the same bits.
template <typename Command>
std::string row(const Command& c, const std::vector<double>& velocity, bool held,
                const std::optional<Command>& logged) {
  std::string text =
      formatted("%lld,%lld,%lld,%lld", static_cast<long long>(c.frame_sequence), static_cast<long long>(c.time_us),
                static_cast<long long>(c.sequence), static_cast<long long>(c.valid_for_us));
  for (const double v : velocity) text += formatted(",%.17g", v);
  return text + (held ? ",1" : ",0") + (!logged ? "," : difference(c, *logged) ? ",0" : ",1") + "\n";
}

Replayed replayCArm(const Options& o, ProgressBar& bar) {
  ServoSettings settings = readServoSettings(o.settings);
  o.loop.applyTo(settings);
  const VesselTree tree = readVesselTree(o.tree);
  const ServoLoopSettings loop = settings.loop(readCArmCalibration(o.calibration, tree));
  Replayed result{
      "frame_sequence,utime_us,sequence,valid_for_us,primary_rad_per_s,secondary_rad_per_s,table_x_m_per_s,"
      "table_y_m_per_s,table_z_m_per_s,held,as_logged\n",
      {}};
  const auto watch = [&](const ReplayedFrame<ServoLoop>& f) {
    const CArmCommand& c = f.report.command;
    result.table += row(c, {c.velocity.begin(), c.velocity.end()}, f.report.hold_reason.has_value(), f.logged);
    bar.show(static_cast<int>(kBarSteps * f.part));
  };
  result.summary = replay<ServoLoop>(o.log, watch, loop, tree);
  return result;
}

Replayed replayDrive(const Options& o, ProgressBar& bar) {
  NavigateSettings settings = readNavigateSettings(o.settings);
  settings.controller.ask_for_views |= o.ask_for_views;
  const VesselTree tree = readVesselTree(o.tree);
  const TreeTopology map(tree);
  const CArmSetup stage = settings.stage(readCArmCalibration(o.calibration, tree));
  Replayed result{
      "frame_sequence,utime_us,sequence,valid_for_us,insertion_m_per_s,roll_rad_per_s,bend_rad_per_s,held,as_logged\n",
      {}};
  const auto watch = [&](const ReplayedFrame<CatheterController>& f) {
    const CatheterCommand& c = f.report.command;
    result.table += row(c, {c.insertion_speed_m_per_s, c.roll_speed_rad_per_s, c.bend_speed_rad_per_s},
                        f.report.hold_reason.has_value(), f.logged);
    bar.show(static_cast<int>(kBarSteps * f.part));
  };
  result.summary =
      replay<CatheterController>(o.log, watch, stage, tree, o.way.start(map), o.way.target(map), settings.controller);
  return result;
}

Replayed replayMachine(const Options& o) {
  const bool drive = o.machine == OperatedMachine::kCatheter;
  if (!drive && o.way.to_branch) {
    throw InputError("command line", "--to-branch", std::to_string(*o.way.to_branch), "needs --machine catheter");
  }
  if (drive && o.loop.given()) throw InputError("command line", "--machine", "catheter", "has no task of a C-arm");
  ProgressBar bar("replaying", kBarSteps);
  return drive ? replayDrive(o, bar) : replayCArm(o, bar);
}

std::string settingsInForce(const Options& o) {
  if (o.machine == OperatedMachine::kCatheter) return navigateSettingsAsYaml(o.settings);
  ServoSettings settings = readServoSettings(o.settings);
  o.loop.applyTo(settings);
  return settingsAsYaml(settings);
}

void warnOf(const Options& o, std::int64_t skipped_bytes, bool whole) {
  if (skipped_bytes > 0) {
    std::cerr << "angio-replay: " << o.log << ": " << skipped_bytes << " bytes are no messages\n";
  }
  if (!whole) std::cerr << "angio-replay: " << o.log << ": its recording was cut: it has no end\n";
}

int convertLog(const Options& o) {
  const std::string& out = o.to_mcap.empty() ? o.to_lcm : o.to_mcap;
  requireFolderOf(out);
  ProgressBar bar("converting", kBarSteps);
  const auto progress = [&bar](double part) { bar.show(static_cast<int>(kBarSteps * part)); };
  recording::Converted converted;
  if (o.to_mcap.empty()) {
    converted = recording::convertToLcm(o.log, out, progress);
  } else {
    const VesselTree tree = readVesselTree(o.tree);
    const RecordedRun run =
        recordedRun(tree, readCArmCalibration(o.calibration, tree), o.tree, o.calibration, settingsInForce(o));
    mcap::WriterSettings settings;
    if (o.compression == "none") settings.compression = mcap::Compression::kNone;
    converted = recording::convertToMcap(o.log, out, run.scene, run.attachments, settings, progress);
  }
  warnOf(o, converted.skipped_bytes, converted.whole);
  std::cout << out << ": " << converted.messages << " messages\n";
  return 0;
}

int replayLog(const Options& o) {
  if (!o.to_mcap.empty() || !o.to_lcm.empty()) return convertLog(o);
  requireFolderOf(o.out);
  const Replayed replayed = replayMachine(o);
  const ReplaySummary& summary = replayed.summary;
  if (!o.out.empty()) writeWholeFile(o.out, replayed.table);
  warnOf(o, summary.skipped_bytes, summary.whole);
  if (!summary.knew_inputs) {
    std::cerr << "angio-replay: " << o.log
              << ": no SERVO_INPUT or CATHETER_INPUT: states are those heard before each frame\n";
  }
  std::cout << summary.answered << " of " << summary.frames << " frames answered, " << summary.held << " held; "
            << summary.equal << " of " << summary.commands << " logged commands are the same\n";
  if (o.compare && summary.commands == 0) throw InputError(o.log, "", "", "holds no command to compare with");
  if (o.compare && summary.first_difference) throw InputError(o.log, "", "", *summary.first_difference);
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app(
      "Sends a log of the bus (lcm-logger, or --record of angio-servo or angio-navigate) through the loop again, or "
      "makes "
      "an MCAP file of it for Foxglove. Given "
      "the same tree, "
      "calibration and settings, the commands are the same, bit for bit.",
      "angio-replay");
  angio::apps::describeProgram(app, "angio-replay run.lcm --compare --out commands.csv");
  angio::apps::Options o;
  app.addOption("log", o.log, "Log of the bus (.lcm, .mcap)")->required();
  app.addOption("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.addOption("--calibration", o.calibration, "C-arm geometry and T_dsa_cb (.yaml)");
  angio::apps::addMachineOption(app, o.machine, "Whose loop: angio-servo's, or with --to-branch angio-navigate's");
  angio::apps::addSettingsOptions(
      app, o.settings, "Settings (.yaml), as for angio-servo or angio-navigate", [&o](const std::string& path) {
        return o.machine == angio::apps::OperatedMachine::kCatheter ? angio::apps::navigateSettingsAsYaml(path)
                                                                    : angio::apps::servoSettingsAsYaml(path);
      });
  o.loop.addTo(app);
  o.way.addTo(app);
  app.addFlag("--ask-for-views", o.ask_for_views, "As angio-navigate was run");
  app.addOption("--out", o.out, "File for the commands (.csv)");
  app.addFlag("--compare", o.compare, "Fail at the first command that is not the logged one");
  auto* to_mcap = app.addOption("--to-mcap", o.to_mcap,
                                "Instead: the log as an MCAP file for Foxglove, with tree, calibration and settings")
                      ->excludes("--out")
                      ->excludes("--compare");
  app.addOption("--to-lcm", o.to_lcm, "Instead: the LCM messages of an MCAP file as a log of LCM's, the same bytes")
      ->excludes("--out")
      ->excludes("--compare")
      ->excludes("--to-mcap");
  app.addOption("--compression", o.compression, "Of the MCAP file")
      ->check(angio::cli::oneOf({"zstd", "none"}))
      ->needs(to_mcap);
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::replayLog(o); });
}
