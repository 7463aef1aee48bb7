// SPDX-License-Identifier: GPL-2.0-or-later
// Experiments in shards: what merge makes of them is what one run makes, byte for byte.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/program.hpp"
#include "case_folder.hpp"

namespace angio::test {
namespace {

using Words = std::vector<std::string>;

Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class Shards : public CaseFolder {
 protected:
  std::string shard(int number) const { return folder_.path("shard-" + std::to_string(number) + ".json"); }

  Ended make(const std::string& program, const Words& work, int number, int count) const {
    return run(program,
               work + Words{"--shard", std::to_string(number) + "/" + std::to_string(count), "--out", shard(number)});
  }

  Words allShards(int count) const {
    Words words = {"merge"};
    for (int number = count; number >= 1; --number) words.push_back(shard(number));
    return words;
  }

  // What one run and the shards leave: results, text, and a report where there is one.
  void expectTheSame(const std::string& program, const Words& work, int count, bool has_report) const {
    for (int number = 1; number <= count; ++number) {
      const Ended ended = make(program, work, number, count);
      ASSERT_EQ(ended.exit_code, 0) << ended.err;
    }
    const auto written = [&](const std::string& name) {
      Words words = {"--no-times", "--out", folder_.path(name + ".json")};
      if (has_report) words = words + Words{"--report", folder_.path(name + ".html")};
      return words;
    };
    const Ended one = run(program, work + written("one")), merged = run(program, allShards(count) + written("merged"));
    ASSERT_EQ(one.exit_code, 0) << one.err;
    ASSERT_EQ(merged.exit_code, 0) << merged.err;
    EXPECT_EQ(merged.out, one.out);
    EXPECT_EQ(merged.err, one.err);
    const std::string results = contentOf(folder_.path("one.json"));
    EXPECT_GT(results.size(), 1000u);
    EXPECT_EQ(results.find("time_ms"), std::string::npos);
    EXPECT_TRUE(contentOf(folder_.path("merged.json")) == results);
    if (has_report) {
      EXPECT_TRUE(contentOf(folder_.path("merged.html")) == contentOf(folder_.path("one.html")));
    }
  }

  Words simulationOf(const std::string& trials) const {
    Words words = simulation_;
    *(std::find(words.begin(), words.end(), "--trials") + 1) = trials;
    return words;
  }

  const Words simulation_ = {
      "simulation", "--tree",   folder_.path("tree.csv"),       "--trials", "9", "--spurious", "3", "--noise-px",
      "1",          "--method", "iterative_pnp,oriented_kernel"};
};

TEST_F(Shards, OfASimulationWithASweepMergeToOneRun) {
  expectTheSame("angio-evaluate", simulation_ + Words{"--sweep", "spurious", "--nonrigid"}, 4, true);
}

TEST_F(Shards, OfThePapersTablesMergeToOneRun) {
  expectTheSame("angio-evaluate",
                {"paper", "--tree", folder_.path("tree.csv"), "--trials", "4", "--table", "1", "--table", "2",
                 "--figure", "3d-3d", "--method", "nicp,oriented_kernel"},
                3, true);
}

TEST_F(Shards, OfCasesAndImagesMergeToOneRun) {
  expectTheSame("angio-evaluate", {"cases", folder_.path("cases.yaml"), "--nonrigid", "--point-covariance"}, 2, false);
  expectTheSame("angio-evaluate", {"extraction", "--tree", folder_.path("tree.csv"), "--trials", "3"}, 2, false);
}

// A sequence is one run: each of its frames starts from what those before it have shown.
TEST_F(Shards, OfASequenceAreItsMethods) {
  folder_.write("sequence.yaml", "sequence: true\n" + contentOf(folder_.path("cases.yaml")));
  expectTheSame("angio-evaluate", {"cases", folder_.path("sequence.yaml"), "--method", "iterative_pnp,oriented_kernel"},
                3, false);
}

// So is each way of looking at a catheter's sequence.
TEST_F(Shards, OfACathetersSequenceAreItsWays) {
  const std::string data = test::exampleData("hepatic-tace/");
  std::string cases = "tree: " + data + "tree.csv\ncamera: " + data + "camera.yaml\ncases:\n";
  for (const char* frame : {"0000", "0001", "0002", "0003", "0004", "0005"}) {
    cases += std::string("  - {name: \"") + frame + "\", centerline: " + data + "frames/c" + frame +
             ".csv, initial_pose: " + data + "nominal_pose.yaml}\n";
  }
  folder_.write("catheter.yaml", cases);
  expectTheSame("angio-evaluate", {"catheter", folder_.path("catheter.yaml")}, 2, false);
  const std::string tree = exampleData("hepatic-tace/tree.csv");
  expectTheSame("angio-evaluate", {"catheter-runs", "--tree", tree, "--runs", "2", "--frames", "4"}, 2, false);
}

TEST_F(Shards, OfClosedLoopsMergeToOneRunByEitherProgram) {
  const Words faults = {"faults", "--machine", "catheter", "--runs", "3"};
  expectTheSame("angio-simulate-loop", faults, 2, false);
  const Ended by_other = run("angio-evaluate", allShards(2) + Words{"--no-times", "--out", folder_.path("other.json")});
  ASSERT_EQ(by_other.exit_code, 0) << by_other.err;
  EXPECT_TRUE(contentOf(folder_.path("other.json")) == contentOf(folder_.path("one.json")));
}

TEST_F(Shards, OfCalibratedMachinesMergeToOneRun) {
  const Words study = {"simulate", "--study", "geometry", "--geometry-views", "12", "--trials", "3"};
  expectTheSame("angio-calibrate", study, 2, false);
  // Data are written at once.
  const Ended data = run("angio-calibrate", {"simulate", "--out", folder_.path("data"), "--shard", "1/2"});
  EXPECT_EQ(data.exit_code, 1);
  EXPECT_EQ(data.err, "angio-calibrate: --shard = 1/2: needs --study camera or geometry\n");
}

// A shard that was killed leaves no file, is named, and the command that is named makes it.
TEST_F(Shards, AKilledOneIsNamedAndMadeAgainAlone) {
  for (const int number : {1, 3}) ASSERT_EQ(make("angio-evaluate", simulation_, number, 3).exit_code, 0);
  const Words endless = simulationOf("100000");
  {
    RunningProgram killed("angio-evaluate", endless + Words{"--shard", "2/3", "--out", shard(2)});
    std::this_thread::sleep_for(std::chrono::seconds(1));
    killed.signal(SIGKILL);
    killed.end();
  }
  EXPECT_FALSE(std::filesystem::exists(shard(2)));
  const Ended missing = run("angio-evaluate", {"merge", shard(1), shard(3), "--out", folder_.path("merged.json")});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_FALSE(std::filesystem::exists(folder_.path("merged.json")));
  std::string command = "angio-evaluate";
  for (const std::string& word : simulation_) command += " " + word;
  command += " --shard 2/3 --out " + shard(2);
  EXPECT_EQ(missing.err, "angio-evaluate: shard 2 of 3 is missing; to make it: " + command + "\n");
  ASSERT_EQ(std::system((std::string(ANGIO_PROGRAMS) + "/" + command + " > /dev/null").c_str()), 0);
  EXPECT_EQ(run("angio-evaluate", allShards(3)).exit_code, 0);
}

TEST_F(Shards, AreRefusedWhereWhatTheyReadHasChanged) {
  ASSERT_EQ(make("angio-evaluate", simulation_, 1, 1).exit_code, 0);
  writeVesselTree(folder_.path("tree.csv"), branchingTree(5));
  const Ended changed = run("angio-evaluate", {"merge", shard(1)});
  EXPECT_EQ(changed.exit_code, 1);
  EXPECT_THAT(changed.err, testing::EndsWith("tree.csv: has changed since\n"));
}

TEST_F(Shards, AreWholeOrNotThereAfterAnInterruption) {
  const Words endless = simulationOf("100000");
  for (const int wait_s : {2, 10, 60}) {
    RunningProgram program("angio-evaluate", endless + Words{"--shard", "1/2", "--out", shard(1)});
    std::this_thread::sleep_for(std::chrono::seconds(wait_s));
    program.signal(SIGINT);
    const Ended ended = program.end();
    if (ended.exit_code == 128 + SIGINT) continue;  // Before it had begun.
    EXPECT_EQ(ended.exit_code, 1) << ended.err;
    EXPECT_THAT(ended.err, testing::HasSubstr("angio-evaluate: interrupted"));
    break;
  }
  EXPECT_FALSE(std::filesystem::exists(shard(1)));
}

TEST_F(Shards, AreEstimatedFirstWhereThereAreMany) {
  const Ended told = run("angio-evaluate", simulationOf("10000") + Words{"--estimate", "--shard", "2/4"});
  EXPECT_EQ(told.exit_code, 0) << told.err;
  EXPECT_THAT(told.out,
              testing::MatchesRegex("2500 runs of shard 2/4: about .* core-hours \\(from 4 pilot runs here, .*\n"));
}

}  // namespace
}  // namespace angio::test
