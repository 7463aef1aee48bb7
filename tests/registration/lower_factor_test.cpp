// SPDX-License-Identifier: GPL-2.0-or-later
#include "lower_factor.hpp"

#include <gtest/gtest.h>

namespace angio::registration {
namespace {

// Of a block of a larger matrix, whose columns are further apart than they are long, and of sizes that fill no vector.
TEST(LowerFactor, TimesItsTransposeIsTheMatrix) {
  for (const Eigen::Index n : {1, 7, 64, 203}) {
    const Eigen::MatrixXd random = Eigen::MatrixXd::Random(n, n);
    const Eigen::MatrixXd symmetric = random * random.transpose() + Eigen::MatrixXd::Identity(n, n);
    Eigen::MatrixXd large = Eigen::MatrixXd::Constant(n + 3, n + 2, 7);
    large.block(2, 1, n, n).triangularView<Eigen::Lower>() = symmetric;
    ASSERT_TRUE(factorLower(large.block(2, 1, n, n)));
    const Eigen::MatrixXd L = large.block(2, 1, n, n).triangularView<Eigen::Lower>();
    EXPECT_TRUE((L * L.transpose()).isApprox(symmetric, 1e-12)) << n;
    EXPECT_EQ(large(0, 0), 7);
    EXPECT_EQ(large(n + 2, n + 1), 7);
  }
}

TEST(LowerFactor, IsNoneOfAMatrixThatIsNotPositive) {
  Eigen::MatrixXd indefinite = Eigen::MatrixXd::Identity(40, 40);
  indefinite(25, 25) = -1;
  EXPECT_FALSE(factorLower(indefinite));
}

}  // namespace
}  // namespace angio::registration
