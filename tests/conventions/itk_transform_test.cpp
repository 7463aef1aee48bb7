// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/itk_transform.hpp"

#include <gmock/gmock.h>

#include "angio/conventions/tfm_file.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

const std::string kTfm =
    "#Insight Transform File V1.0\n#Transform 0\nTransform: Euler3DTransform_double_3_3\n"
    "Parameters: 0 0 1.5707963267948966 1 2 3\nFixedParameters: 10 0 0 0\n";

// By hand: (11, 0, 0) is 1 mm right of the centre (10, 0, 0); a quarter turn about z takes it 1 mm up from there, and t
// adds (1, 2, 3).
TEST(ItkTransform, AQuarterTurnAboutACentreByHand) {
  const TemporaryFolder folder;
  const double half = std::sqrt(0.5);
  const ItkTransform transforms[] = {readTfm(folder.write("euler.tfm", kTfm)),
                                     {ItkTransformType::kVersorRigid3D, {0, 0, half, 1, 2, 3}, {10, 0, 0}},
                                     {ItkTransformType::kAffine, {0, -1, 0, 1, 0, 0, 0, 0, 1, 1, 2, 3}, {10, 0, 0}}};
  for (const ItkTransform& transform : transforms) {
    const Eigen::Vector3d moved = poseOf(transform, "test") * Eigen::Vector3d(11e-3, 0, 0);
    EXPECT_LT((moved - Eigen::Vector3d(11e-3, 3e-3, 3e-3)).norm(), 1e-12);
  }
}

// By hand, with quarter turns about all axes: Rz Rx Ry takes z to Rz Rx x = Rz x = y. With the fourth fixed parameter
// Rz Ry Rx takes z to Rz Ry (-y) = Rz (-y) = x.
TEST(ItkTransform, TheOrderOfAnglesIsInTheFixedParameters) {
  const double q = 0.5 * kPi;
  ItkTransform euler{ItkTransformType::kEuler3D, {q, q, q, 0, 0, 0}, {0, 0, 0, 0}};
  EXPECT_LT((poseOf(euler, "test") * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  euler.fixed_parameters[3] = 1;
  EXPECT_LT((poseOf(euler, "test") * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 1e-12);
}

// Points [mm] that ITK 5.2.1 itself has made of these files, by TransformFileReader and TransformPoint; it has also
// read what writeTfm() writes, of all three types, to the same points.
TEST(ItkTransform, PointsGoWhereItkTakesThem) {
  struct Expected {
    const char* lines;
    Eigen::Vector3d first, second;
  };
  const Expected all[] = {{"Transform: Euler3DTransform_double_3_3\nParameters: 0.1 -0.2 0.3 10 20 30\n"
                           "FixedParameters: 1 2 3 0\n",
                           {18.863585413719, 25.082328847121, 36.829265375937},
                           {118.959928495893, 33.139201967870, 54.600278208409}},
                          {"Transform: VersorRigid3DTransform_double_3_3\nParameters: 0.1 -0.2 0.3 10 20 30\n"
                           "FixedParameters: 1 2 3\n",
                           {16.441693410631, 26.836809247748, 38.743975028288},
                           {102.370035605225, 62.478520220722, 80.529001612073}}};
  const TemporaryFolder folder;
  for (const Expected& expected : all) {
    const std::string head = "#Insight Transform File V1.0\n#Transform 0\n";
    const Pose T = poseOf(readTfm(folder.write("a.tfm", head + expected.lines)), "a.tfm");
    EXPECT_LT((1e3 * (T * Eigen::Vector3d(10e-3, 3e-3, 5e-3)) - expected.first).norm(), 1e-9);
    EXPECT_LT((1e3 * (T * Eigen::Vector3d(110e-3, -17e-3, 5e-3)) - expected.second).norm(), 1e-9);
  }
}

TEST(ItkTransform, FilesGiveBackAnyPoseAboutAnyCentre) {
  const TemporaryFolder folder;
  Random random(2);
  for (const auto type : {ItkTransformType::kEuler3D, ItkTransformType::kVersorRigid3D, ItkTransformType::kAffine}) {
    for (int trial = 0; trial < 20; ++trial) {
      const Pose T = randomProjection(random).T_camera_model;
      writeTfm(folder.path("a.tfm"), itkTransformOf(T, type, random.vector(50)));
      const Pose back = poseOf(readTfm(folder.path("a.tfm")), "a.tfm");
      EXPECT_LT((back.matrix() - T.matrix()).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

TEST(ItkTransform, BrokenFilesAreRefusedInOneLine) {
  const TemporaryFolder folder;
  const auto refusal = [&](const std::string& what, const std::string& instead) {
    const std::string path = folder.write("bad.tfm", with(kTfm, what, instead));
    return refusalOf([&] { readTfm(path); });
  };
  EXPECT_THAT(refusal("#Insight", "#Other"), HasSubstr("bad.tfm:1: must begin with #Insight Transform File V1.0"));
  EXPECT_THAT(refusal("Euler3D", "BSpline"), HasSubstr("bad.tfm:3: Transform = BSplineTransform_double_3_3: must be"));
  EXPECT_THAT(refusal("Parameters: 0 0 1.5", "Parameters: 0 x 1.5"), HasSubstr("bad.tfm:4: Parameters = x"));
  EXPECT_THAT(refusal(" 1 2 3", " 1 2"), HasSubstr("Parameters = 5 numbers: must be 6"));
  EXPECT_THAT(refusal("FixedParameters: 10 0 0 0\n", ""), HasSubstr("FixedParameters: is missing"));
  EXPECT_THAT(refusal("FixedParameters: 10 0 0 0", "Transform: AffineTransform_double_3_3"),
              HasSubstr("must stand once"));
  EXPECT_THAT(refusal("1.5707963267948966", "nan"), HasSubstr("Parameters = nan"));
}

}  // namespace
}  // namespace angio::test
