// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/camera_calibration.hpp"
#include "angio/test/namespace.hpp"

#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>

#include "angio/base/formatted.hpp"
#include "angio/calibration/direct_linear.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/test/temporary_folder.hpp"
#include "camera_bundle.hpp"
#include "camera_scenes.hpp"
#include "map_turn.hpp"

namespace angio::test {
namespace {

using test::kDetector;

double valueOf(const CalibrationRecord& record, const std::string& name) {
  const auto at = std::find(record.parameters.begin(), record.parameters.end(), name);
  EXPECT_NE(at, record.parameters.end()) << name;
  return record.values[at - record.parameters.begin()];
}

TEST(CameraBundle, JacobiansAreThoseOfDifferences) {
  test::Random random(1);
  // A grid's map, of the second order, of dozens of pixels; differences stay within its circle.
  DisplacementPolynomial map{2, Eigen::Matrix2Xd(2, DisplacementPolynomial::termCount(2))};
  for (Eigen::Index k = 0; k < map.coefficients_px.cols(); ++k)
    map.coefficients_px.col(k) = random.vector(20).head<2>();
  const auto grid = DetectorDistortion::polynomial({500, 520}, 900, map);
  const std::pair<LensKind, std::optional<DetectorDistortion>> lenses[] = {
      {LensKind::kNone, {}}, {LensKind::kRadial, {}}, {LensKind::kIntensifier, {}}, {LensKind::kNone, grid}};
  for (const auto& [kind, known] : lenses) {
    CameraBundle bundle;
    bundle.model = {kind, {511.5, 511.5}, 512, 1.1, known};
    if (known) bundle.model.turn = turnOf(*known);
    CameraCalibrationSettings settings;
    settings.distortion = kind;
    settings.skew = true;
    bundle.parameters = freeParameters(settings, true, known.has_value());
    bundle.values = Eigen::VectorXd::Constant(bundle.parameters.map.cols(), 0.02);
    bundle.values.head<4>() << 4400, 4410, 500, 520;
    BundleView view;
    view.distance_m = 1.25;
    view.points_m = 0.04 * Eigen::Matrix3Xd::Ones(3, 1);
    view.seen_px = 400 * Eigen::Matrix2Xd::Ones(2, 1);
    view.stds_px = Eigen::VectorXd::Constant(1, 0.5);
    view.T_camera_phantom.linear() = test::anyRotation(random);
    view.T_camera_phantom.translation() = Eigen::Vector3d(0.01, -0.02, 0.8);
    // The bead is of the second of two plates, and they are shifted by millimetres.
    bundle.views = {view};
    bundle.addPlates({{1}, 2, {Eigen::VectorXd::LinSpaced(6, -2, 3), Eigen::MatrixXd::Identity(6, 6)}},
                     {{"view", {{0, {0, 0}, 1}}, {}, false, CArmJoints::Zero()}});
    view = bundle.views.front();
    const auto cost = beadCost(bundle, view, 0);
    const Vector6d step = random.twist(0.01, 0.3);
    const double* const blocks[] = {bundle.values.data(), step.data()};
    ceres::NumericDiffOptions options;
    options.relative_step_size = 1e-5;
    ceres::GradientChecker checker(cost.get(), static_cast<const std::vector<const ceres::Manifold*>*>(nullptr),
                                   options);
    ceres::GradientChecker::ProbeResults probe;
    // Ridders' differences are good to 1e-9 or so of entries up to 1e4.
    EXPECT_TRUE(checker.Probe(blocks, 1e-6, &probe)) << probe.error_log;
  }
}

TEST(CameraCalibration, CovarianceIsThatOfItsErrors) {
  const BeadPhantom phantom = helixPhantom({45, 130, 4, 36, 1.6, 3.2});
  const CameraFile truth{test::trueCamera(), {}, {}};
  const auto& p = truth.camera.parameters();
  test::Random random(21);
  constexpr int kTrials = 200;
  constexpr double kNoise_px = 0.1;
  double principal = 0, all = 0, depth = 0, rms = 0;
  CameraCalibrationSettings settings;
  settings.noise_px = kNoise_px;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto scene = test::cameraScene(phantom, truth, 20, kNoise_px, random);
    const CameraCalibration result = calibrateCamera(phantom, kDetector, scene.views, settings);
    const Eigen::Vector4d error = result.record.values.head<4>() - Eigen::Vector4d(p.fx_px, p.fy_px, p.cx_px, p.cy_px);
    const Eigen::Matrix4d covariance = result.record.covariance.topLeftCorner<4, 4>();
    all += squaredMahalanobis(Eigen::VectorXd(error), covariance) / kTrials;
    principal += squaredMahalanobis(Eigen::VectorXd(error.tail<2>()), covariance.bottomRightCorner<2, 2>()) / kTrials;
    double mean_depth_m = 0;
    for (std::size_t v = 0; v < scene.views.size(); ++v) {
      mean_depth_m += (scene.T_camera_phantom[v] * phantom.center_m()).z() / 20;
    }
    const double depth_error_mm = result.record.values[4] - 1e3 * mean_depth_m;
    depth += depth_error_mm * depth_error_mm / result.record.covariance(4, 4) / kTrials;
    rms += result.record.residual_rms / kTrials;
  }
  // Means of 200 chi-squares: 95 % of them within +-1.96 sqrt(2 n / 200).
  EXPECT_NEAR(principal, 2, 1.96 * std::sqrt(2 * 2.0 / kTrials));
  EXPECT_NEAR(all, 4, 1.96 * std::sqrt(2 * 4.0 / kTrials));
  EXPECT_NEAR(depth, 1, 1.96 * std::sqrt(2 * 1.0 / kTrials));
  EXPECT_LT(rms, 0.15);
}

TEST(CameraCalibration, SourceStandsWithinAFifthOfAMillimetreForAFullPhantom) {
  const BeadPhantom phantom = helixPhantom();
  test::Random random(12);
  const auto scene = test::cameraScene(phantom, {test::trueCamera(), {}, {}}, 20, 0.1, random);
  const CameraCalibration result = calibrateCamera(phantom, kDetector, scene.views);
  EXPECT_NEAR(result.noise_px, 0.1, 0.005);  // 4,000 residuals: one per cent.
  double squared = 0;
  for (std::size_t v = 0; v < scene.views.size(); ++v) {
    squared +=
        (result.views[v].T_camera_phantom.inverse().translation() - scene.T_camera_phantom[v].inverse().translation())
            .squaredNorm() /
        20;
  }
  EXPECT_LT(1e3 * std::sqrt(squared), 0.2);
}

TEST(CameraCalibration, FindsAnIntensifiersDistortion) {
  const XrayCamera camera = test::trueCamera();
  const RadialBend bend{0.06, -0.008, degToRad(3), degToRad(-0.5)};
  const CameraFile truth{camera, DetectorDistortion::intensifier(camera, bend), {}};
  test::Random random(13);
  auto scene = test::cameraScene(helixPhantom(), truth, 12, 0.1, random);
  scene.views[3].held_out = true;
  CameraCalibrationSettings settings;
  settings.distortion = LensKind::kIntensifier;
  const CameraCalibration result = calibrateCamera(helixPhantom(), kDetector, scene.views, settings);
  const auto near = [&](const char* name, double expected) {
    EXPECT_NEAR(valueOf(result.record, name), expected, 4 * result.record.sigma(name)) << name;
  };
  near("cx_px", camera.parameters().cx_px);
  near("fx_px", camera.parameters().fx_px);
  near("k1", bend.k1);
  near("k2", bend.k2);
  near("s1_deg", 3);
  near("s2_deg", -0.5);
  ASSERT_TRUE(result.record.held_out_rms);
  EXPECT_LT(*result.record.held_out_rms, 0.2);  // 0.14 of the noise, and a pose by half of the beads.
}

TEST(CameraCalibration, FindsHowKFollowsTheDistance) {
  const BeadPhantom phantom = helixPhantom();
  test::Random random(14);
  std::vector<BeadView> views;
  constexpr double kOffset_m = -4e-3;
  for (const double distance_m : {1.0, 1.1, 1.2}) {
    XrayCamera::Parameters p = test::trueCamera(distance_m).parameters();
    p.fx_px = p.fy_px = (distance_m + kOffset_m) / 0.25e-3;
    p.cx_px += 12 * (distance_m - 1.1);
    p.cy_px -= 30 * (distance_m - 1.1);
    const auto scene = test::cameraScene(phantom, {XrayCamera(p), {}, {}}, distance_m == 1.1 ? 8 : 6, 0.1, random);
    for (BeadView view : scene.views) {
      view.name += formatted(" at %.1f", distance_m);
      views.push_back(view);
    }
  }
  const CameraCalibration result = calibrateCamera(phantom, kDetector, views);
  ASSERT_TRUE(result.camera.distance_law);
  const auto& record = result.record;
  EXPECT_NEAR(1e3 * kOffset_m, 1e3 * result.camera.distance_law->offset_m,
              4 * record.sigma("source_detector_offset_mm"));
  EXPECT_LT(record.sigma("source_detector_offset_mm"), 5);
  EXPECT_NEAR(12e-3, valueOf(record, "principal_point_slope_x_px_per_mm"),
              4 * record.sigma("principal_point_slope_x_px_per_mm"));
  EXPECT_EQ(result.camera.camera.parameters().source_detector_distance_m, 1.1);
  EXPECT_NEAR(result.camera.at(1.2).camera.parameters().fx_px, 4784, 4 * record.sigma("fx_px"));
}

TEST(CameraCalibration, LeavesOutAndNamesWhatDoesNotFit) {
  test::Random random(15);
  const BeadPhantom phantom = helixPhantom();
  auto scene = test::cameraScene(phantom, {test::trueCamera(), {}, {}}, 12, 0.1, random);
  scene.views[2].beads[7].center_px.x() += 3;
  const auto foreign = test::cameraScene(phantom, {test::trueCamera(1.2), {}, {}}, 12, 0.1, random);
  scene.views[5].beads = foreign.views[5].beads;
  const CameraCalibration result = calibrateCamera(phantom, kDetector, scene.views);
  EXPECT_TRUE(result.views[2].is_outlier[7]);
  EXPECT_EQ(std::count(result.views[2].is_outlier.begin(), result.views[2].is_outlier.end(), true), 1);
  for (std::size_t v = 0; v < 12; ++v) EXPECT_EQ(result.views[v].left_out, v == 5) << v;
  EXPECT_NEAR(result.noise_px, 0.1, 0.01);

  for (std::size_t v = 0; v < 12; v += 2)
    scene.views[v].beads = foreign.views[v].beads;  // And no encoder that says so.
  const std::string line = test::refusalOf([&] { calibrateCamera(phantom, kDetector, scene.views); });
  EXPECT_NE(line.find("do not share one camera"), std::string::npos) << line;
}

class CameraRefusal : public testing::Test {
 protected:
  void expect(const std::string& words, const BeadPhantom& phantom, const CameraCalibrationSettings& settings = {}) {
    const std::string line = test::refusalOf([&] { calibrateCamera(phantom, kDetector, views_, settings); });
    EXPECT_NE(line.find(words), std::string::npos) << line;
  }

  test::Random random_{16};
  BeadPhantom phantom_ = helixPhantom();
  std::vector<BeadView> views_ = test::cameraScene(phantom_, {test::trueCamera(), {}, {}}, 6, 0.1, random_).views;
};

TEST_F(CameraRefusal, MirroredViews) {
  for (BeadView& view : views_) {
    for (SeenBead& seen : view.beads) seen.center_px.x() = 1023 - seen.center_px.x();
  }
  expect("mirrored against the phantom", phantom_);
}

TEST_F(CameraRefusal, OneViewOverAndOver) {
  const BeadView first = views_[0];
  for (BeadView& view : views_) {
    view.beads = first.beads;
    for (SeenBead& seen : view.beads) seen.center_px += 0.1 * random_.vector(1).head<2>();
  }
  expect("6 views that show them in one place", phantom_);
}

TEST_F(CameraRefusal, MirroredPhantom) {
  for (Bead& bead : phantom_.beads) bead.position_m.y() *= -1;
  expect("mirrored against the phantom", phantom_);
}

TEST_F(CameraRefusal, SwappedBeads) {
  std::swap(views_[4].beads[20].bead, views_[4].beads[33].bead);
  const int a = views_[4].beads[20].bead, b = views_[4].beads[33].bead;
  expect("5: bead = " + std::to_string(std::min(a, b)) + ", " + std::to_string(std::max(a, b)), phantom_);
}

TEST_F(CameraRefusal, BeadsOfAnotherNumbering) {
  for (SeenBead& seen : views_[1].beads) seen.bead = (seen.bead * 7) % 108;
  expect("must fit one projection", phantom_);
}

TEST_F(CameraRefusal, WrongUnits) {
  for (Bead& bead : phantom_.beads) bead.position_m *= 10;  // Centimetres; a file a thousand times off is not read.
  expect("must be 100 to 5000 mm from the source", phantom_);
  phantom_ = helixPhantom();
  for (BeadView& view : views_) view.source_detector_distance_m = 0.11;
  expect("are the units right?", phantom_);
}

TEST_F(CameraRefusal, TooLittleDepthIsNamedBeforeSolving) {
  BeadPhantom thin = phantom_;
  for (Bead& bead : thin.beads) bead.position_m *= 0.1;
  views_ = test::cameraScene(thin, {test::trueCamera(), {}, {}}, 3, 0.1, random_).views;
  expect("cannot be told apart", thin);
}

TEST_F(CameraRefusal, PlanesAtOneTilt) {
  BeadPhantom grid;
  grid.name = "grid";
  for (int i = 0; i < 49; ++i) grid.beads.push_back({{0.02 * (i % 7) - 0.06, 0.02 * (i / 7) - 0.06, 0}, 0});
  const Eigen::Matrix3d tilt = expSO3({0.4, 0.1, 0});
  views_.clear();
  for (int v = 0; v < 5; ++v) {
    const Pose T = test::phantomView(grid, expSO3({0.01 * v, 0, 0}) * tilt, {0.005 * v, 0, 0.7 + 0.03 * v});
    BeadView view{std::to_string(v), {}, {}, false};
    for (int i = 0; i < 49; ++i)
      view.beads.push_back({i, *test::trueCamera().project(T * grid.beads[i].position_m), 1});
    views_.push_back(view);
  }
  expect("all views are parallel", grid);
  views_.resize(2);
  expect("must be at least 3", grid);
}

TEST_F(CameraRefusal, BeadsThatCannotBe) {
  views_[0].beads[3].bead = views_[0].beads[4].bead;
  expect("must not be named twice", phantom_);
  views_[0].beads[3].bead = 108;
  expect("must be 0 to 107", phantom_);
  views_[0].beads.erase(views_[0].beads.begin() + 3);
  views_[1].beads.resize(5);
  expect("must be at least 8", phantom_);
}

// Zhang's own answer, by least squares over all corners: https://www.microsoft.com/en-us/research/project/a-flexible-
// new-technique-for-camera-calibration-2 (completecalibration.txt).
TEST(CameraCalibration, AgreesWithZhang) {
  const ViewSet set = readViewSet(test::exampleData("calib-zhang/views.yaml"));
  const BeadPhantom grid = readBeadPhantom(set.phantom_path);
  const SeenViewSet seen = seenViews(set, grid);
  CameraCalibrationSettings settings;
  settings.distortion = LensKind::kRadial;
  settings.skew = true;
  const CalibrationRecord record = calibrateCamera(grid, seen.detector, seen.views, settings).record;
  EXPECT_NEAR(valueOf(record, "fx_px"), 832.5, 0.1);
  EXPECT_NEAR(valueOf(record, "fy_px"), 832.53, 0.1);
  EXPECT_NEAR(valueOf(record, "cx_px"), 303.959, 0.1);
  EXPECT_NEAR(valueOf(record, "cy_px"), 206.585, 0.1);
  EXPECT_NEAR(valueOf(record, "skew_px"), 0.204494, 0.01);
  EXPECT_NEAR(valueOf(record, "k1"), -0.228601, 0.01 * 0.228601);
  EXPECT_NEAR(valueOf(record, "k2"), 0.190353, 0.01 * 0.190353);
}

// Photographs of a chessboard by a camera that its maker has calibrated (RealSense: 607.6 px, at 323.5, 243.3).
TEST(CameraCalibration, ReadsPhotographsOfAChessboard) {
  NEED_SHARED_DATA("visp-handeye/eye-in-hand/franka_image-1.png");
  const test::TemporaryFolder folder;
  std::string text = "chessboard: {corners: [9, 6], square_mm: 23.6}\nviews:\n";
  for (int i = 1; i <= 8; ++i) {
    const std::string name = "franka_image-" + std::to_string(i) + ".png";
    text += "  - {name: \"" + std::to_string(i) + "\", image: " + name + "}\n";
    std::filesystem::copy(test::sharedData("visp-handeye/eye-in-hand/" + name), folder.path(name));
  }
  const ViewSet set = readViewSet(folder.write("views.yaml", text));
  const BeadPhantom board = phantomOf(set);
  ASSERT_EQ(board.beads.size(), 54U);
  EXPECT_NEAR((board.beads[53].position_m - Eigen::Vector3d(8 * 0.0236, 5 * 0.0236, 0)).norm(), 0, 1e-12);
  const SeenViewSet seen = seenViews(set, board);
  const CameraCalibration result = calibrateCamera(board, seen.detector, seen.views, {});
  EXPECT_LT(result.record.residual_rms, 1);
  EXPECT_NEAR(valueOf(result.record, "fx_px"), 607.6, 0.03 * 607.6);
  EXPECT_NEAR(valueOf(result.record, "fy_px"), 607.6, 0.03 * 607.6);
}

Eigen::MatrixXd numbersIn(const std::string& path, int columns) {
  std::ifstream file(path);
  std::vector<double> numbers;
  for (double number; file >> number;) numbers.push_back(number);
  return Eigen::Map<Eigen::MatrixXd>(numbers.data(), columns, static_cast<Eigen::Index>(numbers.size()) / columns);
}

TEST(CameraCalibration, SolvesTheExactPointsOfASimulatedAngiogram) {
  NEED_SHARED_DATA("xcat-coronary/frame1_3d.txt");
  for (const std::string frame : {"1", "2"}) {
    const Eigen::Matrix3Xd points = 1e-3 * numbersIn(test::sharedData("xcat-coronary/frame" + frame + "_3d.txt"), 3);
    const Eigen::Matrix2Xd seen_mm = numbersIn(test::sharedData("xcat-coronary/frame" + frame + "_2d.txt"), 2);
    const auto P = directLinearTransform(points, seen_mm);
    ASSERT_TRUE(P);
    const ProjectionParts parts = decomposed(*P);
    EXPECT_FALSE(parts.mirrored);
    EXPECT_NEAR(parts.K(0, 0), 1194, 1e-4 * 1194);
    EXPECT_NEAR(parts.K(1, 1), 1194, 1e-4 * 1194);
    EXPECT_LT(parts.K.col(2).head<2>().norm(), 1e-4 * 1194);
    CameraBundle bundle;
    bundle.parameters = freeParameters({}, false);
    bundle.values = Eigen::Vector4d(1194, 1194, 0, 0);
    BundleView view;
    view.points_m = points;
    view.seen_px = seen_mm;
    view.stds_px = Eigen::VectorXd::Ones(points.cols());
    view.use.assign(static_cast<std::size_t>(points.cols()), true);
    view.T_camera_phantom = parts.T_camera_model;
    view.T_camera_phantom = fittedPose(bundle, view);
    EXPECT_LT(bundle.residualsOf(view).colwise().norm().maxCoeff(), 1e-6);
  }
}

}  // namespace
}  // namespace angio::test
