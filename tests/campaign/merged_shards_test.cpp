// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "angio/test/errors.hpp"
#include "journeys.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

// NaN, infinities, the smallest number and the zero that is negative among them.
TEST(MergedShards, AreWhatOneRunLeaves) {
  const std::string single = experimentOf(nullptr);
  for (const int count : {1, 2, 4, 13}) {  // Of 13 some have nothing to do.
    const ShardFolder folder(count);
    std::vector<std::string> paths = folder.paths();
    std::reverse(paths.begin(), paths.end());
    MergedShards merged = ShardFolder::merged(paths);
    EXPECT_EQ(experimentOf(&merged), single) << count;
    EXPECT_EQ(merged.machine().dump(), R"({"processor":"one"})");
  }
}

TEST(MergedShards, NameWhatIsMissingAndTheCommandThatMakesIt) {
  const ShardFolder folder(4);
  const auto& p = folder.paths();
  const std::string shard2 = "angio-simulate-loop navigate --tree 'a tree.csv' --shard 2/4 --out " +
                             folder.path("shard-2.json"),
                    shard4 = "angio-simulate-loop navigate --tree 'a tree.csv' --shard 4/4 --out " +
                             folder.path("shard-4.json");
  EXPECT_EQ(refusalOf([&] {
              ShardFolder::merged({p[0], p[2], p[3]});
            }),
            "shard 2 of 4 is missing; to make it: " + shard2);
  EXPECT_EQ(refusalOf([&] {
              ShardFolder::merged({p[2], p[0]});
            }),
            "shards 2, 4 of 4 are missing; to make them: " + shard2 + "; " + shard4);
}

TEST(MergedShards, NameWhatIsDoubledOrForeign) {
  const ShardFolder folder(2);
  const auto& p = folder.paths();
  const std::string again = folder.write({2, 2}, "again");
  EXPECT_EQ(refusalOf([&] {
              ShardFolder::merged({p[0], p[1], again});
            }),
            again + ": shard = 2/2: stands in " + p[1] + " already");
  const auto foreign = [&](const CampaignIdentity& identity, int runs = 10) {
    const std::string path = folder.write({2, 2}, "foreign", identity, runs);
    const std::string line = refusalOf([&] { ShardFolder::merged({p[0], path}); });
    EXPECT_EQ(line.rfind(path + ": ", 0), 0u) << line;
    return line.substr(path.size() + 2);
  };
  const std::string other = ": is of another campaign than " + p[0];
  CampaignIdentity identity = identityOfJourneys();
  identity.arguments.push_back("--targets");
  EXPECT_EQ(foreign(identity), "arguments = --targets" + other);
  identity = identityOfJourneys();
  identity.inputs["a tree.csv"] = "00000000000000fe";
  EXPECT_EQ(foreign(identity), "inputs = a tree.csv" + other);
  identity = identityOfJourneys();
  identity.build = "another";
  EXPECT_EQ(foreign(identity), "build = another" + other);
  EXPECT_EQ(foreign(identityOfJourneys(), 12), "parts = 2 parts" + other);
  const std::string third = folder.write({3, 3}, "third");
  EXPECT_EQ(refusalOf([&] { ShardFolder::merged({p[0], third}); }), third + ": shards = 3" + other);
}

TEST(MergedShards, AreRefusedWhereTheExperimentHasOtherParts) {
  const ShardFolder folder(2);
  MergedShards merged = ShardFolder::merged(folder.paths());
  EXPECT_THAT(refusalOf([&] { experimentOf(&merged, 11); }), HasSubstr("parts = 10: must be 11 runs in part 0"));
  MergedShards unfinished = ShardFolder::merged(folder.paths());
  EXPECT_THAT(refusalOf([&] { unfinished.finish(); }), HasSubstr("parts = 2: must be 0"));
}

// Hostile ones: the fingerprint fits.
TEST(MergedShards, RowsThatAreNotTheRecordsAreRefusedByFileAndField) {
  const ShardFolder folder(1);
  const auto refusalWith = [&](const char* key, const Json& value) {
    ShardFile file = readShard(folder.paths().front());
    Json row = Json::parse(file.rows[4].text);
    row[key] = value;
    file.rows[4].text = row.dump();
    MergedShards merged({file});
    const std::string line = refusalOf([&] { experimentOf(&merged); }), place = folder.paths().front() + ":6: ";
    EXPECT_EQ(line.rfind(place, 0), 0u) << line;
    return line.substr(place.size());
  };
  EXPECT_EQ(refusalWith("run", 0.5), "run = 0.5: must be a whole number");
  EXPECT_EQ(refusalWith("run", 5'000'000'000), "run = 5000000000: must be a whole number that fits");
  EXPECT_EQ(refusalWith("time_s", "fast"), "time_s = \"fast\": must be a number");
  EXPECT_EQ(refusalWith("time_s", {{"not_finite", "huge"}}), "not_finite = \"huge\": must be nan, inf or -inf");
  EXPECT_EQ(refusalWith("errors_m", {1, {2}}), "errors_m/1 = (list of 1): must be a number");
}

TEST(Pilots, CountAllRunsOfTheirShardAndMakeFewOfThem) {
  PilotRuns pilots({2, 5});
  experimentOf(&pilots, 1000);
  EXPECT_EQ(pilots.runs(), 200 + 1);
  EXPECT_EQ(pilots.pilots(), 4 + 1);
}

}  // namespace
}  // namespace angio::test
