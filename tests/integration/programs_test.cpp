// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "angio/io/pose_files.hpp"
#include "angio/perception/image_reading.hpp"
#include "angio/test/namespace.hpp"
#include "case_folder.hpp"
#include "hepatic.hpp"

namespace angio::test {
namespace {

using Json = nlohmann::json;

Pose poseOf(const Json& result) {
  Pose T = Pose::Identity();
  for (int i = 0; i < 9; ++i) T.linear()(i / 3, i % 3) = result["rotation"][i];
  for (int i = 0; i < 3; ++i) T.translation()[i] = 1e-3 * result["translation_mm"][i].get<double>();
  return T;
}

class Programs : public test::CaseFolder {
 protected:
  // What the view tells, it must find. Depth it tells least, and there the paper's prior keeps some of the start's 2
  // mm.
  void expectTruth(const Json& result) {
    EXPECT_EQ(result["status"], "converged");
    const Pose T = poseOf(result);
    const Eigen::Matrix3Xd off = T * tree_.points() - truth_ * tree_.points();
    EXPECT_LT(off.topRows<2>().colwise().norm().mean(), 2e-4);
    EXPECT_LT(off.row(2).cwiseAbs().mean(), 2.1e-3);
    EXPECT_LT(radToDeg(rotationAngle(T.linear() * truth_.linear().transpose())), 0.2);
  }
};

TEST_F(Programs, RegisterFindsThePoseAndDrawsIt) {
  const auto ended = test::run("angio-register", registerArguments());
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(ended.err, "");
  const Json result = Json::parse(test::contentOf(folder_.path("result.json")));
  expectTruth(result);
  EXPECT_EQ(result["method"], "oriented_kernel");
  EXPECT_TRUE(result["settings"].contains("oriented_kernel") && result["settings"].contains("starts"));
  EXPECT_TRUE(result.contains("machine"));
  const cv::Mat overlay = cv::imread(folder_.path("overlay.png"), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(overlay.cols, camera_.width_px());
  EXPECT_GT(overlay.rows, camera_.height_px()) << "legend and caption stand below the image";
  EXPECT_EQ(overlay.type(), CV_8UC3);
}

// Each point of the tree has a covariance, and what it is good for is said.
TEST_F(Programs, RegisterSaysHowWellEachPointIsKnown) {
  auto arguments = registerArguments();
  arguments.push_back("--point-covariance");
  const auto ended = test::run("angio-register", arguments);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json result = Json::parse(test::contentOf(folder_.path("result.json")));
  EXPECT_EQ(result["usable_for"], Json({"centre", "view", "navigate"}));
  const Json& covariances = result["point_covariance_mm2"];
  ASSERT_EQ(covariances.size(), static_cast<std::size_t>(tree_.size()));
  for (const Json& row : covariances) {
    ASSERT_EQ(row.size(), 6u);
    // Depth is known worse than what lies across the beam.
    EXPECT_GT(row[5].get<double>(), row[0].get<double>());
    EXPECT_GT(row[0].get<double>(), 0);
  }
  // A rigid fit's errors are normal.
  EXPECT_EQ(result["point_central_covariance_mm2"], covariances);
  const Json& half_mm = result["interval_90_mm"];
  double depth_mm2 = 0;
  for (const Json& row : covariances) depth_mm2 += row[5].get<double>() / tree_.size();
  // Along each ray, for the optical axis, and at a part of the points.
  EXPECT_NEAR(half_mm["depth"], 1.645 * std::sqrt(depth_mm2), 0.05 * half_mm["depth"].get<double>());
  EXPECT_LT(half_mm["across_beam"], half_mm["depth"]);
}

// A proof, none for want of time, and the box that is the search's.
TEST_F(Programs, RegisterCertifiesThatThereIsNoOtherPose) {
  auto arguments = registerArguments();
  arguments.insert(arguments.end(), {"--certify", "--certify-threads", "2", "--box-rotation-deg", "10",
                                     "--box-translation-mm", "15", "--certify-seconds", "60"});
  const auto ended = test::run("angio-register", arguments);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_NE(ended.out.find("\nproven: no pose within +-10 deg / +-15 mm and more than 5 mm away has 90 % of the score"),
            std::string::npos)
      << ended.out;
  Json certificate = Json::parse(test::contentOf(folder_.path("result.json")))["certificate"];
  EXPECT_EQ(certificate["proved"], true);
  EXPECT_LT(certificate["upper_bound"], 0.9);
  EXPECT_EQ(certificate["rival"], nullptr);
  EXPECT_EQ(certificate["box_rotation_deg"], 10);
  EXPECT_GT(certificate["cells"], 0);

  arguments.back() = "0";
  const auto stopped = test::run("angio-register", arguments);
  ASSERT_EQ(stopped.exit_code, 0) << stopped.err;
  EXPECT_NE(stopped.out.find("\nnot proven: bound "), std::string::npos) << stopped.out;
  certificate = Json::parse(test::contentOf(folder_.path("result.json")))["certificate"];
  EXPECT_EQ(certificate["proved"], false);
  EXPECT_GE(certificate["upper_bound"], 0.9);
}

// What registration finds in one image is what a C-arm can be sent to.
TEST_F(Programs, ARegisteredPoseIsAViewToServoTo) {
  auto arguments = registerArguments();
  const std::string pose = folder_.path("pose.yaml");
  arguments.insert(arguments.end(), {"--out-pose", pose});
  ASSERT_EQ(test::run("angio-register", arguments).exit_code, 0);
  EXPECT_LT((readPose(pose).T_camera_model.matrix() -
             poseOf(Json::parse(test::contentOf(folder_.path("result.json")))).matrix())
                .norm(),
            1e-9);
  // It names its tree, and is refused for another one. A pose that names none is taken for any.
  EXPECT_EQ(readPose(pose).model_id, modelId(tree_));
  const std::vector<std::string> servoing{"--simulate", "--view-pose",      pose, "--duration-s", "0.1",
                                          "--out",      folder_.path("out")};
  const auto other_tree = test::run("angio-servo", servoing);
  EXPECT_EQ(other_tree.exit_code, 1);
  EXPECT_NE(other_tree.err.find("pose.yaml: model_id = "), std::string::npos) << other_tree.err;
  EXPECT_NE(other_tree.err.find(": must be that of the vessel tree, "), std::string::npos) << other_tree.err;
  writePose(pose, {readPose(pose).T_camera_model, {}});
  const auto ended = test::run("angio-servo", servoing);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json summary = Json::parse(test::contentOf(folder_.path("out/summary.json")));
  EXPECT_EQ(summary["settings"]["view"]["goal"], "pose");
  const std::string settings = folder_.write("settings.yaml", "view: {goal: pose}\n");
  const auto refused = test::run("angio-servo", {"--simulate", "--settings", settings, "--out", folder_.path("out")});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.err.find("settings.yaml: view.goal = pose: needs --view-pose"), std::string::npos) << refused.err;
}

TEST_F(Programs, RegisterSaysHowItWentInALineAndPrintsTheResultWhenAsked) {
  auto arguments = registerArguments();
  arguments.resize(8);
  const auto ended = test::run("angio-register", arguments);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(ended.err, "");
  EXPECT_EQ(ended.out.rfind("converged: image to tree 0.", 0), 0u) << ended.out;
  EXPECT_NE(ended.out.find(" in depth; usable for centre, view, navigate\n"), std::string::npos) << ended.out;
  EXPECT_EQ(std::count(ended.out.begin(), ended.out.end(), '\n'), 1) << ended.out;
  arguments.push_back("--json");
  const auto printed = test::run("angio-register", arguments);
  ASSERT_EQ(printed.exit_code, 0) << printed.err;
  expectTruth(Json::parse(printed.out));
  EXPECT_EQ(printed.err.rfind("converged: ", 0), 0u) << printed.err;
}

// The result is there, the pose is not, and the line says in which reading the image would match.
TEST_F(Programs, RegisterSaysWhatToTryWhereItDoesNotConverge) {
  writeCenterline(folder_.path("centerline.csv"),
                  readAs(ImageReading::kMirrored, readCenterline(folder_.path("centerline.csv")), camera_));
  auto arguments = registerArguments();
  arguments.insert(arguments.end(), {"--out-pose", folder_.path("pose.yaml")});
  const auto ended = test::run("angio-register", arguments);
  EXPECT_EQ(ended.exit_code, 3) << ended.err;
  EXPECT_EQ(Json::parse(test::contentOf(folder_.path("result.json")))["status"], "diverged");
  EXPECT_FALSE(std::filesystem::exists(folder_.path("pose.yaml")));
  EXPECT_EQ(ended.out.rfind("diverged: ", 0), 0u) << ended.out;
  for (const char* said : {"Not to be trusted. To try next: the image matches when mirrored left to right; "
                           "--search-rotation-deg 180 --search-translation-mm 60; a second view",
                           "pose.yaml is not written: the registration did not converge\n"}) {
    EXPECT_NE(ended.out.find(said), std::string::npos) << ended.out;
  }
}

TEST_F(Programs, RegisterWarnsOfAnOldCalibration) {
  auto arguments = registerArguments();
  const auto camera = std::find(arguments.begin(), arguments.end(), "--camera") + 1;
  *camera =
      folder_.write("old.yaml", test::contentOf(*camera) +
                                    "calibration:\n  camera: {date: 2020-02-29T00:00:00Z, parameters: [], values: [], "
                                    "covariance: [], condition: 1, residual_unit: px, residual_rms: 0.1}\n");
  const auto ended = test::run("angio-register", arguments);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_NE(ended.err.find("old.yaml: calibration.camera: is "), std::string::npos) << ended.err;
  expectTruth(Json::parse(test::contentOf(folder_.path("result.json"))));
  arguments.insert(arguments.end(), {"--max-calibration-age-days", "100000"});
  EXPECT_EQ(test::run("angio-register", arguments).err, "");
}

TEST_F(Programs, RegisterTakesSeveralViews) {
  const Eigen::Translation3d to_center(0, 0, 0.75);
  const Pose T_side_first = to_center * expSE3((Twist() << 0, 0, 0, 0, kPi / 2, 0).finished()) * to_center.inverse();
  const XrayCamera side = XrayCamera::centered(800, 700, 0.4e-3, 1.2);
  writeCamera(folder_.path("side.yaml"), side);
  writePose(folder_.path("view.yaml"), {T_side_first, {}});
  writeCenterline(folder_.path("side.csv"), projectedCenterline(tree_, side, T_side_first * truth_));
  auto arguments = registerArguments();
  arguments.insert(arguments.end(), {"--camera", folder_.path("side.yaml"), "--centerline", folder_.path("side.csv"),
                                     "--view-pose", folder_.path("view.yaml")});
  const auto ended = test::run("angio-register", arguments);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json result = Json::parse(test::contentOf(folder_.path("result.json")));
  expectTruth(result);
  const Eigen::Matrix3Xd off = poseOf(result) * tree_.points() - truth_ * tree_.points();
  EXPECT_LT(off.row(2).cwiseAbs().mean(), 1e-4) << "depth, as seen from the side";
  const cv::Mat overlay = cv::imread(folder_.path("overlay.png"), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(overlay.cols, camera_.width_px() + 800) << "both views, side by side";
  EXPECT_GT(overlay.rows, camera_.height_px());
}

TEST_F(Programs, RegisterSearchesABoxWhenAsked) {
  // Turned further than one start can come back from.
  const Twist off = (Twist() << 0.004, 0, 0, 0, 0, degToRad(25)).finished();
  writePose(folder_.path("start.yaml"), {test::perturbed(truth_, tree_, off), {}});
  auto arguments = registerArguments();
  arguments.insert(arguments.end(), {"--search-rotation-deg", "30", "--search-translation-mm", "5", "--starts", "64"});
  const auto ended = test::run("angio-register", arguments);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(ended.err, "") << "no bar where no terminal is";
  const Json result = Json::parse(test::contentOf(folder_.path("result.json")));
  EXPECT_EQ(result["settings"]["starts"]["box_rotation_deg"], 30);
  EXPECT_EQ(result["settings"]["starts"]["box_translation_mm"], 5);
  EXPECT_LT(radToDeg(rotationAngle(poseOf(result).linear() * truth_.linear().transpose())), 5);
}

TEST_F(Programs, RegisterDeformsWhenAsked) {
  auto arguments = registerArguments();
  arguments.push_back("--nonrigid");
  ASSERT_EQ(test::run("angio-register", arguments).exit_code, 0);
  const Json result = Json::parse(test::contentOf(folder_.path("result.json")));
  ASSERT_EQ(result["displacements_mm"].size(), static_cast<std::size_t>(tree_.size())) << "one row a point";
  EXPECT_EQ(result["displacements_mm"][0].size(), 3u);
}

TEST_F(Programs, EvaluateWritesWhatOutsideToolsRead) {
  const auto ended = test::run("angio-evaluate", {"cases", folder_.path("cases.yaml"), "--method", "iterative_pnp",
                                                  "--out", folder_.path("results.json")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_NE(ended.out.find("iterative_pnp | 2 of 2"), std::string::npos) << ended.out;
  const Json results = Json::parse(test::contentOf(folder_.path("results.json")));
  const Json& method = results["methods"]["iterative_pnp"];
  ASSERT_EQ(method["cases"].size(), 2u);
  expectTruth(method["cases"]["0001"]);
  for (const char* key : {"status", "rotation", "translation_mm", "covariance", "ambiguity",
                          "mean_projection_residual_px", "points_3d", "points_2d", "time_ms"}) {
    EXPECT_TRUE(method["cases"]["0002"].contains(key)) << key;
  }
  EXPECT_EQ(method["cases"]["0002"]["covariance"].size(), 36u);
  for (const char* key : {"image", "prepare", "rigid", "nonrigid", "total"}) {
    EXPECT_TRUE(method["cases"]["0002"]["time_ms"][key].is_number()) << key;
  }
  EXPECT_EQ(method["summary"]["cases"], 2);
  EXPECT_EQ(method["summary"]["cases_with_truth"], 1);
  EXPECT_TRUE(results["settings"].contains("iterative_pnp"));
  EXPECT_TRUE(results["machine"].contains("cores"));
}

TEST_F(Programs, EvaluateNamesTheMethodsThereAre) {
  const auto ended = test::run("angio-evaluate", {"cases", folder_.path("cases.yaml"), "--method", "magic"});
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_NE(ended.err.find("magic"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("iterative_pnp"), std::string::npos) << ended.err;
}

class ServoProgram : public testing::Test {
 protected:
  std::vector<std::string> arguments(const std::string& duration_s) const {
    return {"--simulate",
            "--tree",
            test::exampleData("hepatic-tace/tree.csv"),
            "--calibration",
            test::exampleData("hepatic-tace/carm.yaml"),
            "--duration-s",
            duration_s,
            "--out",
            folder_.path("out")};
  }
  Json summary() const { return Json::parse(test::contentOf(folder_.path("out/summary.json"))); }

  test::TemporaryFolder folder_;
};

TEST_F(ServoProgram, AClosedLoopLeavesFiveFiles) {
  const auto ended = test::run("angio-servo", arguments(test::kSanitized ? "0.2" : "1"));
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(ended.err, "");
  EXPECT_NE(ended.out.find("closed loop"), std::string::npos) << ended.out;
  for (const char* file : {"overlay_first.png", "overlay_last.png", "plot.png", "trace.csv", "summary.json"}) {
    EXPECT_TRUE(std::filesystem::is_regular_file(folder_.path("out/") + file)) << file;
  }
  for (const char* picture : {"overlay_first.png", "overlay_last.png", "plot.png"}) {
    EXPECT_FALSE(cv::imread(folder_.path("out/") + picture).empty()) << picture;
  }
  const std::string trace = test::contentOf(folder_.path("out/trace.csv"));
  EXPECT_EQ(std::count(trace.begin(), trace.end(), '\n'), test::kSanitized ? 4 : 16) << "a header, and a row a frame";
  const std::string head = trace.substr(0, trace.find('\n')),
                    last = trace.substr(trace.rfind('\n', trace.size() - 2) + 1);
  EXPECT_EQ(std::count(head.begin(), head.end(), ','), std::count(last.begin(), last.end(), ','));
  const Json s = summary();
  EXPECT_EQ(s["frames"], test::kSanitized ? 3 : 15);
  EXPECT_EQ(s["seed"], 1);
  EXPECT_TRUE(s["final_error"]["closed_loop"]["view_deg"].is_number());
  EXPECT_TRUE(s["way"]["table_excursion_mm"].is_number());
  EXPECT_TRUE(s["way"]["target_excursion_mm"].is_number());
  EXPECT_TRUE(s.contains("settled_s"));
  EXPECT_NE(head.find(",table_excursion_mm,target_excursion_mm"), std::string::npos);
  EXPECT_TRUE(s["latency_ms"]["frame_to_command"]["p99"].is_number());
}

// No vessel is to be seen: nothing moves, and the exit code and a line say so.
TEST_F(ServoProgram, ALoopThatNeverMovedSaysWhy) {
  auto words = arguments("1");
  const std::string settings = folder_.write("no_vessels.yaml", "fluoroscopy: {contrast_attenuation_per_mm: 0}\n");
  words.insert(words.end(), {"--settings", settings});
  const auto ended = test::run("angio-servo", words);
  EXPECT_EQ(ended.exit_code, 3) << ended.err;
  EXPECT_EQ(ended.err.rfind("angio-servo: the loop never moved: all of 15 frames were held; ", 0), 0u) << ended.err;
  EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
  EXPECT_TRUE(std::filesystem::is_regular_file(folder_.path("out/summary.json")));
}

// A C-arm that is known, and a tree of which nobody has said where it lies.
TEST_F(ServoProgram, ATreeWithoutACalibrationIsCentered) {
  auto words = arguments("0.2");
  const std::string carm = folder_.write("carm.yaml",
                                         "source_isocentre_distance_mm: 810\nsource_detector_distance_mm: 1113\n"
                                         "pixel_spacing_mm: 0.5\nimage_size_px: [512, 512]\n");
  words[4] = carm;
  const auto refused = test::run("angio-servo", words);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.err.find(carm + ": T_dsa_cb: is missing: "), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("--t-dsa-cb centre"), std::string::npos) << refused.err;
  words.insert(words.end(), {"--t-dsa-cb", "centre"});
  const auto ended = test::run("angio-servo", words);
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(ended.err.rfind("angio-servo: assumed: the tree's x, y, z are taken as the patient's L, P, S", 0), 0u)
      << ended.err;
  EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
  words.erase(words.begin());  // A real machine has a calibration.
  EXPECT_EQ(test::run("angio-servo", words).exit_code, 2);

  const auto simulated = test::run(
      "angio-simulate", {"--calibration", carm, "--t-dsa-cb", "centre", "--frames", "1", "--out", folder_.path("run")});
  EXPECT_EQ(simulated.exit_code, 0) << simulated.err;
  EXPECT_EQ(simulated.err.rfind("angio-simulate: assumed: ", 0), 0u) << simulated.err;
}

TEST_F(ServoProgram, VesselsThatAreTooWideToBeSeenAreNamed) {
  auto words = arguments("0.1");
  words[2] = folder_.write("aorta.csv",
                           "id,x_mm,y_mm,z_mm,radius_mm,parent\n0,0,0,-40,12,-1\n1,0,5,0,12,0\n2,20,0,40,3,1\n"
                           "3,-20,0,40,3,1\n");
  words.insert(words.end(), {"--t-dsa-cb", "centre"});
  const auto ended = test::run("angio-servo", words);
  EXPECT_NE(ended.err.find("1 of 3 branches of the tree have a larger radius in the image than ridge.max_radius_px"),
            std::string::npos)
      << ended.err;
  words.insert(words.end(), {"--settings", folder_.write("wide.yaml", "ridge: {max_radius_px: 100}\n")});
  EXPECT_EQ(test::run("angio-servo", words).err.find("ridge.max_radius_px"), std::string::npos);
}

TEST_F(ServoProgram, TheCommandLineComesBeforeTheSettingsFile) {
  const std::string settings =
      folder_.write("settings.yaml", "view: {primary_deg: 12, secondary_deg: 7}\nscenario: {seed: 4}\n");
  auto words = arguments("0.1");
  words.insert(words.end(), {"--settings", settings, "--view-secondary-deg", "-8"});
  ASSERT_EQ(test::run("angio-servo", words).exit_code, 0);
  const Json s = summary();
  EXPECT_EQ(s["settings"]["view"]["primary_deg"], 12);
  EXPECT_EQ(s["settings"]["view"]["secondary_deg"], -8);
  EXPECT_EQ(s["settings"]["scenario"]["seed"], 4);
  EXPECT_EQ(s["settings"]["scenario"]["duration_s"], 0.1);
}

TEST_F(ServoProgram, TheExamplesSettingsAreRead) {
  auto words = arguments("0.1");
  words.insert(words.end(), {"--settings", test::exampleData("../06_own_robot/first_motion.yaml")});
  const auto ended = test::run("angio-servo", words);
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json s = summary();
  EXPECT_EQ(s["settings"]["limits"]["angle_speeds_deg_per_s"], Json({2.5, 2.5}));
  EXPECT_EQ(s["settings"]["limits"]["envelope"], "typical");
  words.back() = folder_.write("lab.yaml", "limits:\n  primary_deg: [100, -100]\n");
  const auto refused = test::run("angio-servo", words);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(refused.err, "angio-servo: " + words.back() +
                             ": limits: primary_deg = 100, -100: must go up from the least to the most\n");
}

TEST_F(ServoProgram, ATrajectoryIsShownBeforeItIsMade) {
  const std::string folder = folder_.path("preview");
  const auto ended = test::run("angio-servo", {"--simulate", "--preview", folder, "--view-primary-deg", "35"});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_NE(ended.out.find("nothing was moved"), std::string::npos) << ended.out;
  EXPECT_FALSE(cv::imread(folder + "/preview.png").empty());
  const Json way = Json::parse(test::contentOf(folder + "/preview.json"));
  EXPECT_TRUE(way["arrives"].get<bool>());
  EXPECT_NEAR(way["joints"][0]["goal"].get<double>(), 35, 10) << "less how the patient lies";
  EXPECT_LE(way["table_excursion_mm"].get<double>(), 0.1);
  const auto wild = test::run("angio-servo", {"--simulate", "--preview", folder, "--view-primary-deg", "100",
                                              "--settings", folder_.write("law.yaml", "law: position_based\n")});
  EXPECT_EQ(wild.exit_code, 1);
  EXPECT_NE(wild.err.find("would not arrive: "), std::string::npos) << wild.err;
}

using ExperimentPrograms = ServoProgram;

TEST_F(ExperimentPrograms, TheBestViewIsTheBestOfItsMap) {
  const auto ended = test::run(
      "angio-best-view", {"--branch", "13", "--picture", folder_.path("map.png"), "--out", folder_.path("map.json")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_FALSE(cv::imread(folder_.path("map.png")).empty());
  const Json best = Json::parse(test::contentOf(folder_.path("map.json")));
  const double cost = best["foreshortening"].get<double>() + best["overlap"].get<double>();
  double least = 2;
  int reachable = 0;
  const auto& f = best["map"]["foreshortening"];
  for (std::size_t i = 0; i < f.size(); ++i) {
    for (std::size_t j = 0; j < f[i].size(); ++j) {
      if (f[i][j].is_null()) continue;
      ++reachable;
      least = std::min(least, f[i][j].get<double>() + best["map"]["overlap"][i][j].get<double>());
    }
  }
  EXPECT_GT(reachable, 1000);
  EXPECT_LE(cost, least + 1e-9) << "it is refined from the map's best";
  const auto refused = test::run("angio-best-view", {"--branch", "999"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(refused.err, "angio-best-view: best view: branch = 999: must be below 103\n");
}

TEST_F(ExperimentPrograms, AJourneyIsFilmed) {
  const std::string settings = folder_.write("short.yaml", "study: {max_s: 1}\n");
  const auto ended = test::run("angio-simulate-loop", {"navigate", "--targets", "1", "--settings", settings, "--film",
                                                       folder_.path("journey.mp4")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_GT(std::filesystem::file_size(folder_.path("journey.mp4")), 1000u);
}

}  // namespace
}  // namespace angio::test
