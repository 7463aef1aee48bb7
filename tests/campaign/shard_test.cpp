// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include <algorithm>
#include <set>

#include "angio/campaign/identity.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

TEST(Shard, EachRunIsOfOneShardAndAllHaveAsMuchToDo) {
  for (const int count : {1, 2, 4, 7}) {
    for (int part = 0; part < 3; ++part) {
      std::vector<int> runs(static_cast<std::size_t>(count));
      for (int run = 0; run < 100; ++run) {
        int owners = 0;
        for (int number = 1; number <= count; ++number) {
          if (!Shard{number, count}.has(part, run)) continue;
          ++owners;
          ++runs[static_cast<std::size_t>(number - 1)];
        }
        EXPECT_EQ(owners, 1);
      }
      const auto [least, most] = std::minmax_element(runs.begin(), runs.end());
      EXPECT_LE(*most - *least, 1);
    }
  }
}

// Trial i has tree i modulo their number: with as many shards, dealing in turn alone would give each shard one tree.
TEST(Shard, EachMeetsEveryTree) {
  constexpr int kTrees = 4;
  for (int number = 1; number <= kTrees; ++number) {
    std::set<int> trees;
    for (int run = 0; run < 40; ++run) {
      if (Shard{number, kTrees}.has(0, run)) trees.insert(run % kTrees);
    }
    EXPECT_EQ(trees.size(), static_cast<std::size_t>(kTrees));
  }
}

TEST(Shard, IsNamedByItsNumberAndHowManyThereAre) {
  EXPECT_EQ(shardNamed("2/4").name(), "2/4");
  for (const char* wrong : {"", "2", "/", "0/4", "5/4", "2/4/4", "-1/4", " 1/4", "1/10001", "99999999999/4", "a/b"}) {
    EXPECT_THAT(refusalOf([&] { (void)shardNamed(wrong); }), testing::HasSubstr("--shard")) << wrong;
  }
}

TEST(Arguments, OfShardsAreTheSameWhereverResultsGo) {
  const std::vector<std::string> given = {"simulation", "--tree", "a.csv",    "--shard=2/4", "--out",     "2.json",
                                          "--threads",  "2",      "--trials", "9",           "--no-times"};
  EXPECT_EQ(sharedArguments(given), (std::vector<std::string>{"simulation", "--tree", "a.csv", "--trials", "9"}));
  EXPECT_EQ(unsharedOption(sharedArguments(given)), "");
  for (const std::string writes : {"--out", "--report=x", "--film", "--sheet=", "--print-settings", "-h"}) {
    EXPECT_EQ(unsharedOption({"simulation", writes}), writes.substr(0, writes.find('=')));
  }
  EXPECT_EQ(shellCommand({"a", "b c", "it's", ""}), "a 'b c' 'it'\\''s' ''");
}

}  // namespace
}  // namespace angio::test
