// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/campaign/program.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/interruption.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::campaign {
namespace {

// From so many runs on, what they will take is told before.
constexpr int kMany = 1000;

// Programs whose shards are merged by themselves, each beside the others.
constexpr std::array kPrograms = {"angio-calibrate", "angio-evaluate", "angio-simulate-loop"};

struct MergeOptions {
  std::vector<std::string> shards;
  std::string out, report;
  bool no_times = false;
};

std::string inWords(double time_s) {
  if (time_s < 1) return formatted("%.0f ms", 1e3 * time_s);
  if (time_s < 120) return formatted("%.1f s", time_s);
  return time_s < 7200 ? formatted("%.1f min", time_s / 60) : formatted("%.1f h", time_s / 3600);
}

// One line: what the runs that are counted will take.
std::string estimateOf(const PilotRuns& pilots, const Shard& shard) {
  const std::string of = shard.count > 1 ? " of shard " + shard.name() : "";
  return formatted("%d runs", pilots.runs()) + of + ": about " + inWords(pilots.wall_s()) + ", " +
         formatted("%.3g core-hours", pilots.cpu_s() / 3600) +
         formatted(" (from %d pilot runs here, ", pilots.pilots()) +
         inWords(pilots.cpu_s() / std::max(1, pilots.runs())) + " a run)";
}

// Makes a shard's runs, or some of them, and reports nothing.
void makeRuns(const CampaignJob& job, const Shard& shard, results::Campaign& rows) {
  CampaignRun run;
  run.rows = &rows;
  run.reports = false;
  run.shards = shard.count;
  job.work(run);
  throwIfInterrupted();
}

PilotRuns pilotsOf(const CampaignJob& job, const Shard& shard) {
  PilotRuns pilots(shard);
  makeRuns(job, shard, pilots);
  return pilots;
}

std::vector<std::string> mergeArguments(const MergedShards& merged, const MergeOptions& o) {
  std::vector<std::string> arguments = merged.identity().arguments;
  if (!o.out.empty()) arguments.insert(arguments.end(), {"--out", o.out});
  if (!o.report.empty()) arguments.insert(arguments.end(), {"--report", o.report});
  if (o.no_times) arguments.push_back("--no-times");
  return arguments;
}

// Another program's shards are its own to merge. Takes this process over.
void mergeBy(const std::string& program, const ShardFile& shard, char** argv) {
  const std::string& maker = shard.identity.program;
  if (maker == program) return;
  if (std::find(kPrograms.begin(), kPrograms.end(), maker) == kPrograms.end()) {
    throw InputError(shard.path, "program", maker.substr(0, 40), "must be a program that makes shards");
  }
  const auto other = std::filesystem::read_symlink("/proc/self/exe").replace_filename(maker);
  execv(other.c_str(), argv);
  throw InputError(other.string(), "", "", std::string("cannot be started: ") + std::strerror(errno));
}

int merge(const CampaignProgram& program, const MergeOptions& o, char** argv) {
  for (const auto& path : {o.out, o.report}) requireFolderOf(path);
  std::vector<ShardFile> shards;
  for (const std::string& path : o.shards) {
    shards.push_back(readShard(path));
    mergeBy(program.name, shards.back(), argv);
  }
  MergedShards merged(std::move(shards));
  const Campaigns campaigns(program.name, merged.identity().arguments, &merged);
  cli::Command app(program.description, program.name);
  app.requireSubcommand();
  cli::Work work;
  program.describe(app, work, campaigns);  // Of the others nothing is to be merged.
  cli::readArguments(app, merged.path(), mergeArguments(merged, o));
  return work();
}

void addMerge(cli::Command& app, cli::Work& work, const CampaignProgram& program, char** argv) {
  const auto o = std::make_shared<MergeOptions>();
  auto* command = app.addSubcommand("merge", "Make the result of one run out of all its shards");
  command->footer(std::string("Example:\n  ") + program.name + " merge shard-*.json --out result.json");
  command->addOption("shards", o->shards, "What --shard wrote, all of one campaign")->required();
  command->addOption("--out", o->out, "All results (.json), as the sub-command writes them");
  if (program.has_reports) command->addOption("--report", o->report, "Report (.html), of sub-commands that have one");
  command->addFlag("--no-times", o->no_times, "Leave out times and machine: what is left is the same as of one run");
  command->onChosen([=, &work, &program] { work = [=, &program] { return merge(program, *o, argv); }; });
}

void dropTimes(Json& json) {
  static const std::set<std::string> kTimes = {"time_ms", "time_p50_relative", "latency_ms", "frame_to_command_ms"};
  if (json.is_object()) {
    for (auto member = json.begin(); member != json.end();) {
      if (member.key() == "certificate" && member->is_object()) member->erase("seconds");
      member = kTimes.count(member.key()) != 0 ? json.erase(member) : std::next(member);
    }
  }
  if (!json.is_structured()) return;
  for (Json& member : json) dropTimes(member);
}

}  // namespace

void CampaignOptions::addTo(cli::Command& command, const std::vector<cli::Option*>& pictures) {
  cli::Option* of_shard = command.addOption(
      "--shard", shard, "Make a part of the runs only, 2/4: --out takes their rows, and merge makes one result of all");
  for (const cli::Option* picture : pictures) of_shard->excludes(picture);
  command.addFlag("--estimate", estimate, "Tell from a few runs what all of them will take, and end")
      ->group(cli::kFurtherOptions);
  command.addFlag("--no-times", no_times, "Leave out times and machine: what is left is the same each time")
      ->group(cli::kFurtherOptions);
}

bool CampaignRun::done() const {
  if (rows) rows->finish();
  return reports;
}

Json CampaignRun::shown(Json json) const { return times ? json : withoutTimes(std::move(json)); }

Json withoutTimes(Json json) {
  dropTimes(json);
  return json;
}

CampaignIdentity Campaigns::identityOf(const CampaignJob& job) const {
  return {program_, cli::programVersion(), fingerprintOfProgram(), sharedArguments(arguments_), job.inputs};
}

int Campaigns::merge(const CampaignJob& job) const {
  const CampaignIdentity here = identityOf(job), &there = merged_->identity();
  const auto refuse = [&](const char* field, const std::string& value, const char* rule) {
    throw InputError(merged_->path(), field, value.substr(0, 60), rule);
  };
  if (there.version != here.version) refuse("version", there.version, "must be this program's, which merges");
  if (there.build != here.build) refuse("build", there.build, "must be this program's, which merges");
  for (const auto& [name, hash] : here.inputs) {
    const auto found = there.inputs.find(name);
    if (found == there.inputs.end() || found->second != hash) refuse("inputs", name, "has changed since");
  }
  CampaignRun run;
  run.rows = merged_;
  run.times = !job.options.no_times;
  if (run.times) run.machine = merged_->machine();
  try {
    return job.work(run);
  } catch (const Json::exception&) {
    throw InputError(merged_->path(), "rows", "", "must be what " + program_ + " makes of its runs");
  }
}

int Campaigns::record(const CampaignJob& job, const Shard& shard) const {
  RecordedShard recorded(shard);
  recorded.file().identity = identityOf(job);
  (void)recorded.file().identity.fingerprint();  // What cannot be written is refused before the work.
  recorded.file().machine = results::machineAsJson();
  makeRuns(job, shard, recorded);
  const std::string text = shardAsText(recorded.file());
  if (text.size() > kMaxFile) {
    throw InputError(job.out, "", std::to_string(text.size()) + " bytes", "must be less than 1 GiB: take more shards");
  }
  writeWholeFile(job.out, text);
  std::cout << "shard " << shard.name() << ": " << recorded.file().rows.size() << " runs in " << job.out << "\n";
  return 0;
}

int Campaigns::run(const CampaignJob& job) const {
  if (merged_) return merge(job);
  const CampaignOptions& o = job.options;
  const Shard shard = o.shard.empty() ? Shard{} : shardNamed(o.shard);
  if (!o.shard.empty() && !o.estimate && job.out.empty()) {
    throw InputError("", "--shard", o.shard, "must have --out, a file for its rows");
  }
  requireFolderOf(job.out);
  if (o.estimate) {
    std::cout << estimateOf(pilotsOf(job, shard), shard) << "\n";
    return 0;
  }
  if (job.runs / shard.count >= kMany) {
    std::cerr << program_ << ": " << estimateOf(pilotsOf(job, shard), shard) << std::endl;
  }
  if (!o.shard.empty()) return record(job, shard);
  CampaignRun run;
  run.times = !o.no_times;
  if (run.times) run.machine = results::machineAsJson();
  return job.work(run);
}

int runCampaignProgram(const CampaignProgram& program, int argc, char** argv) {
  cli::Command app(program.description, program.name);
  cli::describeProgram(app, program.example);
  app.requireSubcommand();
  cli::Work work;
  const Campaigns campaigns(program.name, std::vector<std::string>(argv + std::min(argc, 1), argv + argc));
  program.describe(app, work, campaigns);
  if (program.describe_others) program.describe_others(app, work);
  addMerge(app, work, program, argv);
  return cli::runProgram(app, argc, argv, [&] { return work(); });
}

void addInput(std::map<std::string, std::string>& inputs, const std::string& path) {
  if (!path.empty()) inputs[path] = fingerprintOfFile(path);
}

}  // namespace angio::campaign
