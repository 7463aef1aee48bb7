// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "angio/geometry/carm.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// Depths are single precision, a few centimetres from their origin: steps of 4 nm, and square roots near a tube's rim
// make more of it. A micrometre of contrast is 0.007 % of the beam.
constexpr double kTolerance = 1e-6;  // [m]

XrayCamera wideCamera() { return XrayCamera::centered(400, 300, 0.25e-3, 1.1); }

VesselTree segments(const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>& ends, double radius_m) {
  Eigen::Matrix3Xd points(3, 2 * ends.size());
  std::vector<int> parents;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    points.col(2 * i) = ends[i].first;
    points.col(2 * i + 1) = ends[i].second;
    parents.insert(parents.end(), {-1, static_cast<int>(2 * i)});
  }
  return VesselTree(points, parents, std::vector<std::optional<double>>(parents.size(), radius_m));
}

cv::Mat pathLength(const VesselTree& tree, const XrayCamera& seen_by = wideCamera(), const Pose& T = Pose::Identity()) {
  return FluoroscopyRenderer(tree, {}).pathLength(seen_by, T);
}

double distanceToSegment(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d along = b - a;
  const double t = std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (p - a - t * along).norm();
}

TEST(PathLength, IsTheChordOfACylinderAtAnyAngleToTheBeam) {
  const double r = 2e-3;
  for (const double tilt_deg : {0.0, 35.0, 70.0}) {
    const Eigen::Vector3d center(1e-3, -2e-3, 0.75);
    const Eigen::Vector3d u =
        Eigen::Vector3d(std::cos(degToRad(tilt_deg)), 0.3, std::sin(degToRad(tilt_deg))).normalized();
    const cv::Mat path = pathLength(segments({{center - 0.08 * u, center + 0.08 * u}}, r));
    int inside = 0;
    for (int y = 0; y < path.rows; ++y) {
      for (int x = 0; x < path.cols; ++x) {
        const Eigen::Vector3d d = wideCamera().ray({x, y}).normalized();
        const double sine = u.cross(d).norm(), miss = std::abs(center.dot(u.cross(d))) / sine;
        const double chord = miss < r ? 2 * std::sqrt(r * r - miss * miss) / sine : 0;
        const Eigen::Vector3d nearest = center + u * ((center.dot(d) * d - center).dot(u) / (sine * sine));
        if ((nearest - center).norm() > 0.07) continue;  // Near the ends it is no cylinder.
        inside += chord > 0;
        // A rim pixel's chord goes with the square root of its distance: 1e-9 m there are 2 um here.
        ASSERT_NEAR(path.at<float>(y, x), chord, chord < 1e-4 ? 5e-6 : kTolerance) << x << ", " << y;
      }
    }
    EXPECT_GT(inside, 5000);
  }
}

TEST(PathLength, IsTheChordOfASphereForATubeWithoutLength) {
  const double r = 5e-3;
  const Eigen::Vector3d center(10e-3, 5e-3, 0.7);
  const cv::Mat path = pathLength(segments({{center, center + Eigen::Vector3d(0, 0, 1e-9)}}, r));
  for (int y = 0; y < path.rows; ++y) {
    for (int x = 0; x < path.cols; ++x) {
      const double miss = center.cross(wideCamera().ray({x, y}).normalized()).norm();
      const double chord = miss < r ? 2 * std::sqrt(r * r - miss * miss) : 0;
      ASSERT_NEAR(path.at<float>(y, x), chord, chord < 1e-4 ? 5e-6 : kTolerance) << x << ", " << y;
    }
  }
}

// Whether any ball of the sweep holds p. How deep p is in the ball at t is concave in t, so that a ternary search finds
// the deepest; it shares no formula with the program.
bool inSweep(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b, double ra, double rb) {
  double low = 0, high = 1;
  const auto depth = [&](double t) { return ra + t * (rb - ra) - (p - a - t * (b - a)).norm(); };  // Concave in t.
  for (int k = 0; k < 60; ++k) {
    const double third = (high - low) / 3;
    (depth(low + third) < depth(high - third) ? low : high) =
        depth(low + third) < depth(high - third) ? low + third : high - third;
  }
  return depth(0.5 * (low + high)) > 0;
}

// Tapers from nearly none to those of an ostium, where the vessel narrows by more than half of the length, and to a
// ball that holds the other one.
TEST(PathLength, IsTheChordOfATaperedTubeAtAnyAngleToTheBeam) {
  const double tilts_deg[] = {-90, -70, -35, 0, 35, 70, 90};
  const std::pair<double, double> radii[] = {
      {2e-3, 1.99e-3}, {1e-3, 1.8e-3}, {5e-3, 2.4e-3}, {2e-3, 5.5e-3}, {6e-3, 1e-3}};
  Random random(7);
  int inside = 0;
  for (const double tilt_deg : tilts_deg) {
    for (const auto& [ra, rb] : radii) {
      const Eigen::Vector3d u(std::cos(degToRad(tilt_deg)), 0, std::sin(degToRad(tilt_deg)));
      const Eigen::Vector3d a(1e-3, -2e-3, 0.75), b = a + 4e-3 * u;
      const VesselTree tree((Eigen::Matrix3Xd(3, 2) << a, b).finished(), {-1, 0}, {ra, rb});
      const cv::Mat path = pathLength(tree);
      for (int trial = 0; trial < 40; ++trial) {
        const auto seen =
            wideCamera().project(a + random.uniform(0, 1) * (b - a) + random.vector(0.6 * std::max(ra, rb)));
        const int x = static_cast<int>(std::lround(seen->x())), y = static_cast<int>(std::lround(seen->y()));
        const Eigen::Vector3d d = wideCamera().ray({x, y}).normalized();
        const auto holds = [&](double s) { return inSweep(s * d, a, b, ra, rb); };
        double first = 0, last = 0;
        for (double s = 0.735; s < 0.765; s += 0.1e-3) {
          if (!holds(s)) continue;
          if (first == 0) first = s;
          last = s;
        }
        const auto edge = [&](double in, double out) {  // By bisection.
          for (int k = 0; k < 30; ++k) (holds(0.5 * (in + out)) ? in : out) = 0.5 * (in + out);
          return in;
        };
        const double chord = first > 0 ? edge(last, last + 0.1e-3) - edge(first, first - 0.1e-3) : 0;
        inside += chord > 0;
        // A chord of less than the steps of the search may be missed by it.
        ASSERT_NEAR(path.at<float>(y, x), chord, chord < 0.5e-3 ? 0.15e-3 : 2 * kTolerance)
            << tilt_deg << " deg, " << ra << " to " << rb << " at " << x << ", " << y;
      }
    }
  }
  EXPECT_GT(inside, 700);
}

TEST(PathLength, SeesAVesselEndOn) {
  XrayCamera::Parameters p = wideCamera().parameters();
  p.cx_px = 200, p.cy_px = 150;  // A pixel whose ray runs exactly along the axis.
  const cv::Mat path = pathLength(segments({{{0, 0, 0.70}, {0, 0, 0.73}}}, 1.5e-3), XrayCamera(p));
  EXPECT_NEAR(path.at<float>(150, 200), 0.033, kTolerance);
}

TEST(PathLength, AgreesWithSamplingAlongTheRaysOfABranchingTree) {
  const VesselTree shape = test::branchingTree(5);
  const double r = 1.2e-3;
  const VesselTree tree(shape.points(), shape.parents(), std::vector<std::optional<double>>(shape.size(), r));
  test::Random random(6);
  const Pose T = test::viewOf(tree, random);
  const cv::Mat path = pathLength(tree, test::clinicalCamera(), T);
  const Eigen::Matrix3Xd seen = T * tree.points();
  const double step = 20e-6;
  int hits = 0;
  for (int trial = 0; trial < 60; ++trial) {
    // Around the tree's points, where vessels are; half a millimetre of scatter reaches the rims.
    const int near = static_cast<int>(random.uniform(0, tree.size()));
    const auto pixel = test::clinicalCamera().project(seen.col(near) + random.vector(0.5e-3));
    const int x = static_cast<int>(std::lround(pixel->x())), y = static_cast<int>(std::lround(pixel->y()));
    const Eigen::Vector3d d = test::clinicalCamera().ray({x, y}).normalized();
    std::vector<int> close;
    for (int i = 0; i < tree.size(); ++i) {
      if (tree.parents()[i] >= 0 && seen.col(i).cross(d).norm() < 4e-3) close.push_back(i);
    }
    double sampled = 0;
    for (double s = 0.6; s < 0.9; s += step) {
      for (const int i : close) {
        if (distanceToSegment(s * d, seen.col(tree.parents()[i]), seen.col(i)) < r) {
          sampled += step;
          break;
        }
      }
    }
    hits += sampled > 0;
    // Each end of a vessel on the ray is off by up to a step; no ray here meets more than five vessels.
    EXPECT_NEAR(path.at<float>(y, x), sampled, 10 * step) << x << ", " << y;
  }
  EXPECT_GT(hits, 40);
}

TEST(PathLength, AddsVesselsThatCrossAndCountsOverlapOnce) {
  const std::pair<Eigen::Vector3d, Eigen::Vector3d> across{{-0.03, 0, 0.75}, {0.03, 0, 0.75}};
  const std::pair<Eigen::Vector3d, Eigen::Vector3d> behind{{0, -0.03, 0.77}, {0, 0.03, 0.77}};
  const std::pair<Eigen::Vector3d, Eigen::Vector3d> through{{0, -0.03, 0.75}, {0, 0.03, 0.75}};
  const cv::Mat a = pathLength(segments({across}, 1e-3)), b = pathLength(segments({behind}, 1e-3));
  EXPECT_LT(cv::norm(pathLength(segments({across, behind}, 1e-3)), a + b, cv::NORM_INF), kTolerance);
  cv::Mat largest;
  cv::max(a, pathLength(segments({through}, 1e-3)), largest);  // Axes meet: the longer chord holds the shorter one.
  EXPECT_LT(cv::norm(pathLength(segments({across, through}, 1e-3)), largest, cv::NORM_INF), 20e-6);
  EXPECT_EQ(cv::norm(pathLength(segments({across, across, across}, 1e-3)), a, cv::NORM_INF), 0);
}

TEST(PathLength, LeavesOutWhatLiesBehindTheSource) {
  EXPECT_EQ(
      cv::countNonZero(pathLength(segments({{{-0.1, 0, -0.5}, {0.1, 0, -0.5}}, {{0, 0, -0.1}, {0, 0, 0}}}, 1e-3))), 0);
}

TEST(PathLength, IsDeepestOnTheProjectedCentreline) {
  const Eigen::Vector3d a(-0.02, -0.03, 0.72), b(0.025, 0.03, 0.78);
  const cv::Mat path = pathLength(segments({{a, b}}, 1e-3));
  const Eigen::Vector2d start = *wideCamera().project(a), end = *wideCamera().project(b);
  double bias = 0;
  for (int y = 60; y < 240; ++y) {
    double mass = 0, moment = 0;
    for (int x = 0; x < path.cols; ++x) {
      mass += path.at<float>(y, x);
      moment += path.at<float>(y, x) * x;
    }
    const double expected = start.x() + (y - start.y()) / (end.y() - start.y()) * (end.x() - start.x());
    // Whole pixels sample a profile with steep rims: the centre of a row of a dozen of them wavers by up to 0.1 px.
    EXPECT_NEAR(moment / mass, expected, 0.12) << y;
    bias += (moment / mass - expected) / 180;
  }
  EXPECT_NEAR(bias, 0,
              0.01);  // Over many rows the wavering cancels; a shift by half a pixel or a wrong centre does not.
}

}  // namespace
}  // namespace angio::test
