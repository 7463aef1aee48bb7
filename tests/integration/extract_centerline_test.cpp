// SPDX-License-Identifier: GPL-2.0-or-later
// angio-extract-centerline: what it writes is what the extractor finds and what angio-register reads.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "angio/imaging/extractor.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/program.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

const std::string kPhantom = test::exampleData("static-phantom/");
const std::string kPhantomRun = kPhantom + "dicom/im5.dcm";

Centerline2d extracted(const ExtractorSettings& settings) {
  return ofKind(makeExtractor(settings)->extract(readXrayImage(kPhantomRun, 2)), CurveKind::kVessel);
}

TEST(ExtractCenterline, FileHoldsEveryNumberOfWhatTheExtractorFinds) {
  const test::TemporaryFolder folder;
  for (const std::string extractor : {"ridge", "otsu"}) {
    const auto ended =
        test::run("angio-extract-centerline", {kPhantomRun, "--frame", "2", "--extractor", extractor, "--out",
                                               folder.path("line.csv"), "--overlay", folder.path("seen.png")});
    ASSERT_EQ(ended.exit_code, 0) << ended.err;
    EXPECT_EQ(ended.err, "");
    const Centerline2d seen = extractor == "ridge" ? extracted(RidgeSettings{}) : extracted(OtsuSettings{});
    const Centerline2d read = readCenterline(folder.path("line.csv"));
    EXPECT_EQ(read.points_px, seen.points_px);
    EXPECT_EQ(read.branch, seen.branch);
    EXPECT_EQ(read.tangent_rad, seen.tangent_rad);
    EXPECT_EQ(read.radius_px, seen.radius_px);
    EXPECT_EQ(read.std_px, seen.std_px);
    EXPECT_GT(read.size(), 200);
    EXPECT_THAT(ended.out, HasSubstr(std::to_string(read.size()) + " points"));
  }
}

// The same pose by the image and by the file, but for what the image says beside its lines: the collimator's opening.
TEST(ExtractCenterline, RegisterReadsTheFile) {
  const test::TemporaryFolder folder;
  const std::string line = folder.path("line.csv"), image = kPhantom + "frames/im5.png";
  ASSERT_EQ(test::run("angio-extract-centreline", {image, "--out", line}).exit_code, 0);
  const auto positionBy = [&](const char* option, const std::string& file) {
    const std::string out = folder.path("result.json");
    const auto ended =
        test::run("angio-register", {"--tree", kPhantom + "tree.csv", "--camera", kPhantom + "im5_camera.yaml",
                                     "--initial-pose", kPhantom + "im5_nominal.yaml", option, file, "--out", out});
    EXPECT_EQ(ended.exit_code, 0) << ended.err << ended.out;
    const auto t_mm = nlohmann::json::parse(test::contentOf(out)).at("translation_mm").get<std::vector<double>>();
    return Eigen::Vector3d(t_mm[0], t_mm[1], t_mm[2]);
  };
  const Eigen::Vector3d apart_mm = positionBy("--image", image) - positionBy("--centerline", line);
  EXPECT_LT(apart_mm.head<2>().norm(), 0.5);
  EXPECT_LT(std::abs(apart_mm.z()), 5);  // Depth is what one view leaves open.
}

TEST(ExtractCenterline, AllFramesHaveAFileEach) {
  const test::TemporaryFolder folder;
  const auto ended =
      test::run("angio-extract-centerline", {kPhantomRun, "--all-frames", "--out", folder.path("line%03d.csv")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  for (const char* name : {"line000.csv", "line001.csv", "line002.csv"}) {
    EXPECT_GT(readCenterline(folder.path(name)).size(), 100) << name;
  }
  EXPECT_THAT(ended.out, HasSubstr("3 frames: vessels in 3"));
}

TEST(ExtractCenterline, WrongInputIsOneLineAndLeavesNoFile) {
  const test::TemporaryFolder folder, written;
  const std::string out = written.path("line.csv");
  writeImage(folder.path("empty.jpg"), cv::Mat(200, 200, CV_8U, cv::Scalar(120)));
  const std::vector<std::pair<std::vector<std::string>, std::string>> lines = {
      {{folder.path("none.png"), "--out", out}, "none.png"},
      {{folder.path("empty.jpg"), "--out", out}, "shows no vessel"},
      {{folder.path("empty.jpg"), "--frame", "1", "--out", out}, "frame = 1"},
      {{kPhantomRun, "--out", written.path("no/line.csv")}, "no/line.csv"},
      {{kPhantomRun, "--out", out, "--overlay", written.path("a.gif")}, "must be .png"},
      {{kPhantomRun, "--all-frames", "--out", out}, "%04d"},
      {{kPhantomRun, "--out", out, "--extractor", "canny"}, "canny"}};
  for (const auto& [arguments, words] : lines) {
    const auto ended = test::run("angio-extract-centerline", arguments);
    EXPECT_EQ(ended.exit_code, 1) << words;
    EXPECT_EQ(ended.out, "");
    EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
    EXPECT_THAT(ended.err, HasSubstr(words));
  }
  EXPECT_EQ(written.files(), 0U);
  EXPECT_EQ(
      test::run("angio-extract-centerline", {kPhantomRun, "--out", out, "--all-frames", "--frame", "1"}).exit_code, 2);
}

}  // namespace
}  // namespace angio::test
