// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <utility>

#include "angio/io/image_files.hpp"
#include "angio/test/namespace.hpp"
#include "case_folder.hpp"

namespace angio::test {
namespace {

// What a file may hold instead of what was asked for.
struct Hostile {
  std::string what, content;
};

std::string rubbish() {
  test::Random random(3);
  std::string bytes(2000, ' ');
  for (auto& byte : bytes) byte = static_cast<char>(static_cast<unsigned char>(random.uniform(0, 256)));
  return bytes;
}

class HostileInput : public test::CaseFolder {
 protected:
  // Everything a user can name wrongly, and the given contents.
  void expectRefusals(const std::string& file, const std::vector<Hostile>& contents,
                      const std::function<test::Ended()>& run_program) {
    const std::string path = folder_.path(file), kept = test::contentOf(path);
    const auto check = [&](const std::string& what) {
      const auto ended = run_program();
      EXPECT_EQ(ended.exit_code, 1) << file << ", " << what;
      EXPECT_EQ(ended.out, "") << file << ", " << what;
      EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << file << ", " << what << ": " << ended.err;
      EXPECT_NE(ended.err.find(file), std::string::npos) << what << ": " << ended.err;
      for (const char* result : {"result.json", "overlay.png", "results"}) {
        EXPECT_FALSE(std::filesystem::exists(folder_.path(result))) << file << ", " << what << " leaves " << result;
      }
    };
    std::filesystem::remove(path);
    check("missing");
    std::filesystem::create_directory(path);
    check("a directory");
    std::filesystem::remove(path);
    for (const auto& hostile : contents) {
      folder_.write(file, hostile.content);
      check(hostile.what);
      std::filesystem::remove(path);
    }
    folder_.write(file, kept);
  }
  std::function<test::Ended()> registering(const std::vector<std::string>& more = {}) {
    auto arguments = registerArguments();
    arguments.insert(arguments.end(), more.begin(), more.end());
    return [arguments] { return test::run("angio-register", arguments); };
  }

  const Hostile kEmpty{"empty", ""}, kRubbish{"binary rubbish", rubbish()};
};

const std::string kTreeHead = "id,x_mm,y_mm,z_mm,radius_mm,parent\n0,0,0,0,1,-1\n";

TEST_F(HostileInput, TreesAreRefused) {
  expectRefusals("tree.csv",
                 {kEmpty,
                  kRubbish,
                  {"NaN", kTreeHead + "1,nan,0,1,1,0\n"},
                  {"a loop", kTreeHead + "1,1,0,0,1,2\n2,2,0,0,1,1\n"},
                  {"one point", kTreeHead},
                  {"a parent that is not there", kTreeHead + "1,1,0,0,1,9\n"}},
                 registering());
}

TEST_F(HostileInput, CamerasAreRefused) {
  const std::string rest = "image_size_px: [64, 64]\nfy_px: 1000\ncx_px: 32\ncy_px: 32\n";
  expectRefusals("camera.yaml",
                 {kEmpty,
                  kRubbish,
                  {"no focal length", rest},
                  {"a focal length of zero", rest + "fx_px: 0\n"},
                  {"a focal length that is no number", rest + "fx_px: .nan\n"}},
                 registering());
}

TEST_F(HostileInput, PosesAreRefused) {
  expectRefusals("start.yaml",
                 {kEmpty,
                  kRubbish,
                  {"no rotation", "rotation: [1, 0, 0, 0, 1, 0, 0, 0, 2]\ntranslation_mm: [0, 0, 800]\n"},
                  {"a mirror", "rotation: [1, 0, 0, 0, 1, 0, 0, 0, -1]\ntranslation_mm: [0, 0, 800]\n"},
                  {"NaN", "rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1]\ntranslation_mm: [.nan, 0, 800]\n"}},
                 registering());
}

TEST_F(HostileInput, PosesOfViewsAreRefused) {
  expectRefusals(
      "view.yaml",
      {kEmpty, kRubbish, {"a mirror", "rotation: [1, 0, 0, 0, 1, 0, 0, 0, -1]\ntranslation_mm: [0, 0, 0]\n"}},
      registering({"--camera", folder_.path("camera.yaml"), "--centerline", folder_.path("centerline.csv"),
                   "--view-pose", folder_.path("view.yaml")}));
}

TEST_F(HostileInput, CentrelinesAndImagesAreRefused) {
  expectRefusals(
      "centerline.csv",
      {kEmpty, kRubbish, {"NaN", "x_px,y_px\n1,nan\n"}, {"no points", "x_px,y_px\n"}, {"another header", "x,y\n1,1\n"}},
      registering());
  expectRefusals("frame.png", {kEmpty, kRubbish, {"a cut file", "\x89PNG\r\n\x1a\n"}},
                 registering({"--image", folder_.path("frame.png")}));
  std::filesystem::remove(folder_.path("frame.png"));
  writeImage(folder_.path("small.png"), cv::Mat(8, 8, CV_8UC1, cv::Scalar(1)));
  const auto ended = registering({"--image", folder_.path("small.png")})();
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_NE(ended.err.find("small.png: size = 8 x 8"), std::string::npos) << ended.err;
}

TEST_F(HostileInput, SettingsAreRefused) {
  const std::vector<Hostile> contents = {
      kRubbish, {"an unknown key", "starts: {cuont: 3}\n"}, {"an unknown section", "no_such_part: {}\n"}};
  expectRefusals("settings.yaml", contents, registering({"--settings", folder_.path("settings.yaml")}));
  for (const char* program : {"angio-servo", "angio-simulate", "angio-navigate"}) {
    std::vector<std::string> arguments = {"--settings", folder_.path("settings.yaml"), "--duration-s", "0.1"};
    if (std::string(program) == "angio-servo")
      arguments.insert(arguments.end(), {"--simulate", "--out", folder_.path("results")});
    if (std::string(program) == "angio-navigate") arguments.insert(arguments.end(), {"--to-branch", "13"});
    expectRefusals("settings.yaml", contents, [=] { return test::run(program, arguments); });
  }
}

TEST_F(HostileInput, CaseSetsAreRefused) {
  const auto evaluating = [&] {
    return test::run("angio-evaluate", {"cases", folder_.path("cases.yaml"), "--out", folder_.path("result.json")});
  };
  expectRefusals("cases.yaml", {kEmpty, kRubbish, {"no case", "tree: tree.csv\ncamera: camera.yaml\ncases: []\n"}},
                 evaluating);
  expectRefusals("tree.csv", {kEmpty, kRubbish, {"NaN", kTreeHead + "1,nan,0,1,1,0\n"}}, evaluating);
  expectRefusals("camera.yaml", {kRubbish}, evaluating);
  expectRefusals("truth.yaml", {kRubbish}, evaluating);
  expectRefusals("centerline.csv", {kRubbish}, evaluating);
}

TEST_F(HostileInput, CalibrationsAndTreesOfTheLoopAreRefused) {
  folder_.write("carm.yaml", test::contentOf(test::exampleData("hepatic-tace/carm.yaml")));
  std::vector<std::string> arguments = {
      "--tree", folder_.path("tree.csv"), "--calibration", folder_.path("carm.yaml"), "--duration-s", "0.1"};
  const auto simulating = [=] { return test::run("angio-simulate", arguments); };
  arguments.insert(arguments.end(), {"--simulate", "--out", folder_.path("results")});
  const auto servoing = [=] { return test::run("angio-servo", arguments); };
  for (const std::function<test::Ended()>& program :
       {std::function<test::Ended()>(simulating), std::function<test::Ended()>(servoing)}) {
    expectRefusals("carm.yaml", {kEmpty, kRubbish, {"distances only", "source_isocentre_distance_mm: 810\n"}}, program);
    expectRefusals("tree.csv", {kRubbish, {"NaN", kTreeHead + "1,nan,0,1,1,0\n"}}, program);
  }
}

TEST_F(HostileInput, ResultsThatCannotBeWrittenAreFailures) {
  const auto one_line = [](const test::Ended& ended, const std::string& words) {
    EXPECT_EQ(ended.exit_code, 1);
    EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
    EXPECT_NE(ended.err.find(words), std::string::npos) << ended.err;
  };
  auto arguments = registerArguments();
  arguments[9] = folder_.path("no-such-folder/result.json");
  one_line(test::run("angio-register", arguments), "no-such-folder/result.json");
  arguments = registerArguments();
  arguments[11] = folder_.path("no-such-folder/overlay.png");
  one_line(test::run("angio-register", arguments), "no-such-folder/overlay.png");
  arguments = registerArguments();
  arguments[11] = folder_.path("overlay.bmp");
  one_line(test::run("angio-register", arguments), "must be .png, .tif, .tiff, .jpg or .jpeg");
  EXPECT_FALSE(std::filesystem::exists(folder_.path("result.json")));
  // Before the work, which would take hours.
  one_line(test::run("angio-evaluate", {"extraction", "--trials", "100000", "--tree",
                                        test::exampleData("hepatic-tace/tree.csv"), "--sheet", "sheet.bmp"}),
           "sheet.bmp: extension = .bmp");
  arguments.resize(8);  // To stdout, which is full.
  one_line(test::RunningProgram("angio-register", arguments, "/dev/full").end(), "stdout");
}

TEST(HostilePlaces, OfACatheterAreRefused) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> lines = {
      {{"angio-navigate", "--to-branch", "103"},
       "--to-branch: '103': must be one of the tree's 103 branches, from 0 on"},
      {{"angio-navigate", "--to-branch", "13", "--from-mm", "200"},
       "--from-mm: of branch 0 = 200: must lie between 0 and 144.983434"},
      {{"angio-simulate", "--catheter-branch", "0", "--catheter-mm", "200"},
       "--catheter-mm: of branch 0 = 200: must lie between 0 and 144.983434"}};
  for (const auto& [words, refusal] : lines) {
    std::vector<std::string> arguments(words.begin() + 1, words.end());
    arguments.insert(arguments.end(), {"--bus", "memq://", "--duration-s", "0.1"});
    const auto ended = test::run(words.front(), arguments);
    EXPECT_EQ(ended.exit_code, 1);
    EXPECT_EQ(ended.err, words.front() + ": " + refusal + "\n");
    EXPECT_EQ(ended.out, "");
  }
}

TEST(HostileBus, UrlsAreRefused) {
  for (const char* url : {"", "carrier-pigeon://", "udpm://nowhere", "file:///no/such/log.lcm", "memq://"}) {
    for (const char* program : {"angio-servo", "angio-simulate"}) {
      const auto ended =
          test::run(program, {"--bus", url, "--duration-s", "0.1", "--tree", test::exampleData("hepatic-tace/tree.csv"),
                              "--calibration", test::exampleData("hepatic-tace/carm.yaml")});
      EXPECT_EQ(ended.exit_code, 1) << program << " " << url;
      EXPECT_EQ(ended.err.rfind(std::string(program) + ": bus: url", 0), 0U) << ended.err;
      EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
      EXPECT_EQ(ended.out, "");
    }
  }
}

}  // namespace
}  // namespace angio::test
