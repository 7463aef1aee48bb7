// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "angio/campaign/campaigns.hpp"
#include "angio/cli/command_line.hpp"
#include "angio/cli/command_line_fwd.hpp"

namespace angio::campaign {

/// Options of every sub-command that makes many runs.
struct CampaignOptions {
  std::string shard;
  bool estimate = false, no_times = false;

  /// @param pictures  Options of files that rows cannot be made into: a shard does not take them.
  void addTo(cli::Command& command, const std::vector<cli::Option*>& pictures = {});
};

/// How a sub-command makes its runs, and what becomes of them.
struct CampaignRun {
  results::Campaign* rows = nullptr;  ///< Null: all runs are made here.
  bool reports = true;                ///< False: nothing is reported or written, once the runs are made.
  bool times = true;                  ///< Whether reports have times and the machine.
  int shards = 1;
  Json machine;  ///< What reports say of the machine; null without times.

  /// Call when all runs are made: whether to report them. Throws InputError when shards have more.
  bool done() const;

  /// How many of so many steps are made here, at least one: for a progress bar.
  int share(int total) const { return std::max(1, (total + shards - 1) / shards); }

  /// A report without times where none are asked for: see withoutTimes().
  Json shown(Json json) const;
};

/// A report without wall times and their ratios: what is the same however often it is made.
Json withoutTimes(Json json);

/// What a sub-command does.
struct CampaignJob {
  const CampaignOptions& options;
  std::string out;                              ///< Where results go, or a shard; empty: nowhere.
  int runs = 0;                                 ///< Of the largest part: from a thousand on its time is told before.
  std::map<std::string, std::string> inputs;    ///< Fingerprints of what is read: see CampaignIdentity.
  std::function<int(const CampaignRun&)> work;  ///< Returns the exit code.
};

/// A program's command line as its campaigns know it.
class Campaigns {
 public:
  /// @param merged  Rows of shards that take the place of runs; null: none.
  Campaigns(std::string program, std::vector<std::string> arguments, MergedShards* merged = nullptr)
      : program_(std::move(program)), arguments_(std::move(arguments)), merged_(merged) {}

  /// Makes the runs that are asked for, all or a shard's, or merges shards. Returns the exit code. Throws InputError,
  /// Interrupted.
  int run(const CampaignJob& job) const;

 private:
  CampaignIdentity identityOf(const CampaignJob& job) const;
  int merge(const CampaignJob& job) const;
  int record(const CampaignJob& job, const Shard& shard) const;

  std::string program_;
  std::vector<std::string> arguments_;
  MergedShards* merged_;
};

/// A program whose sub-commands are campaigns; `merge` is added to them.
struct CampaignProgram {
  const char *name, *description, *example;
  std::function<void(cli::Command& app, cli::Work& work, const Campaigns& campaigns)> describe;
  std::function<void(cli::Command& app, cli::Work& work)> describe_others;  ///< Sub-commands that are none.
  bool has_reports = false;                                                 ///< Whether some of them have --report.
};

/// As cli::runProgram().
int runCampaignProgram(const CampaignProgram& program, int argc, char** argv);

/// Adds the fingerprint of a file or folder that a campaign reads; an empty path is none. Throws InputError.
void addInput(std::map<std::string, std::string>& inputs, const std::string& path);

}  // namespace angio::campaign
