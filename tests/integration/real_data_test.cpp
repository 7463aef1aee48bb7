// SPDX-License-Identifier: GPL-2.0-or-later
// The project against data that others measured or computed. What may not be copied into the project is read from the
// folder that ANGIO_SHARED_DATA names; without it those tests are skipped.
#include <ceres/ceres.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "../registration/ceres_costs.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/registration/registration.hpp"
#include "angio/results/statistics.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/program.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/vessel/projection.hpp"
#include "angio/vessel/prune.hpp"
#include "angio/vessel/resample.hpp"
#include "hepatic.hpp"

namespace angio::test {
namespace {

CaseSet phantom() { return readCaseSet(test::exampleData("static-phantom/cases.yaml")); }

double angleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return radToDeg(rotationAngle(a * b.transpose()));
}

double medianDistance(const Centerline2d& from, const Centerline2d& to) {
  std::vector<double> distances;
  for (int j = 0; j < from.size(); ++j) {
    distances.push_back(std::sqrt((to.points_px.colwise() - from.points_px.col(j)).colwise().squaredNorm().minCoeff()));
  }
  return percentile(distances, 0.5);
}

Centerline2d seenFrom(const VesselTree& tree, const Case& run, const Pose& T_camera_model) {
  return projectedCenterline(resampled(tree, 0.5e-3, 100000).tree, run.views[0].camera, T_camera_model);
}

// A wrong sign of an angle, a wrong axis or a frame that is not mirrored costs tens of degrees or tens of pixels.
TEST(StaticPhantom, PosesFollowTheCArmsAnglesAndExplainWhatTheFramesShow) {
  const CaseSet set = phantom();
  const ViewAngles angles[4] = {{degToRad(31.3), degToRad(0.1)},
                                {degToRad(-27.3), degToRad(-0.1)},
                                {degToRad(0.1), degToRad(28.7)},
                                {degToRad(-26.5), degToRad(-32.7)}};
  ASSERT_EQ(set.cases.size(), 4U);
  const VesselTree tree = readVesselTree(set.cases[0].tree_path);
  const auto R_iso_model = [&](std::size_t k, const Pose& T) -> Eigen::Matrix3d {
    return viewRotation(angles[k]).transpose() * T.linear();
  };
  for (std::size_t k = 0; k < 4; ++k) {
    const Case& run = set.cases[k];
    // Poses are written with nine digits.
    EXPECT_LT(angleBetween(R_iso_model(k, run.initial_pose), R_iso_model(0, set.cases[0].initial_pose)), 1e-6)
        << run.name;
    for (std::size_t other = 0; other < k; ++other) {
      // No angle was held when the references were found; the angles are good to about a degree.
      EXPECT_LT(angleBetween(R_iso_model(k, *run.truth_pose), R_iso_model(other, *set.cases[other].truth_pose)), 1.1)
          << run.name << " and " << set.cases[other].name;
    }
    // The vessels are 6 px wide, and their centreline is found to a part of that.
    EXPECT_LT(medianDistance(readCenterline(*run.views[0].centerline_path), seenFrom(tree, run, *run.truth_pose)), 1)
        << run.name;
  }
}

TEST(StaticPhantom, StoredCentrelinesAreWhatTheExtractorFindsInTheFrames) {
  const auto settings = readSettings(test::exampleData("static-phantom/settings.yaml"), ExtractorSections());
  const auto extractor = makeExtractor(settings.named(OtsuSettings::kName));
  for (const Case& run : phantom().cases) {
    const Centerline2d stored = readCenterline(*run.views[0].centerline_path);
    const Centerline2d found = extractor->extract(readXrayImage(*run.views[0].image_path, run.views[0].camera));
    // Points need not be the same ones: half their spacing of 2 px along a line.
    EXPECT_LT(medianDistance(stored, found), 1) << run.name;
    EXPECT_NEAR(found.size(), stored.size(), 0.1 * stored.size()) << run.name;
  }
}

// 2 deg: the angles' own error and what a single view leaves open; a pose that is reversed in depth is further off.
TEST(StaticPhantom, NoMethodTrustsAWrongPoseAndOneFindsEveryRun) {
  const CaseSet set = phantom();
  const VesselTree tree = readVesselTree(set.cases[0].tree_path);
  for (const char* method : {"iterative_pnp", "oriented_kernel"}) {
    const auto registration = makeRegistration(registrationSettingsNamed(method), tree);
    int found = 0;
    for (const Case& run : set.cases) {
      const Centerline2d seen = readCenterline(*run.views[0].centerline_path);
      const auto result = registration->search(seen, run.views[0].camera, {run.initial_pose, {}}, StartSettings());
      if (result.status != RegistrationStatus::kConverged) continue;
      ++found;
      EXPECT_LT(angleBetween(result.T_camera_model.linear(), run.truth_pose->linear()), 2)
          << method << ", " << run.name;
      EXPECT_LT(medianDistance(seen, seenFrom(tree, run, result.T_camera_model)), 2) << method << ", " << run.name;
    }
    if (method == std::string("oriented_kernel")) {
      EXPECT_EQ(found, 4);
    }
  }
}

// The phantom is rigid. A deformed fit may explain its image with another depth: it then says how open depth is, and no
// task that needs depth takes it. 3 mm is what such a task lets the worst direction be unsure by.
TEST(StaticPhantom, ADeformedFitWithAnotherDepthSaysThatDepthIsOpen) {
  const CaseSet set = phantom();
  const VesselTree tree = readVesselTree(set.cases[0].tree_path);
  OrientedKernelSettings rigid, deformed;
  deformed.deformation = Deformation::kNonrigid;
  const auto rigid_fit = makeRegistration(rigid, tree), deformed_fit = makeRegistration(deformed, tree);
  int deeper = 0;
  for (const Case& run : set.cases) {
    const Centerline2d seen = readCenterline(*run.views[0].centerline_path);
    const PosePrior prior{run.initial_pose, {}};
    const auto r = rigid_fit->search(seen, run.views[0].camera, prior, StartSettings());
    const auto d = deformed_fit->search(seen, run.views[0].camera, prior, StartSettings());
    ASSERT_EQ(r.status, RegistrationStatus::kConverged) << run.name;
    const Eigen::Vector3d c = tree.centroid();
    const double depth_m = std::abs((d.T_camera_model * c - r.T_camera_model * c).z());
    if (depth_m < 3e-3) continue;
    ++deeper;
    if (d.status != RegistrationStatus::kConverged) continue;
    ASSERT_TRUE(d.points) << run.name;
    const double claimed_m = PatientObservation::of(d).depthStd_m(c);
    EXPECT_GT(claimed_m, 3e-3) << run.name;
    EXPECT_LT(depth_m, 2 * claimed_m) << run.name;
  }
  EXPECT_GE(deeper, 1) << "no run asks anything of the claim";
}

// The phantom was bent by more than a breath bends an organ. How far is no reason to refuse a fit, and no reason to
// believe one that leaves a fifth of what the mask shows unexplained.
TEST(AneurysmPhantom, ALargeDeformationIsClassifiedByWhatItExplains) {
  const Case run = readCaseSet(test::exampleData("fevar-aaa-phantom/cases.yaml")).cases.at(0);
  const VesselTree tree = readVesselTree(run.tree_path);
  RidgeSettings wide;
  wide.max_radius_px = 60;  // Of the aorta.
  const Centerline2d seen =
      vesselsToMatch(makeExtractor(wide)->extract(readXrayImage(*run.views[0].image_path, run.views[0].camera)));
  for (const bool held : {false, true}) {
    for (const double std_mm : {4., 8., 12.}) {
      OrientedKernelSettings settings;
      settings.deformation = Deformation::kNonrigid;
      settings.nonrigid.std_mm = std_mm;
      if (held) settings.prior_rotation_std_deg = 0.5, settings.prior_translation_std_mm = 1;
      const auto r = makeRegistration(settings, tree)
                         ->search(seen, run.views[0].camera, PosePrior{run.initial_pose, {}}, StartSettings());
      const std::string which = (held ? "held, " : "free, ") + std::to_string(std_mm);
      if (r.status == RegistrationStatus::kConverged) {
        EXPECT_GE(r.alignment.image_explained, 0.8) << which;
      }
      if (held && std_mm > 4) {
        // Three quarters of the tree lie on the mask's centreline within 3 px of some hundred that it was moved by.
        EXPECT_GT(r.alignment.model_explained, 0.7) << which << ": " << r.reason;
        EXPECT_THAT(r.reason, testing::HasSubstr("of the image")) << which;
      }
    }
  }
}

TEST(StaticPhantom, PublishedCentrelineIsTheTreeOfTheExample) {
  NEED_SHARED_DATA("static-phantom/Centerlines.vtk");
  const VesselTree published = readVesselTree(test::sharedData("static-phantom/Centerlines.vtk"));
  const VesselTree tree = readVesselTree(phantom().cases[0].tree_path);
  EXPECT_EQ(published.parents(), tree.parents());
  EXPECT_LT((published.points() - tree.points()).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(tree.branches().size(), 11U);
}

std::vector<std::vector<double>> rowsOf(const std::string& path, std::size_t columns) {
  std::ifstream file(path);
  std::vector<std::vector<double>> rows;
  for (double value; file >> value;) {
    if (rows.empty() || rows.back().size() == columns) rows.emplace_back();
    rows.back().push_back(value);
  }
  return rows;
}

// The pose that explains the matches best, from `start`; gives the root mean square error in pixels.
double fitPose(const XrayCamera& camera, const Eigen::Matrix3Xd& points, const Eigen::Matrix2Xd& pixels, Pose& T) {
  double rms_px = 1e9;
  for (int round = 0; round < 20; ++round) {  // The cost is made for small steps about T.
    ceres::Problem problem;
    double xi[6] = {};
    std::vector<std::array<double, 3>> no_displacements(static_cast<std::size_t>(points.cols()));
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      double* const displacement = no_displacements[static_cast<std::size_t>(i)].data();
      std::fill(displacement, displacement + 3, 0.0);
      problem.AddResidualBlock(new ProjectionCost(camera, T, points.col(i), pixels.col(i), 1), nullptr, xi,
                               displacement);
      problem.SetParameterBlockConstant(displacement);
    }
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-18;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) return rms_px;
    T = T * expSE3(Eigen::Map<const Twist>(xi));
    rms_px = std::sqrt(2 * summary.final_cost / static_cast<double>(points.cols()));
  }
  return rms_px;
}

// 27 exact matches by another program's C-arm: our camera, poses and cost must explain them to the digits of the file.
TEST(XcatCoronary, OurCameraExplainsTheExactMatches) {
  NEED_SHARED_DATA("xcat-coronary/frame1_3d.txt");
  const double spacing_mm = 0.184;
  const XrayCamera camera({960, 960, 1194 / spacing_mm, 1194 / spacing_mm, 480, 480, spacing_mm * 1e-3, 1.194});
  for (const std::string frame : {"1", "2"}) {
    const auto p = rowsOf(test::sharedData("xcat-coronary/frame" + frame + "_3d.txt"), 3);
    const auto q = rowsOf(test::sharedData("xcat-coronary/frame" + frame + "_2d.txt"), 2);
    ASSERT_EQ(p.size(), 27U);
    ASSERT_EQ(q.size(), 27U);
    Eigen::Matrix3Xd points(3, 27);
    Eigen::Matrix2Xd pixels(2, 27);
    for (int i = 0; i < 27; ++i) {
      points.col(i) << p[i][0] * 1e-3, p[i][1] * 1e-3, p[i][2] * 1e-3;
      pixels.col(i) << 480 + q[i][0] / spacing_mm, 480 + q[i][1] / spacing_mm;
    }
    double best_px = 1e9;
    for (int turn = 0; turn < 24 && best_px > 1e-3; ++turn) {  // The model's axes are not known: every side up.
      Pose T = Pose::Identity();
      const Eigen::Vector3d side = Eigen::Vector3d::Unit(turn / 8) * kPi / 2 * (1 + turn % 2);
      T.linear() = expSO3(Eigen::Vector3d(0, 0, kPi / 2 * (turn / 2 % 4))) * expSO3(side);
      T.translation() = Eigen::Vector3d(0, 0, 0.765) - T.linear() * points.rowwise().mean();
      best_px = std::min(best_px, fitPose(camera, points, pixels, T));
    }
    EXPECT_LT(best_px * spacing_mm, 1e-6) << "frame " << frame;  // [mm]; the file has eight digits behind the point.
  }
}

// Trees from MR angiography whose parts are joined at one root, with points that coincide.
TEST(Brava, TreesAreReadAndTakenApartWhereTheyAreJoined) {
  NEED_SHARED_DATA("brava/BG0002.swc");
  int trees = 0;
  for (const auto& file : std::filesystem::directory_iterator(test::sharedData("brava"))) {
    if (file.path().extension() != ".swc") continue;
    ++trees;
    const VesselTree tree = readVesselTree(file.path().string());
    const VesselTree forest = withoutLongEdges(tree, 0.010);
    const VesselTree fine = resampled(forest, 1e-3, 100000).tree;
    EXPECT_LT((fine.tangents().colwise().norm().array() - 1).abs().maxCoeff(), 1e-12) << file.path();
    EXPECT_NEAR(fine.length(), forest.length(), 1e-9) << file.path();
    if (file.path().stem() != "BG0002") continue;
    EXPECT_EQ(tree.size(), 3514);
    EXPECT_EQ(std::count(tree.parents().begin(), tree.parents().end(), -1), 1);
    EXPECT_EQ(std::count(forest.parents().begin(), forest.parents().end(), -1), 5);
  }
  EXPECT_EQ(trees, 10);
}

// One view leaves the depth of a deformed tree to the belief: the same tree at another depth is no other answer, for
// which a fit would be refused, or searched for further away.
TEST(Brava, ATreeThatALungsMotionDeformsIsFoundInOneView) {
  NEED_SHARED_DATA("brava/BG10.swc");
  NEED_SHARED_DATA("lung-motion/case_054.csv");
  const test::TemporaryFolder folder;
  const auto ended = test::run("angio-evaluate", {"simulation",
                                                  "--tree",
                                                  test::sharedData("brava/BG10.swc"),
                                                  "--tree",
                                                  test::sharedData("brava/BH0006.swc"),
                                                  "--deformation-field",
                                                  test::sharedData("lung-motion/case_054.csv"),
                                                  "--deformation-mm",
                                                  "5",
                                                  "--nonrigid",
                                                  "--noise-px",
                                                  "1",
                                                  "--spurious",
                                                  "5",
                                                  "--trials",
                                                  "8",
                                                  "--seed",
                                                  "5",
                                                  "--out",
                                                  folder.path("trials.json")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const auto trials = nlohmann::json::parse(test::contentOf(folder.path("trials.json")));
  const auto& cases = trials["methods"]["oriented_kernel"]["cases"];
  EXPECT_EQ(cases.size(), 8);
  for (const auto& [name, trial] : cases.items()) {
    EXPECT_EQ(trial["status"], "converged") << name << ": " << trial["reason"];
    EXPECT_LE(trial["claim"]["beyond"], 0.05) << name;
    EXPECT_LT(trial["error"]["in_plane_mm"], 1) << name;
  }
}

// One view of an arch leaves some millimetres of depth open: the C-arm goes to the view that the catheter asks for all
// the same, and the catheter, in a vessel five times as wide as its tip is deflected, is where it is said to be.
TEST(AorticArch, ACatheterIsSteeredWhereOneViewLeavesDepthOpen) {
  NEED_SHARED_DATA("steve-dualdevicenav");
  if (test::kSanitized) GTEST_SKIP() << "too slow under a sanitizer";
  const test::TemporaryFolder folder;
  const std::string settings = folder.write("short.yaml", "study: {max_s: 24}\n");
  const auto ended =
      test::run("angio-simulate-loop", {"navigate", "--targets", "1", "--tree", test::sharedData("steve-dualdevicenav"),
                                        "--target-names", "LCCA", "--root=-298,59.4,-64.9", "--max-edge-mm", "25",
                                        "--calibration", test::exampleData("../08_tasks/arch_carm.yaml"), "--settings",
                                        settings, "--out", folder.path("journey.json")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const auto journey = nlohmann::json::parse(test::contentOf(folder.path("journey.json")))["trees"][0];
  EXPECT_GT(journey["frames_with_catheter"], 60) << journey["each"][0]["ended"];
  EXPECT_GT(journey["within_1.5_of_all"], 0.7);
  EXPECT_EQ(journey["limits_exceeded"], 0);
}

}  // namespace
}  // namespace angio::test
