// SPDX-License-Identifier: GPL-2.0-or-later
// angio-replay: a log of the bus through the same loop again.
#include <iostream>
#include <optional>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/carm_calibration.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/servo/replay.hpp"
#include "loop_options.hpp"

namespace angio {
namespace {

struct Options {
  std::string log, tree = exampleDataFile("hepatic-tace/tree.csv"),
                   calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string settings, out;
  LoopOptions loop;
  bool compare = false;
};

ServoLoopSettings loopOf(const Options& o) {
  ServoSettings settings = readServoSettings(o.settings);
  o.loop.applyTo(settings);
  return settings.loop(readCArmCalibration(o.calibration));
}

// Numbers with all their digits: read again, they are the same bits.
std::string row(const ReplayedFrame& f) {
  const CArmCommand& c = f.report.command;
  std::string text =
      formatted("%lld,%lld,%lld,%lld", static_cast<long long>(c.frame_sequence), static_cast<long long>(c.time_us),
                static_cast<long long>(c.sequence), static_cast<long long>(c.valid_for_us));
  for (const double v : c.velocity) text += formatted(",%.17g", v);
  const std::optional<std::string> differs = f.logged ? difference(c, *f.logged) : std::nullopt;
  return text + (f.report.held ? ",1" : ",0") + (!f.logged ? "," : differs ? ",0" : ",1") + "\n";
}

int replayLog(const Options& o) {
  const ServoLoopSettings loop = loopOf(o);
  const VesselTree tree = readVesselTree(o.tree);
  std::string table =
      "frame_sequence,utime_us,sequence,valid_for_us,primary_rad_per_s,secondary_rad_per_s,table_x_m_per_s,"
      "table_y_m_per_s,table_z_m_per_s,held,as_logged\n";
  std::optional<ReplaySummary> summary;
  {
    ProgressBar bar("replaying", 1000);
    summary = replay(o.log, loop, tree, [&](const ReplayedFrame& f) {
      table += row(f);
      bar.show(static_cast<int>(1000 * f.part));
    });
  }
  if (!o.out.empty()) writeWholeFile(o.out, table);
  if (summary->skipped_bytes > 0) {
    std::cerr << "angio-replay: " << o.log << ": " << summary->skipped_bytes << " bytes are no messages\n";
  }
  if (!summary->knew_inputs) {
    std::cerr << "angio-replay: " << o.log << ": no SERVO_INPUT: joints are those heard before each frame\n";
  }
  std::cout << summary->answered << " of " << summary->frames << " frames answered, " << summary->held << " held; "
            << summary->equal << " of " << summary->commands << " logged commands are the same\n";
  if (o.compare && summary->commands == 0) throw InputError(o.log, "", "", "holds no command to compare with");
  if (o.compare && summary->first_difference) throw InputError(o.log, "", "", *summary->first_difference);
  return 0;
}

}  // namespace
}  // namespace angio

int main(int argc, char** argv) {
  CLI::App app(
      "Sends a log of the bus (lcm-logger, angio-servo --record) through the loop again. Given the same tree, "
      "calibration and settings, the commands are the same, bit for bit.",
      "angio-replay");
  angio::describeProgram(app, "angio-replay run.lcm --compare --out commands.csv");
  angio::Options o;
  app.add_option("log", o.log, "Log of the bus")->required();
  app.add_option("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.add_option("--calibration", o.calibration, "C-arm geometry and T_dsa_cb (.yaml)");
  app.add_option("--settings", o.settings, "Settings (.yaml), as for angio-servo");
  o.loop.addTo(app);
  app.add_option("--out", o.out, "File for the commands (.csv)");
  app.add_flag("--compare", o.compare, "Fail at the first command that is not the logged one");
  return angio::runProgram(app, argc, argv, [&] { return angio::replayLog(o); });
}
