// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <sstream>

#include "angio/test/namespace.hpp"
#include "angio/test/program.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

class CommandLines : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Programs, CommandLines,
                         testing::Values("angio-register", "angio-evaluate", "angio-servo", "angio-simulate",
                                         "angio-navigate", "angio-extract-centerline"),
                         [](const auto& program) {
                           std::string name = std::string(program.param).substr(6);
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST_P(CommandLines, HelpHasDefaultsAndAnExample) {
  const auto ended = test::run(GetParam(), {"--help"});
  EXPECT_EQ(ended.exit_code, 0);
  EXPECT_EQ(ended.err, "");
  EXPECT_NE(ended.out.find("Example:\n  " + std::string(GetParam())), std::string::npos) << ended.out;
}

TEST_P(CommandLines, VersionIsOneLine) {
  const auto ended = test::run(GetParam(), {"--version"});
  EXPECT_EQ(ended.exit_code, 0);
  EXPECT_EQ(ended.err, "");
  EXPECT_EQ(ended.out.find(std::string(GetParam()) + " "), 0u) << ended.out;
  EXPECT_EQ(ended.out.find('\n'), ended.out.size() - 1);
}

TEST_P(CommandLines, AnUnknownOptionIsAWrongCommandLine) {
  const auto ended = test::run(GetParam(), {"--no-such-option"});
  EXPECT_EQ(ended.exit_code, 2);
  EXPECT_EQ(ended.out, "");
  EXPECT_NE(ended.err, "");
}

// What is on one screen, or nearly; --help-all has the rest, and no option is in neither.
TEST(CommandLine, HelpIsShortAndPrintable) {
  const std::vector<std::vector<std::string>> programs = {{"angio-best-view"},
                                                          {"angio-calibrate", "camera"},
                                                          {"angio-calibrate", "geometry"},
                                                          {"angio-calibrate", "hand-eye"},
                                                          {"angio-calibrate", "registration"},
                                                          {"angio-calibrate", "simulate"},
                                                          {"angio-calibrate"},
                                                          {"angio-check-machine"},
                                                          {"angio-evaluate", "cases"},
                                                          {"angio-evaluate", "catheter"},
                                                          {"angio-evaluate", "extraction"},
                                                          {"angio-evaluate", "paper"},
                                                          {"angio-evaluate", "simulation"},
                                                          {"angio-evaluate"},
                                                          {"angio-extract-centerline"},
                                                          {"angio-inspect"},
                                                          {"angio-navigate"},
                                                          {"angio-operator"},
                                                          {"angio-register"},
                                                          {"angio-replay"},
                                                          {"angio-servo"},
                                                          {"angio-simulate"},
                                                          {"angio-simulate-loop", "view"},
                                                          {"angio-simulate-loop", "navigate"},
                                                          {"angio-simulate-loop"},
                                                          {"angio-slicer"},
                                                          {"angio-spy"},
                                                          {"angio-view"}};
  for (const auto& words : programs) {
    const auto helpBy = [&words](const char* flag) {
      std::vector<std::string> arguments(words.begin() + 1, words.end());
      arguments.emplace_back(flag);
      const auto ended = test::run(words.front(), arguments);
      EXPECT_EQ(ended.exit_code, 0) << words.front() << ended.err;
      return ended.out;
    };
    const std::string help = helpBy("--help"), all = helpBy("--help-all");
    EXPECT_LE(std::count(help.begin(), help.end(), '\n'), 60) << help;
    for (const char c : help + all) {
      ASSERT_TRUE(c == '\n' || std::isprint(static_cast<unsigned char>(c))) << words.front() << ": " << int(c);
    }
    EXPECT_GE(all.size(), help.size()) << all;
  }
  EXPECT_EQ(test::run("angio-servo", {"--help"}).out.find("--preview"), std::string::npos);
  EXPECT_NE(test::run("angio-servo", {"--help-all"}).out.find("--preview"), std::string::npos);
}

// What is printed is a settings file of the same program, and says of each key what it is. What else a command line
// must have is not asked for.
TEST(CommandLine, PrintedSettingsAreASettingsFile) {
  const std::vector<std::vector<std::string>> programs = {{"angio-best-view"},
                                                          {"angio-calibrate", "camera"},
                                                          {"angio-calibrate", "geometry"},
                                                          {"angio-calibrate", "simulate"},
                                                          {"angio-check-machine"},
                                                          {"angio-evaluate", "cases"},
                                                          {"angio-evaluate", "catheter"},
                                                          {"angio-evaluate", "extraction"},
                                                          {"angio-evaluate", "paper"},
                                                          {"angio-evaluate", "simulation"},
                                                          {"angio-extract-centerline"},
                                                          {"angio-navigate"},
                                                          {"angio-register"},
                                                          {"angio-replay"},
                                                          {"angio-replay", "--machine", "catheter"},
                                                          {"angio-servo"},
                                                          {"angio-simulate"},
                                                          {"angio-simulate-loop", "view"},
                                                          {"angio-simulate-loop", "faults"},
                                                          {"angio-simulate-loop", "centre"},
                                                          {"angio-simulate-loop", "navigate"}};
  const TemporaryFolder folder;
  for (const auto& words : programs) {
    const std::string name = words.front() + (words.size() > 1 ? " " + words[1] : "");
    std::vector<std::string> arguments(words.begin() + 1, words.end());
    arguments.emplace_back("--print-settings");
    const auto printed = test::run(words.front(), arguments);
    EXPECT_EQ(printed.exit_code, 0) << name << printed.err;
    EXPECT_EQ(printed.err, "") << name;
    EXPECT_NE(printed.out.find("  # "), std::string::npos) << name << printed.out;

    std::istringstream lines(printed.out);
    for (std::string line; std::getline(lines, line);) {
      const auto comment = line.find("  # ");
      const std::string key = line.substr(0, comment);
      const bool is_section = !key.empty() && key.back() == ':';
      if (is_section) continue;
      ASSERT_NE(comment, std::string::npos) << name << ": " << line;
      const std::string meaning = line.substr(comment + 4);
      EXPECT_TRUE(std::isupper(static_cast<unsigned char>(meaning[0])) ||
                  std::isdigit(static_cast<unsigned char>(meaning[0])))
          << name << ": " << line;
      EXPECT_NE(meaning.rfind("; "), std::string::npos) << name << ": " << line;
    }

    arguments.insert(arguments.end(), {"--settings", folder.write("printed.yaml", printed.out)});
    const auto again = test::run(words.front(), arguments);
    EXPECT_EQ(again.exit_code, 0) << name << again.err;
    EXPECT_EQ(again.err, "") << name;
    EXPECT_EQ(again.out, printed.out) << name;
  }
}

TEST(CommandLine, PrintedSettingsAreThoseInForce) {
  const TemporaryFolder folder;
  const std::string path = folder.write("s.yaml", "view: {reached_mm: 0.75}\n");
  for (const std::vector<std::string>& order :
       {std::vector<std::string>{"--settings", path, "--print-settings"}, {"--print-settings", "--settings", path}}) {
    const auto printed = test::run("angio-servo", order);
    EXPECT_EQ(printed.exit_code, 0) << printed.err;
    EXPECT_NE(printed.out.find("  reached_mm: 0.75  # "), std::string::npos) << printed.out;
  }
  const auto refused =
      test::run("angio-servo", {"--print-settings", "--settings", folder.write("bad.yaml", "latency_ms: -1\n")});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(refused.out, "");
  EXPECT_NE(refused.err.find("bad.yaml:1: latency_ms = -1: must lie between 0 and 2000"), std::string::npos)
      << refused.err;
}

TEST(CommandLine, DefaultsStandInTheHelp) {
  const std::string help = test::run("angio-servo", {"--help"}).out;
  for (const char* line : {"--view-primary-deg FLOAT", "--seed", "--duration-s"}) {
    EXPECT_NE(help.find(line), std::string::npos) << help;
  }
  EXPECT_NE(help.find("=30"), std::string::npos) << help;
  EXPECT_NE(test::run("angio-evaluate", {"cases", "--help"}).out.find("iterative_pnp"), std::string::npos);
}

TEST(CommandLine, FormerNamesOfOptionsAndProgramsAreReadForOneMinorVersion) {
  const auto ended = test::run("angio-servo", {"--simulate", "--largest-calibration-age-days=-1"});
  EXPECT_EQ(ended.exit_code, 2);  // The value is refused, under the name that the option has now.
  EXPECT_EQ(ended.err.find("angio-servo: --largest-calibration-age-days is called --max-calibration-age-days now\n"),
            0u)
      << ended.err;
  EXPECT_NE(ended.err.find("--max-calibration-age-days: Value -1"), std::string::npos) << ended.err;
  EXPECT_EQ(test::run("angio-rehearse", {"--version"}).out.find("angio-simulate-loop "), 0u);
}

// What others would have to say of frames, in a simulation that has nobody else.
TEST(CommandLine, AClosedLoopHasNobodyToTellItWhatItsFramesShow) {
  const auto refusal = [](std::vector<std::string> words) {
    const auto ended = test::run("angio-servo", words);
    EXPECT_EQ(ended.exit_code, 1);
    return ended.err;
  };
  EXPECT_EQ(refusal({"--simulate", "--perception", "bus"}),
            "angio-servo: scenario: perception = bus: needs a bus with a perception node on it\n");
  EXPECT_EQ(refusal({"--simulate", "--task", "centre", "--centre-on", "catheter_tip"}),
            "angio-servo: scenario: centre.on = catheter_tip: needs a bus with a catheter's loop on it\n");
  EXPECT_EQ(refusal({"--task", "hold", "--centre-on", "catheter_tip"}),
            "angio-servo: command line: --centre-on = catheter_tip: needs the task centre, and not hold\n");
}

TEST(CommandLine, WhatCannotBeMeantIsRefused) {
  const std::vector<std::pair<const char*, std::vector<std::string>>> lines = {
      {"angio-register", {}},
      {"angio-register", {"--tree", "t.csv", "--camera", "c.yaml", "--initial-pose", "p.yaml"}},  // Nothing is seen.
      {"angio-register",
       {"--tree", "t.csv", "--camera", "c.yaml", "--centerline", "l.csv", "--initial-pose", "p.yaml",
        "--search-rotation-deg", "181"}},
      {"angio-register",
       {"--tree", "t.csv", "--camera", "c.yaml", "--centerline", "l.csv", "--initial-pose", "p.yaml",
        "--search-translation-mm", "nan"}},
      {"angio-register",  // A proof is of the rigid tree.
       {"--tree", "t.csv", "--camera", "c.yaml", "--centerline", "l.csv", "--initial-pose", "p.yaml", "--certify",
        "--nonrigid"}},
      {"angio-register",  // No proof is asked for.
       {"--tree", "t.csv", "--camera", "c.yaml", "--centerline", "l.csv", "--initial-pose", "p.yaml",
        "--certify-seconds", "5"}},
      {"angio-evaluate", {}},
      {"angio-evaluate", {"cases"}},
      {"angio-servo", {"--simulate", "--bus", "memq://"}},
      {"angio-navigate", {}},
      {"angio-navigate", {"--to-branch", "13", "--to-mm", "-1"}},
      {"angio-servo", {"--simulate", "--seed", "-1"}},
      {"angio-servo", {"--simulate", "--view-primary-deg", "nan"}},
      {"angio-servo", {"--simulate", "--view-secondary-deg", "56"}},
      {"angio-servo", {"--duration-s", "inf"}},
      {"angio-simulate", {"--frame-rate-hz", "nan"}},
      {"angio-simulate", {"--frame-rate-hz", "0"}},
      {"angio-simulate", {"--start-primary-deg", "many"}}};
  for (const auto& [program, arguments] : lines) {
    const auto ended = test::run(program, arguments);
    EXPECT_EQ(ended.exit_code, 2) << program << " " << testing::PrintToString(arguments);
    EXPECT_EQ(ended.out, "");
    EXPECT_NE(ended.err, "");
  }
}

TEST(CommandLine, ViewsAreAsManyOfEachKind) {
  const std::vector<std::string> two = {"--tree",   "t.csv", "--initial-pose", "p.yaml",
                                        "--camera", "a",     "--camera",       "b"};
  const std::pair<const char*, std::vector<std::string>> lines[] = {
      {"--centerline: 1 given, must be 2", {"--centerline", "a", "--view-pose", "v"}},
      {"--image: 3 given, must be 2", {"--image", "a", "--image", "b", "--image", "c", "--view-pose", "v"}},
      {"--image: 1 given, must be 2", {"--centerline", "a", "--centerline", "b", "--image", "a", "--view-pose", "v"}},
      {"--view-pose: 0 given, must be 1", {"--image", "a", "--image", "b"}}};
  for (const auto& [words, more] : lines) {
    auto arguments = two;
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto ended = test::run("angio-register", arguments);
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_NE(ended.err.find(words), std::string::npos) << ended.err;
  }
}

}  // namespace
}  // namespace angio::test
