// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <ctime>

#include "angio/base/interruption.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/campaign/campaigns.hpp"

namespace angio::campaign {
namespace {

constexpr std::size_t kPilots = 4;

std::vector<int> runsOf(const Shard& shard, int part, int count) {
  std::vector<int> runs;
  for (int run = 0; run < count; ++run) {
    if (shard.has(part, run)) runs.push_back(run);
  }
  return runs;
}

}  // namespace

std::vector<results::Campaign::Row> RecordedShard::rows(int count, int threads,
                                                        const std::function<std::string(int k)>& nameOf,
                                                        const std::function<Json(int k)>& one,
                                                        const results::Progress& done) {
  const auto part = static_cast<int>(file_.parts.size());
  const std::vector<int> runs = runsOf(file_.shard, part, count);
  const auto runOf = [&](int k) { return runs[static_cast<std::size_t>(k)]; };
  // Records that are cut down to text at once: of ten thousand runs the rest of memory is not needed.
  auto texts = results::recordsOf(
      static_cast<int>(runs.size()), threads, [&](int k) { return nameOf(runOf(k)); },
      [&](int k) { return rowAsText(one(runOf(k))); }, done);
  throwIfInterrupted();
  std::vector<Row> rows;
  for (std::size_t k = 0; k < texts.size(); ++k) {
    rows.push_back({runs[k], rowOfText(texts[k], ""), ""});
    file_.rows.push_back({part, runs[k], std::move(texts[k])});
  }
  file_.parts.push_back(count);
  return rows;
}

std::vector<results::Campaign::Row> PilotRuns::rows(int count, int threads,
                                                    const std::function<std::string(int k)>& nameOf,
                                                    const std::function<Json(int k)>& one, const results::Progress&) {
  const std::vector<int> runs = runsOf(shard_, part_++, count);
  std::vector<int> pilots;
  for (std::size_t p = 0; p < std::min(kPilots, runs.size()); ++p) {
    pilots.push_back(runs[p * runs.size() / std::min(kPilots, runs.size())]);
  }
  std::vector<Row> rows;
  const Stopwatch wall;
  const std::clock_t began = std::clock();
  results::forEachRun(
      static_cast<int>(pilots.size()), 1, [&](int k) { return nameOf(pilots[static_cast<std::size_t>(k)]); },
      [&](int k) {
        const int run = pilots[static_cast<std::size_t>(k)];
        rows.push_back({run, one(run), ""});
      });
  throwIfInterrupted();
  if (pilots.empty()) return rows;
  const double share = static_cast<double>(runs.size()) / static_cast<double>(pilots.size());
  wall_s_ += share * wall.seconds() / std::max(1, threads);
  cpu_s_ += share * static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC;
  runs_ += static_cast<int>(runs.size());
  pilots_ += static_cast<int>(pilots.size());
  return rows;
}

}  // namespace angio::campaign
