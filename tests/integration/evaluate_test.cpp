// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "case_folder.hpp"
#include "hepatic.hpp"

namespace angio::test {
namespace {

using Json = nlohmann::json;

class Evaluate : public test::CaseFolder {
 protected:
  std::vector<std::string> simulation(const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"simulation",         "--tree", folder_.path("tree.csv"), "--trials", "2",
                                      "--rotation-std-deg", "0.5",    "--translation-std-mm",   "1"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

TEST_F(Evaluate, SimulationWritesWhatCasesWrites) {
  const auto ended =
      test::run("angio-evaluate", simulation({"--tree", folder_.path("tree.csv"), "--views", "2", "--noise-px", "0.5",
                                              "--out", folder_.path("r.json"), "--report", folder_.path("r.html")}));
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(ended.err, "");
  EXPECT_NE(ended.out.find("| oriented_kernel |"), std::string::npos) << ended.out;
  const Json results = Json::parse(test::contentOf(folder_.path("r.json")));
  const Json& method = results["methods"]["oriented_kernel"];
  ASSERT_EQ(method["cases"].size(), 2u);
  for (const char* key : {"status", "rotation", "translation_mm", "covariance", "mean_projection_residual_px",
                          "points_3d", "points_2d", "time_ms", "start_error", "error"}) {
    EXPECT_TRUE(method["cases"]["0001"].contains(key)) << key;
  }
  for (const char* key :
       {"success_mtre_2mm_percent", "mtre_mm", "mpd_px", "mpd_detector_mm", "mpd_isocentre_mm", "depth_mm",
        "in_plane_mm", "gfr_true_5px_percent", "capture_range_mm", "failed_and_trusted_percent"}) {
    EXPECT_TRUE(method["summary"].contains(key)) << key;
  }
  EXPECT_EQ(results["settings"]["simulation"]["views"], 2);
  EXPECT_EQ(results["settings"]["simulation"]["trees"].size(), 2u);
  EXPECT_EQ(results["settings"]["simulation"]["noise_px"], 0.5);
  EXPECT_TRUE(results["machine"].contains("cores"));
  EXPECT_EQ(test::contentOf(folder_.path("r.html")).find("<!DOCTYPE html>"), 0u);
}

// Ctrl-C: what is finished is written whole, and a line and the exit code say that it is not all. A busy computer may
// take longer for the first trial.
TEST_F(Evaluate, AnInterruptedSimulationKeepsWhatIsFinished) {
  auto words = simulation({"--out", folder_.path("r.json")});
  *(std::find(words.begin(), words.end(), "--trials") + 1) = "100000";
  test::Ended ended;
  for (const int wait_s : {1, 5, 30, 120}) {
    test::RunningProgram program("angio-evaluate", words);
    std::this_thread::sleep_for(std::chrono::seconds(wait_s));
    program.signal(SIGINT);
    ended = program.end();
    if (ended.exit_code == 128 + SIGINT) continue;  // Before it had begun.
    ASSERT_EQ(ended.exit_code, 1) << ended.err;
    ASSERT_NE(ended.err.find("angio-evaluate: interrupted"), std::string::npos) << ended.err;
    if (std::filesystem::exists(folder_.path("r.json"))) break;
  }
  // Before the work there is a line of what it will take.
  EXPECT_EQ(ended.err.rfind("angio-evaluate: 100000 runs: about ", 0), 0u) << ended.err;
  EXPECT_EQ(ended.err.substr(ended.err.find('\n') + 1),
            "angio-evaluate: interrupted: what was finished before is reported, and no more\n");
  const Json results = Json::parse(test::contentOf(folder_.path("r.json")));
  const auto finished = results["methods"].front()["cases"].size();
  EXPECT_GT(finished, 0u);
  EXPECT_LT(finished, 100000u);
  EXPECT_NE(ended.out.find("| oriented_kernel |"), std::string::npos) << ended.out;
}

TEST_F(Evaluate, TheCommandLineComesBeforeTheSettingsFile) {
  const std::string settings = folder_.write("s.yaml", "simulation: {noise_px: 2, seed: 9, model_axes: ras}\n");
  const auto ended =
      test::run("angio-evaluate", simulation({"--settings", settings, "--seed", "4", "--out", folder_.path("r.json")}));
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json used = Json::parse(test::contentOf(folder_.path("r.json")))["settings"]["simulation"];
  EXPECT_EQ(used["noise_px"], 2);
  EXPECT_EQ(used["seed"], 4);
  EXPECT_EQ(used["model_axes"], "ras");
  EXPECT_EQ(used["trials"], 2);
}

TEST_F(Evaluate, ASweepHasATableAndItsPoints) {
  const auto ended = test::run("angio-evaluate", simulation({"--sweep", "noise", "--out", folder_.path("r.json")}));
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_NE(ended.out.find("| 1.5 px | oriented_kernel |"), std::string::npos) << ended.out;
  const Json sweep = Json::parse(test::contentOf(folder_.path("r.json")))["sweeps"]["noise"];
  ASSERT_EQ(sweep["points"].size(), 6u);
  EXPECT_EQ(sweep["points"][5]["value"], 3);
  EXPECT_TRUE(sweep["points"][5]["summaries"]["oriented_kernel"].contains("success_mtre_2mm_percent"));
}

TEST_F(Evaluate, ThePaperStandsBesideUs) {
  const auto ended = test::run("angio-evaluate", {"paper", "--tree", folder_.path("tree.csv"), "--trials", "1", "--out",
                                                  folder_.path("p.json"), "--report", folder_.path("p.html")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_NE(ended.out.find("| paper: NICP | 8 % | 0.50 |"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("| iterative_pnp, nonrigid |"), std::string::npos) << ended.out;
  const Json paper = Json::parse(test::contentOf(folder_.path("p.json")))["paper"];
  EXPECT_EQ(paper["table3"].size(), 5u);
  EXPECT_TRUE(paper["table1"]["here"].contains("iterative_pnp, rigid"));
  EXPECT_EQ(test::contentOf(folder_.path("p.html")).find("<!DOCTYPE html>"), 0u);
}

TEST_F(Evaluate, ThePapersTableOfRealImagesAndItsFiguresAreRunByName) {
  const std::string tree = folder_.path("tree.csv"), out = folder_.path("p.json"), report = folder_.path("p.html");
  const auto ended =
      test::run("angio-evaluate", {"paper", "--tree", tree, "--trials", "2", "--table", "2", "--figure", "loss",
                                   "--figure", "visible-fraction", "--figure", "3d-3d", "--method",
                                   "iterative_pnp:huber,rgrb", "--out", out, "--report", report});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json paper = Json::parse(test::contentOf(out))["paper"];
  EXPECT_FALSE(paper.contains("table1"));
  EXPECT_FALSE(paper.contains("table3"));
  const Json& sets = paper["table2"]["here"];
  ASSERT_EQ(sets.size(), 3u);
  EXPECT_EQ(sets[0]["registrations"], 4);  // Four runs of the phantom, a start each.
  EXPECT_TRUE(sets[0]["methods"].contains("rgrb, rigid"));
  EXPECT_EQ(sets[2]["registrations"], 37);
  EXPECT_FALSE(sets[2]["methods"].contains("rgrb, rigid")) << "its frames are centrelines";
  EXPECT_FALSE(sets[2]["methods"]["iterative_pnp:huber, rigid"].contains("median_in_plane_mm")) << "no reference";
  ASSERT_EQ(paper["losses"].size(), 5u);
  EXPECT_TRUE(paper["losses"][0]["here"].contains("iterative_pnp:l2"));
  EXPECT_EQ(paper["visible_fraction"]["points"].size(), 8u);
  EXPECT_EQ(paper["point_sets"].size(), 12u);
  EXPECT_NE(ended.out.find("| the paper's | DT-ICP | 16 % | 4.68 |"), std::string::npos) << ended.out;
  EXPECT_NE(test::contentOf(report).find("What a match costs"), std::string::npos);
}

// A comparison may hold methods that let the tree deform and such that do not; tools read displacements of each.
TEST_F(Evaluate, ARigidMethodTakesPartInANonrigidComparison) {
  const std::string out = folder_.path("r.json");
  const auto ended = test::run("angio-evaluate", {"cases", test::exampleData("static-phantom/cases.yaml"), "--method",
                                                  "nicp,oriented_kernel", "--nonrigid", "--out", out});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(ended.err, "angio-evaluate: nicp is rigid: it takes part without deformation\n");
  const Json methods = Json::parse(test::contentOf(out))["methods"];
  const Json& rigid = methods["nicp"]["cases"]["im1"]["displacements_mm"];
  ASSERT_EQ(rigid.size(), methods["oriented_kernel"]["cases"]["im1"]["displacements_mm"].size());
  for (const Json& row : rigid) EXPECT_EQ(row, Json({0.0, 0.0, 0.0}));
}

TEST_F(Evaluate, WrongInputIsOneLine) {
  const std::string tree = folder_.path("tree.csv");
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"simulation", "--tree", "none.csv"}, "none.csv"},
      {{"simulation", "--tree", tree, "--method", "magic"}, "iterative_pnp"},
      {{"simulation", "--tree", tree, "--method", "iterative_pnp,iterative_pnp"}, "named once"},
      {{"simulation", "--tree", tree, "--sweep", "luck"}, "deformation"},
      {{"simulation", "--tree", tree, "--out", folder_.path("no/where.json")}, "folder must exist"},
      {{"simulation", "--tree", tree, "--settings", folder_.write("bad.yaml", "simulation: {missing: 3}\n")},
       "bad.yaml:1"},
      {{"paper", "--tree", "none.csv"}, "none.csv"}};
  for (const auto& [words, named] : wrong) {
    const auto ended = test::run("angio-evaluate", words);
    EXPECT_EQ(ended.exit_code, 1) << testing::PrintToString(words);
    EXPECT_EQ(ended.out, "");
    EXPECT_NE(ended.err.find(named), std::string::npos) << ended.err;
    EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
  }
}

TEST_F(Evaluate, WhatCannotBeMeantIsRefused) {
  const std::string tree = folder_.path("tree.csv");
  for (const auto& words :
       std::vector<std::vector<std::string>>{{"simulation"},
                                             {"simulation", "--tree", tree, "--views", "61"},
                                             {"simulation", "--tree", tree, "--noise-px", "nan"},
                                             {"simulation", "--tree", tree, "--visible-fraction", "0"},
                                             {"simulation", "--tree", tree, "--trials", "0"},
                                             {"simulation", "--tree", tree, "--trials", "2.5"},
                                             {"simulation", "--tree", tree, "--model-axes", "xyz"},
                                             {"paper", "--trials", "-1"},
                                             {"paper", "--table", "4"},
                                             {"paper", "--figure", "noise"}}) {
    const auto ended = test::run("angio-evaluate", words);
    EXPECT_EQ(ended.exit_code, 2) << testing::PrintToString(words) << ended.err;
    EXPECT_EQ(ended.out, "");
  }
  // More than two planes are those of a turn, and a turn has more than one; a sequence turns, and only in it one
  // breathes.
  for (const auto& [words, named] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--views", "3"}, "turn_deg"},
           {{"--turn-deg", "6"}, "turn_deg"},
           {{"--turn-s", "1"}, "turn_deg"},
           {{"--turn-s", "1", "--turn-deg", "6", "--views", "2"}, "views"},
           {{"--turn-s", "1", "--turn-deg", "6", "--from", "images"}, "images"},
           {{"--breath-mm", "5"}, "turn_s"}}) {
    std::vector<std::string> all{"simulation", "--tree", tree};
    all.insert(all.end(), words.begin(), words.end());
    const auto ended = test::run("angio-evaluate", all);
    EXPECT_EQ(ended.exit_code, 1) << ended.out;
    EXPECT_NE(ended.err.find(named), std::string::npos) << ended.err;
  }
}

// A bent tree's depth, which one view leaves to the start, by the frames of a turn.
TEST_F(Evaluate, ATurnIsOneSequence) {
  const auto depth_mm = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"simulation",
                                   "--tree",
                                   folder_.path("tree.csv"),
                                   "--method",
                                   "oriented_kernel",
                                   "--nonrigid",
                                   "--trials",
                                   "3",
                                   "--seed",
                                   "5",
                                   "--deformation-mm",
                                   "2",
                                   "--out",
                                   folder_.path("t.json")};
    words.insert(words.end(), more.begin(), more.end());
    const auto ended = test::run("angio-evaluate", words);
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    const Json results = Json::parse(test::contentOf(folder_.path("t.json")));
    return results["methods"]["oriented_kernel"]["summary"]["depth_mm"]["median"].get<double>();
  };
  EXPECT_LT(depth_mm({"--turn-deg", "6", "--turn-s", "1", "--breath-mm", "5"}), 0.5 * depth_mm({}));
}

}  // namespace
}  // namespace angio::test
