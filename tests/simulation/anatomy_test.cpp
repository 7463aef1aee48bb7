// SPDX-License-Identifier: GPL-2.0-or-later
#include "anatomy.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/test/namespace.hpp"
#include "scenes.hpp"
#include "volume_rays.hpp"

namespace angio::test {
namespace {

struct Span {
  double in, out;
  double length() const { return out - in; }
};

Span meet(const ShapeInView& shape, double dx, double dy) {
  Span span{};
  shape.meet({dx, 0, dy, 1}, &span.in, &span.out);
  return span;
}

TEST(Shapes, AreMetAlongTheirChords) {
  Pose T = test::inView();
  T.linear() = expSO3({0.4, -0.2, 0.7});
  const Eigen::Vector3d center(0.01, -0.02, 0.03), at = T * center;
  const Shape ball{Shape::Kind::kEllipsoid, center, {0.02, 0.02, 0.02}, Eigen::Matrix3d::Identity()};
  const ShapeInView seen(ball, T);
  for (const Eigen::Vector2d& off : {Eigen::Vector2d(0, 0), Eigen::Vector2d(0.01, 0.005), Eigen::Vector2d(0.03, 0)}) {
    const Eigen::Vector3d d(at.x() / at.z() + off.x(), at.y() / at.z() + off.y(), 1);
    const double miss = at.cross(d.normalized()).norm();
    const double chord = miss < 0.02 ? 2 * std::sqrt(0.0004 - miss * miss) : 0;
    EXPECT_NEAR(meet(seen, d.x(), d.y()).length() * d.norm(), chord, 1e-12);
  }
  // Along a cylinder's axis, and across it.
  const Shape drum{Shape::Kind::kCylinder, {0, 0, 0}, {0.02, 0.01, 0.05}, Eigen::Matrix3d::Identity()};
  EXPECT_NEAR(meet(ShapeInView(drum, test::inView()), 0, 0).length(), 0.1, 1e-12);
  Pose lying = test::inView();
  lying.linear() = expSO3({kPi / 2, 0, 0});
  EXPECT_NEAR(meet(ShapeInView(drum, lying), 0, 0).length(), 0.02, 1e-12);
}

// Points along each ray are inside, by the definition of the shape, between `in` and `out` and nowhere else; 37 rays
// fill no whole number of vectors.
TEST(Shapes, AreMetByRows) {
  Pose T = test::inView();
  T.linear() = expSO3({0.9, -0.4, 0.2});
  constexpr int kRays = 37;
  for (const Shape::Kind kind : {Shape::Kind::kEllipsoid, Shape::Kind::kCylinder}) {
    const Shape shape{kind, {0.01, 0, -0.01}, {0.03, 0.015, 0.02}, expSO3({0.3, 0.2, 0.1})};
    const Eigen::Vector3d at = T * shape.center;
    const auto inside = [&](const Eigen::Vector3d& p) {
      const Eigen::Vector3d u =
          (shape.axes.transpose() * (T.inverse() * p - shape.center)).cwiseQuotient(shape.half_axes);
      return kind == Shape::Kind::kEllipsoid ? u.norm() < 1 : u.head<2>().norm() < 1 && std::abs(u.z()) < 1;
    };
    const RayRow row{at.x() / at.z() - 0.05, 0.1 / kRays, at.y() / at.z() + 0.003, kRays};
    std::vector<double> in(kRays), out(kRays);
    ShapeInView(shape, T).meet(row, in.data(), out.data());
    int met = 0;
    for (int i = 0; i < kRays; ++i) {
      const Eigen::Vector3d d(row.dx + i * row.step, row.dy, 1);
      met += out[i] > in[i];
      for (double t = at.z() - 0.05; t < at.z() + 0.05; t += 0.0007) {
        if (std::min(std::abs(t - in[i]), std::abs(t - out[i])) < 1e-9) continue;
        ASSERT_EQ(inside(t * d), t > in[i] && t < out[i]) << "ray " << i << " at " << t;
      }
    }
    EXPECT_GT(met, 5);
    EXPECT_LT(met, kRays - 5);
  }
}

TEST(AttenuationVolumes, AddUpAlongARay) {
  AttenuationVolume volume;
  volume.size = {20, 30, 40};
  volume.spacing_m = {2e-3, 1e-3, 0.5e-3};
  volume.T_model_volume.translation() << -0.019, -0.0145, -0.00975;  // Its middle is at the model's origin.
  for (int k = 0; k < 40; ++k) {
    for (int j = 0; j < 30; ++j) {
      for (int i = 0; i < 20; ++i) volume.attenuation_per_m.push_back(20 + i);
    }
  }
  volume.check();
  // Straight through the middle: attenuation is 29.5 everywhere on a way of 39 half millimetres; trilinear is exact.
  EXPECT_NEAR(VolumeRays(volume, test::inView()).logAttenuation(0, 0), 29.5 * 39 * 0.5e-3, 1e-5);
  Pose turned = test::inView();
  turned.linear() = expSO3({0, kPi / 2, 0});  // Along i: from 20 to 39 over 38 mm.
  EXPECT_NEAR(VolumeRays(volume, turned).logAttenuation(0, 0), 29.5 * 19 * 2e-3, 1e-5);
  EXPECT_EQ(VolumeRays(volume, test::inView()).logAttenuation(0.1, 0), 0);
  EXPECT_NEAR(attenuationOfHounsfield(0), 20.6, 1e-4);
  EXPECT_EQ(attenuationOfHounsfield(-1000), 0);

  volume.attenuation_per_m.pop_back();
  EXPECT_THROW(FluoroscopyRenderer(test::straight(1e-3), {}, {Eigen::Matrix3d::Identity(), volume}), InputError);
}

TEST(Anatomy, MovesWithThePatientAndStandsUpright) {
  FluoroscopySettings settings = test::withoutNoise({});
  settings.contrast_attenuation_per_mm = 0;
  settings.background_strength = 0;
  settings.anatomy.contrast = 1;
  settings.anatomy.gas = 0;
  const CArmGeometry carm;
  const auto view = [&](double primary_deg, const Eigen::Matrix3d& R_lps_model) {
    Pose T_lps_model = Pose::Identity();
    T_lps_model.linear() = R_lps_model;
    const Pose T = carm.T_camera_patient(carm.jointsFor({degToRad(primary_deg), 0}, {0, 0, 0})) * T_lps_model;
    const VesselTree dot = test::segment({-1e-3, 0, 0}, {1e-3, 0, 0}, 1e-3);
    return FluoroscopyRenderer(dot, settings, {R_lps_model, {}})
        .render(XrayCamera::centered(256, 256, 1e-3, 1.113), T, 0);
  };
  // The same patient in other model axes looks the same.
  const cv::Mat frontal = view(0, Eigen::Matrix3d::Identity());
  EXPECT_LE(cv::norm(view(0, expSO3({0.5, 1, -2})), frontal, cv::NORM_INF), 700);  // 1 % where an edge meets a node.
  // From the front the spine stands beside the liver, on the patient's left (35 mm; the image's left, as the source
  // sees it): the darkest column of the lower half.
  cv::Mat columns;
  cv::reduce(frontal.rowRange(128, 256), columns, 0, cv::REDUCE_AVG, CV_64F);
  cv::Point darkest;
  cv::minMaxLoc(columns, nullptr, nullptr, &darkest);
  const double spine_px = 127.5 - 0.035 * 1.113e3 / (0.81 - 0.062);
  EXPECT_NEAR(darkest.x, spine_px, 36);
  // Lungs are above, and bright.
  EXPECT_GT(cv::mean(frontal.rowRange(0, 64))[0], 1.2 * cv::mean(frontal.rowRange(192, 256))[0]);
  EXPECT_GT(cv::norm(view(90, Eigen::Matrix3d::Identity()), frontal, cv::NORM_L1) / 65536, 2000);
}

}  // namespace
}  // namespace angio::test
