// SPDX-License-Identifier: GPL-2.0-or-later
// The records that the network of pairwise_dnn learns from.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "angio/test/namespace.hpp"
#include "angio/test/program.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

constexpr std::size_t kPicture = 96 * 96, kRecord = 6 * sizeof(float) + 4 * kPicture;

TEST(TrainingPairs, AreWholeRecordsThatASeedRepeats) {
  const TemporaryFolder folder;
  const auto written = [&](const std::string& name, const std::string& seed) {
    const auto ended = test::run("angio-training-pairs", {"--out", folder.path(name), "--trees", "2", "--views", "2",
                                                          "--starts", "2", "--seed", seed});
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    return test::contentOf(folder.path(name));
  };
  const std::string pairs = written("a.bin", "5");
  ASSERT_EQ(pairs.size() % kRecord, 0u);
  ASSERT_GE(pairs.size() / kRecord, 4u);
  for (std::size_t at = 0; at < pairs.size(); at += kRecord) {
    float motion[6];
    std::memcpy(motion, pairs.data() + at, sizeof(motion));
    for (const float px : motion) EXPECT_LE(std::abs(px), 15) << "and is a number";
    // Nothing is where 128 stands; a picture of a tree shows something.
    for (std::size_t p = 0; p < 4; ++p) {
      const std::string picture = pairs.substr(at + sizeof(motion) + p * kPicture, kPicture);
      EXPECT_NE(picture, std::string(kPicture, picture[0])) << p;
    }
  }
  EXPECT_EQ(pairs, written("b.bin", "5"));
  EXPECT_NE(pairs, written("c.bin", "6"));
}

TEST(TrainingPairs, SayWhereTheyCannotBeWritten) {
  const auto ended = test::run("angio-training-pairs", {"--out", "/nowhere/pairs.bin", "--trees", "1"});
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_NE(ended.err.find("/nowhere/pairs.bin"), std::string::npos) << ended.err;
}

}  // namespace
}  // namespace angio::test
