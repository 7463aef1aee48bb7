// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "angio/campaign/campaigns.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {

/// A record of an experiment, with what numbers can be.
struct JourneyRecord {
  int run = 0;
  double time_s = 0;
  std::optional<double> error_m;
  std::vector<double> errors_m;
  std::string ended;
};

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, JourneyRecord>& journey) {
  f("run", journey.run);
  f("time_s", journey.time_s);
  f("error_m", journey.error_m);
  f("errors_m", journey.errors_m);
  f("ended", journey.ended);
}

inline JourneyRecord journeyOf(int run) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  JourneyRecord journey{run, std::sqrt(run) / 3, {}, {-0.0, 5e-324, 1e300 / 3, kInfinity, -kInfinity}, "a \"b\" \\ c"};
  if (run % 3 == 0) journey.error_m = std::numeric_limits<double>::quiet_NaN();
  return journey;
}

/// An experiment of two parts, as text to the last bit.
inline std::string experimentOf(Campaign* campaign, int runs = 10) {
  std::string text;
  for (const int count : {runs, 3}) {
    const auto journeys = recordsOf(
        campaign, count, 2, [](int k) { return "journey " + std::to_string(k); }, journeyOf);
    for (const JourneyRecord& journey : journeys) text += campaign::rowAsText(toRow(journey)) + "\n";
  }
  if (campaign) campaign->finish();
  return text;
}

inline CampaignIdentity identityOfJourneys() {
  return {"angio-simulate-loop",
          "0.1.0",
          "0123456789abcdef",
          {"navigate", "--tree", "a tree.csv"},
          {{"a tree.csv", "00000000000000ff"}}};
}

/// Shards of that experiment, as files "1.json", "2.json", ...
class ShardFolder {
 public:
  explicit ShardFolder(int count) {
    for (int number = 1; number <= count; ++number) paths_.push_back(write({number, count}, std::to_string(number)));
  }

  /// One more; returns its path.
  std::string write(const Shard& shard, const std::string& name,
                    const CampaignIdentity& identity = identityOfJourneys(), int runs = 10) const {
    RecordedShard recorded(shard);
    experimentOf(&recorded, runs);
    recorded.file().identity = identity;
    recorded.file().machine = {{"processor", "one"}};
    writeWholeFile(path(name + ".json"), shardAsText(recorded.file()));
    return path(name + ".json");
  }

  std::string path(const std::string& name) const { return folder_.path(name); }
  const std::vector<std::string>& paths() const { return paths_; }

  static MergedShards merged(const std::vector<std::string>& paths) {
    std::vector<ShardFile> files;
    for (const std::string& path : paths) files.push_back(readShard(path));
    return MergedShards(std::move(files));
  }

 private:
  TemporaryFolder folder_;
  std::vector<std::string> paths_;
};

}  // namespace angio::test
