// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/campaign/shard_file.hpp"
#include "angio/results/campaign.hpp"

namespace angio::campaign {

/// Makes one shard's runs and keeps their rows. After SIGINT or SIGTERM rows() throws Interrupted: a shard is whole or
/// there is none.
class RecordedShard final : public results::Campaign {
 public:
  explicit RecordedShard(const Shard& shard) { file_.shard = shard; }

  std::vector<Row> rows(int count, int threads, const std::function<std::string(int k)>& nameOf,
                        const std::function<Json(int k)>& one, const results::Progress& done) override;

  /// The shard as it is so far.
  ShardFile& file() { return file_; }

 private:
  ShardFile file_;
};

/// What a campaign will take, from a few runs of each of its parts.
class PilotRuns final : public results::Campaign {
 public:
  /// Only that shard's runs count.
  explicit PilotRuns(const Shard& shard) : shard_(shard) {}

  /// Makes up to four runs, spread over the part, one after another.
  std::vector<Row> rows(int count, int threads, const std::function<std::string(int k)>& nameOf,
                        const std::function<Json(int k)>& one, const results::Progress& done) override;

  int runs() const { return runs_; }         ///< Of all parts.
  int pilots() const { return pilots_; }     ///< Of them that were made.
  double wall_s() const { return wall_s_; }  ///< Of all runs by so many threads as each part asked for.
  double cpu_s() const { return cpu_s_; }    ///< Of all runs, of one processor core.

 private:
  Shard shard_;
  int part_ = 0, runs_ = 0, pilots_ = 0;
  double wall_s_ = 0, cpu_s_ = 0;
};

/// The rows of all shards of a campaign, in the order in which one run makes them.
class MergedShards final : public results::Campaign {
 public:
  /// Throws InputError that names a shard that is of another campaign or there twice, or the shards that are missing
  /// with the commands that make them.
  explicit MergedShards(std::vector<ShardFile> shards);

  /// Makes nothing. Throws InputError when the experiment asks for other parts than the shards have.
  std::vector<Row> rows(int count, int threads, const std::function<std::string(int k)>& nameOf,
                        const std::function<Json(int k)>& one, const results::Progress& done) override;

  /// Throws InputError when the shards have more parts than were asked for.
  void finish() override;

  const CampaignIdentity& identity() const { return shards_.front().identity; }
  const std::string& path() const { return shards_.front().path; }

  /// The machine that made all of them, or the processors of several and each shard's machine as "shards".
  Json machine() const;

 private:
  std::vector<ShardFile> shards_;  // By number.
  std::vector<std::size_t> next_;  // Row of each shard.
  std::size_t part_ = 0;
};

}  // namespace angio::campaign
