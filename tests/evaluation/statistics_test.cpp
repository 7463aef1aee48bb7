// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/statistics.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/not_a_number.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace angio::test {
namespace {

TEST(Statistics, KnowsPercentilesOfAShortList) {
  // numpy.percentile([3, 1, 4, 1, 5], ...) with its default, linear interpolation.
  const std::vector<double> values = {3, 1, 4, 1, 5};
  EXPECT_DOUBLE_EQ(percentile(values, 0.5), 3);
  EXPECT_DOUBLE_EQ(percentile(values, 0.25), 1);
  EXPECT_DOUBLE_EQ(percentile(values, 0.9), 4.6);
  EXPECT_DOUBLE_EQ(percentile(values, 0), 1);
  EXPECT_DOUBLE_EQ(percentile(values, 1), 5);
  EXPECT_DOUBLE_EQ(mean(values), 2.8);
}

TEST(Statistics, ClampsTheShareAndKnowsShortLists) {
  EXPECT_DOUBLE_EQ(percentile({7, 9}, 1.5), 9);
  EXPECT_DOUBLE_EQ(percentile({7, 9}, -1), 7);
  EXPECT_DOUBLE_EQ(percentile({7}, 0.3), 7);
  EXPECT_DOUBLE_EQ(percentile({}, 0.5), 0);
  EXPECT_DOUBLE_EQ(mean({}), 0);
}

TEST(Statistics, WhatIsNotANumberIsTheWorst) {
  const std::vector<double> values = {kNan, 2, kNan, 1, 3};
  EXPECT_DOUBLE_EQ(percentile(values, 0), 1);
  EXPECT_DOUBLE_EQ(percentile(values, 0.5), 3);
  EXPECT_TRUE(std::isnan(percentile(values, 1)));
}

}  // namespace
}  // namespace angio::test
