// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/message_conversion.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

RegistrationResult someResult() {
  test::Random random(1);
  RegistrationResult seen;
  seen.status = RegistrationStatus::kConverged;
  seen.T_camera_model = expSE3(random.twist(1, 1));
  seen.covariance = Matrix6d::Identity() * 1e-6;
  seen.alignment.model_residual_px = 0.5;
  seen.points_3d = 12;
  seen.points_2d = 34;
  return seen;
}

TEST(MessageConversion, TheInverseGivesTheSamePoseAndCovariance) {
  const RegistrationResult seen = someResult();
  const RegistrationMessage message = registrationMessage(seen, ModelId{7}, 10, 20);
  EXPECT_EQ(message.model_id, ModelId{7});
  EXPECT_EQ(message.time_us, 10);
  EXPECT_EQ(message.frame_sequence, 20);
  EXPECT_EQ(message.status_text, "converged");
  const RegistrationResult back = registrationResult(message);
  EXPECT_EQ(back.status, seen.status);
  EXPECT_EQ(back.T_camera_model.matrix(), seen.T_camera_model.matrix());
  ASSERT_TRUE(back.covariance);
  EXPECT_EQ(*back.covariance, *seen.covariance);
  EXPECT_EQ(back.alignment.model_residual_px, 0.5);
  EXPECT_EQ(back.points_3d, 12);
  EXPECT_EQ(back.points_2d, 34);
}

TEST(MessageConversion, WhatIsNotFiniteStaysAtRest) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  RegistrationResult seen = someResult();
  seen.status = RegistrationStatus::kDiverged;
  seen.T_camera_model.translation().x() = kNan;
  (*seen.covariance)(0, 0) = kNan;
  seen.alignment.model_residual_px = kNan;
  const RegistrationMessage message = registrationMessage(seen, ModelId::kUnknown, 0, 0);
  EXPECT_EQ(message.T_camera_model.matrix(), Pose::Identity().matrix());
  EXPECT_EQ(message.covariance, Matrix6d::Zero());
  EXPECT_EQ(message.mean_residual_px, 0);
  const RegistrationResult back = registrationResult(message);
  EXPECT_EQ(back.status, RegistrationStatus::kDiverged);
  EXPECT_FALSE(back.covariance);
}

}  // namespace
}  // namespace angio::test
