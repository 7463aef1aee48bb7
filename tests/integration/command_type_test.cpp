// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "angio/cli/program.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

enum class Fruit { kApple, kPear };

// A command line with an option of each kind, and what it has read.
struct Kinds {
  Kinds() {
    cli::describeProgram(program, "angio-fruit --kind pear file");
    const std::map<std::string, Fruit> names = {{"apple", Fruit::kApple}, {"pear", Fruit::kPear}};
    program.addOption("--kind", kind, "Kind")->check(cli::choice(names))->defaultText("apple");
    program.addOption("--other", other, "Another kind")->check(cli::choice(names));
    program.addOption("--weight-g", weight_g, "Weight")->check(cli::between(0, 1000));
    program.addOption("--count", count, "Number")->check(cli::wholeBetween(1, 9));
    auto* from = program.addOption("--from", from_mm, "Place")->delimiter(',')->expected(2);
    program.addOption("--list", list, "Lists")->oneAtATime()->excludes(from);
    program
        .addSetter<double>(
            "--size-mm", [this](double size) { size_mm = size; }, "Size", 80.0)
        ->needs(from);
    cli::Command* files = program.addGroup("Files", "At least one of them", 2);
    file = files->addOption("file", name, "File");
    files->addFlag("--none", none, "No file");
    program.onRead([this] {
      if (count == 7) cli::refuseValue("--count", "must not be 7");
    });
  }

  int read(std::vector<std::string> words) {
    words.insert(words.begin(), "angio-fruit");
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int code = cli::runProgram(program, static_cast<int>(pointers.size()), pointers.data(), [] { return 5; });
    out = testing::internal::GetCapturedStdout();
    err = testing::internal::GetCapturedStderr();
    return code;
  }

  cli::Command program{"Weighs fruits.", "angio-fruit"};
  Fruit kind = Fruit::kApple;
  std::optional<Fruit> other;
  double weight_g = 150;
  std::optional<int> count;
  std::vector<double> from_mm;
  std::vector<std::string> list;
  double size_mm = 0;
  std::string name, out, err;
  bool none = false;
  cli::Option* file = nullptr;
};

TEST(CommandTypes, ReadEachKindOfValue) {
  Kinds kinds;
  EXPECT_EQ(kinds.read({"--kind", "Pear", "--weight-g", "2.5", "--count", "3", "--from", "1,2", "--size-mm", "7", "f"}),
            5);
  EXPECT_EQ(kinds.kind, Fruit::kPear);
  EXPECT_FALSE(kinds.other);
  EXPECT_EQ(kinds.weight_g, 2.5);
  EXPECT_EQ(kinds.count, 3);
  EXPECT_THAT(kinds.from_mm, testing::ElementsAre(1, 2));
  EXPECT_EQ(kinds.size_mm, 7);
  EXPECT_EQ(kinds.name, "f");
  EXPECT_TRUE(kinds.file->given());

  Kinds others;
  EXPECT_EQ(others.read({"--other", "apple", "--list", "a", "--list", "b", "--none"}), 5);
  EXPECT_EQ(others.other, Fruit::kApple);
  EXPECT_THAT(others.list, testing::ElementsAre("a", "b"));
  EXPECT_TRUE(others.none);
  EXPECT_FALSE(others.file->given());
  EXPECT_EQ(others.size_mm, 0);  // A default is not set.
}

TEST(CommandTypes, RefuseWhatIsWrongWithTheirOwnCode) {
  const std::vector<std::vector<std::string>> wrong = {
      {"--kind", "plum", "f"},       {"--weight-g", "nan", "f"},
      {"--weight-g", "1001", "f"},   {"--count", "0", "f"},
      {"--count", "2.5", "f"},       {"--from", "1", "--none"},
      {"--size-mm", "7", "f"},       {"--from", "1,2", "--list", "a", "--none"},
      {"--count", "7", "f"},         {"--weight-g", "2"},
      {"--no-such-option", "1", "f"}};
  for (const auto& words : wrong) {
    Kinds kinds;
    EXPECT_EQ(kinds.read(words), 2) << words[0] << " " << words[1];
    EXPECT_EQ(kinds.out, "");
    EXPECT_NE(kinds.err, "");
  }
}

TEST(CommandTypes, ShowDefaultsAndNamesInTheHelp) {
  Kinds kinds;
  EXPECT_EQ(kinds.read({"--help"}), 0);
  for (const char* shown : {"ENUM:{apple,pear}=apple", "--weight-g FLOAT:FLOAT in [0 - 1000]=150", "--size-mm FLOAT=80",
                            "INT:INT in [1 - 9]", "Files", "Needs: --from", "Excludes: --from"}) {
    EXPECT_NE(kinds.out.find(shown), std::string::npos) << shown << "\n" << kinds.out;
  }
}

}  // namespace
}  // namespace angio::test
