// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <regex>

#include "angio/evaluation/branch_picture.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/results/overlay.hpp"
#include "angio/results/text_band.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/not_a_number.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The middle of an antialiased line keeps nine tenths of its colour.
bool isOf(const cv::Vec3b& pixel, const cv::Scalar& color) {
  return cv::norm(cv::Vec3d(pixel) - cv::Vec3d(color[0], color[1], color[2])) < 30;
}

// 100 pixels a millimetre in the plane z = 1 m: two points on the image's column 300.
class Overlays : public testing::Test {
 protected:
  VesselTree upright_{(Eigen::Matrix3Xd(3, 2) << 0.001, 0.001, -0.001, 0.001, 1, 1).finished(), {-1, 0}};
  XrayCamera camera_{{400, 420, 1e5, 1e5, 200, 210, {}, {}}};

  OverlayTree shownAt(const Eigen::Vector3d& shift) const {
    return {Pose(Eigen::Translation3d(shift)), {}, kConvergedColor, "tree"};
  }
  cv::Mat draw(const OverlayTree& what, const cv::Mat& image = {}) const {
    OverlayScene scene;
    scene.image = image;
    scene.trees = {what};
    return drawOverlayImage(scene, upright_, camera_);
  }
};

TEST_F(Overlays, TheTreeIsDrawnInItsColorWhereItProjects) {
  const cv::Mat canvas = draw(shownAt({0, 0, 0}));
  ASSERT_EQ(canvas.type(), CV_8UC3);
  ASSERT_EQ(canvas.size(), cv::Size(400, 420));
  for (const int row : {120, 210, 300}) {
    EXPECT_TRUE(isOf(canvas.at<cv::Vec3b>(row, 300), kConvergedColor)) << row;
    EXPECT_FALSE(isOf(canvas.at<cv::Vec3b>(row, 295), kConvergedColor)) << row;
  }
  EXPECT_FALSE(isOf(canvas.at<cv::Vec3b>(340, 300), kConvergedColor)) << "beyond the tree's end";
}

TEST_F(Overlays, PoseAndDisplacementsMoveTheTree) {
  EXPECT_TRUE(isOf(draw(shownAt({-0.0005, 0, 0})).at<cv::Vec3b>(210, 250), kConvergedColor));
  OverlayTree displaced = shownAt({0, 0, 0});
  displaced.displacements_m = Eigen::Vector3d(0.0005, 0, 0).replicate(1, 2);
  EXPECT_TRUE(isOf(draw(displaced).at<cv::Vec3b>(210, 350), kConvergedColor));
}

TEST_F(Overlays, TheImageIsTheGround) {
  cv::Mat large(500, 500, CV_16UC1, cv::Scalar(1000));
  large(cv::Rect(50, 40, 200, 420)).setTo(60000);
  const cv::Mat canvas = draw(shownAt({0, 0, 0}), large(cv::Rect(50, 40, 400, 420)));  // A window: its rows are apart.
  ASSERT_EQ(canvas.size(), cv::Size(400, 420));
  EXPECT_EQ(canvas.at<cv::Vec3b>(380, 100), cv::Vec3b(255, 255, 255));
  EXPECT_EQ(canvas.at<cv::Vec3b>(380, 380), cv::Vec3b(0, 0, 0));
}

TEST_F(Overlays, PosesThatMeanNothingLeaveTheGround) {
  for (const Eigen::Vector3d& nowhere :
       {Eigen::Vector3d(0, 0, -2), Eigen::Vector3d(kNan, kNan, kNan), Eigen::Vector3d(1e6, 1e6, 0)}) {
    OverlayTree what = shownAt(nowhere);
    what.label.clear();
    const cv::Mat canvas = draw(what);
    EXPECT_EQ(
        cv::countNonZero(canvas.reshape(1) != draw({Pose::Identity(), {}, cv::Scalar(24, 20, 18), ""}).reshape(1)), 0)
        << nowhere.transpose();
  }
}

// Pixels that are not the same in two pictures of one size.
int differences(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a.reshape(1) != b.reshape(1)); }

int pixelsIn(const cv::Mat& picture, const cv::Scalar& color) {
  cv::Mat same;
  cv::inRange(picture, color, color, same);
  return cv::countNonZero(same);
}

TEST_F(Overlays, LegendAndCaptionStandBelowTheImage) {
  for (const int side : {512, 1024, 2048}) {
    const XrayCamera camera({side, side, 1e5, 1e5, 0.5 * side, 0.5 * side, {}, {}});
    OverlayScene scene;
    scene.image = cv::Mat(side, side, CV_16UC1, cv::Scalar(1000));
    scene.trees = {{Pose::Identity(), {}, kStartColor, "tree where the calibration puts it"},
                   {Pose::Identity(), {}, kRejectedColor, "tree as registered: ambiguous, not to be trusted"}};
    scene.caption = "converged: image to tree 12.34 px, 56 % of the tree in view explained, 1234.5 ms";
    scene.R_camera_lps = Eigen::Matrix3d::Identity();
    const cv::Mat image = drawOverlayImage(scene, upright_, camera), whole = drawOverlay(scene, upright_, camera);
    ASSERT_EQ(image.size(), cv::Size(side, side));
    ASSERT_EQ(whole.cols, side);
    ASSERT_GT(whole.rows, side);
    EXPECT_LT(whole.rows, 1.3 * side) << "a band, not a second picture";
    EXPECT_EQ(differences(whole.rowRange(0, side), image), 0);
    const cv::Mat band = whole.rowRange(side, whole.rows);
    EXPECT_GT(pixelsIn(band, kStartColor), 10);
    EXPECT_GT(pixelsIn(band, kRejectedColor), 10);
    const cv::Mat ground(band.rows, 4, CV_8UC3, band.at<cv::Vec3b>(0, 0));
    EXPECT_EQ(differences(band.colRange(0, 4).clone(), ground), 0);
    EXPECT_EQ(differences(band.colRange(side - 4, side).clone(), ground), 0) << "texts end before the edge";
  }
}

TEST_F(Overlays, NothingButTreesCenterlinesAndLettersIsDrawnOnTheImage) {
  OverlayScene scene;
  scene.image = cv::Mat(420, 400, CV_16UC1, cv::Scalar(1000));
  scene.trees = {{Pose(Eigen::Translation3d(0, 0, -2)), {}, kConvergedColor, "a tree behind the source"}};
  scene.caption = "a caption";
  const cv::Mat plain = drawOverlay(scene, upright_, camera_).rowRange(0, 420).clone();
  EXPECT_EQ(cv::countNonZero(plain.reshape(1)), 0);
  scene.R_camera_lps = Eigen::Matrix3d::Identity();
  const cv::Mat lettered = drawOverlay(scene, upright_, camera_).rowRange(0, 420).clone();
  cv::Mat letters = plain.clone();
  drawPatientLetters(letters, *scene.R_camera_lps);
  EXPECT_GT(differences(letters, plain), 100);
  EXPECT_EQ(differences(letters, lettered), 0);
}

TEST_F(Overlays, WithoutTextsThereIsNoBand) {
  EXPECT_EQ(drawOverlay({}, upright_, camera_).size(), cv::Size(400, 420));
}

TEST(TextBands, LinesFitTheirWidthAndLoseNoWord) {
  const std::string text = "registration ambiguous:   a different pose fits nearly as well, 0.93 of the score; " +
                           std::string(90, 'w') + " end";
  std::string letters;
  for (const char c : text) letters += c == ' ' ? "" : std::string(1, c);
  for (const int width_px : {60, 320, 512, 1024, 2048}) {
    const TextStyle style = textStyle(width_px);
    std::string joined;
    for (const std::string& line : wrapped(text, width_px, style)) {
      EXPECT_LE(textWidth_px(line, style), width_px) << line;
      for (const char c : line) joined += c == ' ' ? "" : std::string(1, c);
    }
    EXPECT_EQ(joined, letters);
  }
  EXPECT_TRUE(wrapped("  ", 512, textStyle(512)).empty());
}

TEST(TextBands, LettersGrowWithThePictureAndStayReadable) {
  const auto letter = [](int width_px) { return textWidth_px("nnnnnnnnnn", textStyle(width_px)) / 10.0; };
  EXPECT_GE(letter(320), 7);
  EXPECT_EQ(letter(320), letter(512));
  EXPECT_GT(letter(1024), 1.5 * letter(512));
  EXPECT_NEAR(letter(2048) / letter(1024), 2, 0.1);
}

TEST(TextBands, HaveRoomForAllLines) {
  const TextStyle style = textStyle(320);
  const std::vector<BandEntry> entries{{"a line that is too long for a picture that is as narrow as this one is", {}}};
  EXPECT_EQ(bandHeight_px({{"short", {}}}, 320, style), style.lineHeight_px() + style.margin_px());
  EXPECT_EQ(bandHeight_px(entries, 320, style), 2 * style.lineHeight_px() + style.margin_px());
  EXPECT_EQ(bandHeight_px({{"", {}}}, 320, style), 0);
}

TEST(StatusStyles, TellByColorAndInWordsHowFarAResultMayBeUsed) {
  const auto styled = [](RegistrationStatus status, const std::optional<std::vector<std::string>>& usable_for = {}) {
    return statusStyle(status, usable_for);
  };
  const auto converged = RegistrationStatus::kConverged;
  EXPECT_EQ(styled(converged).color_bgr, kConvergedColor);
  EXPECT_EQ(styled(converged).words, "converged");
  EXPECT_EQ(styled(converged, std::vector<std::string>{"centre", "view", "navigate"}).color_bgr, kConvergedColor);
  EXPECT_EQ(styled(converged, std::vector<std::string>{"centre"}).color_bgr, kLimitedColor);
  EXPECT_EQ(styled(converged, std::vector<std::string>{"centre"}).words, "converged, usable for centre only");
  EXPECT_EQ(styled(converged, std::vector<std::string>{}).color_bgr, kLimitedColor);
  for (const auto status :
       {RegistrationStatus::kAmbiguous, RegistrationStatus::kDiverged, RegistrationStatus::kTooFewPoints}) {
    EXPECT_EQ(styled(status).color_bgr, kRejectedColor);
    EXPECT_EQ(styled(status).words, statusName(status) + ", not to be trusted");
  }
}

TEST(AgreementInWords, CountsVesselsWithoutContrastAgentInTheShareAlone) {
  AlignmentScore agreement;
  agreement.model_residual_px = 43.75;
  agreement.image_residual_px = 1.2;
  agreement.model_explained = 0.56;
  EXPECT_EQ(alignmentInWords(agreement), "image to tree 1.20 px, 56 % of the tree in view explained");
}

TEST(Tiles, TakeTheRoomOfTheLargestPicture) {
  const cv::Mat small(10, 20, CV_8UC3, cv::Scalar::all(50)), high(30, 20, CV_8UC3, cv::Scalar::all(90));
  const cv::Mat sheet = tiled({small, high, small}, 2, 4, cv::Scalar::all(7));
  ASSERT_EQ(sheet.size(), cv::Size(48, 68));
  EXPECT_EQ(sheet.at<cv::Vec3b>(9, 0), cv::Vec3b::all(50));
  EXPECT_EQ(sheet.at<cv::Vec3b>(10, 0), cv::Vec3b::all(7)) << "below a picture that is less high";
  EXPECT_EQ(sheet.at<cv::Vec3b>(29, 24), cv::Vec3b::all(90));
  EXPECT_EQ(sheet.at<cv::Vec3b>(34, 0), cv::Vec3b::all(50)) << "the second row";
}

// Pixels of a colour between the axes, where no legend stands.
int pixelsOfPlot(const cv::Mat& plot, const cv::Scalar& color) {
  const cv::Mat inside = plot.colRange(80, plot.cols - 120);
  cv::Mat same;
  cv::inRange(inside, color, color, same);
  return cv::countNonZero(same);
}

Plot plotOf(std::vector<double> x, std::vector<double> y, bool log = false) {
  return {"title", {"x"}, {"y", log}, {{"series", std::move(x), std::move(y), 0}}};
}

TEST(Plots, StandBelowEachOther) {
  const cv::Mat plot = drawPlots({plotOf({0, 1, 2}, {1, 2, 1}), plotOf({0, 1, 2}, {1e-3, 10, 1}, true)}, 700, 200);
  ASSERT_EQ(plot.type(), CV_8UC3);
  ASSERT_EQ(plot.size(), cv::Size(700, 400));
  // A line across 500 pixels, two wide.
  EXPECT_GT(pixelsOfPlot(plot.rowRange(0, 200), plotColor(0)), 400);
  EXPECT_GT(pixelsOfPlot(plot.rowRange(200, 400), plotColor(0)), 400);
}

TEST(Plots, WhatIsNotANumberLeavesAGap) {
  const int whole = pixelsOfPlot(drawPlots({plotOf({0, 1, 2, 3, 4}, {1, 1, 1, 1, 1})}), plotColor(0));
  const int gap = pixelsOfPlot(drawPlots({plotOf({0, 1, 2, 3, 4}, {1, 1, kNan, 1, 1})}), plotColor(0));
  EXPECT_NEAR(gap, whole / 2, whole / 10);
}

// Boxes of an SVG's texts of one class, by what they say: letters 6 px wide, 11 px high.
std::map<std::string, cv::Rect2d> textsOf(const std::string& svg, const std::string& part) {
  std::map<std::string, cv::Rect2d> boxes;
  const std::regex text("<text class=\"" + part + "[^\"]*\" x=\"([-.0-9]+)\" y=\"([-.0-9]+)\"[^>]*>([^<]*)</text>");
  for (std::sregex_iterator at(svg.begin(), svg.end(), text), end; at != end; ++at) {
    const std::string words = (*at)[3];
    boxes[words] = {std::stod((*at)[1]), std::stod((*at)[2]) - 11, 6.0 * static_cast<double>(words.size()), 11};
  }
  return boxes;
}

// A line from the lower left to the upper right with labels along a fifth of it.
std::map<std::string, cv::Rect2d> labelsOnALine(int count) {
  Plot plot = plotOf({0, 1}, {0, 1});
  for (int k = 0; k < count; ++k) {
    const double x = 0.4 + 0.2 * k / count;
    plot.labels.push_back({{{x, x}}, "label " + std::to_string(k), k});
  }
  return textsOf(svgPlotFile({plot}, 900, 600), "name");
}

TEST(Plots, LabelsDoNotCoverEachOther) {
  const auto boxes = labelsOnALine(40);
  ASSERT_EQ(boxes.size(), 40U);
  for (const auto& [a, box_a] : boxes) {
    for (const auto& [b, box_b] : boxes) EXPECT_TRUE(a == b || (box_a & box_b).empty()) << a << " and " << b;
  }
}

TEST(Plots, LabelsCoverNoLineWhereThereIsRoom) {
  const auto boxes = labelsOnALine(10);
  ASSERT_EQ(boxes.size(), 10U);
  for (const auto& [words, box] : boxes) {
    // Where the frame has the line: 820 px to the right while it rises 496 px by 1.05.
    int covered = 0;
    for (int k = 0; k <= 820; ++k) covered += box.contains({64.0 + k, 550.0 - 496 / 1.05 * k / 820});
    EXPECT_EQ(covered, 0) << words;
  }
}

TEST(Plots, AFileOfThemNeedsNoPageAroundIt) {
  const std::string svg = svgPlotFile({plotOf({0, 1}, {0, 1}), plotOf({0, 1}, {1, 0})}, 300, 200);
  EXPECT_EQ(svg.rfind("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"600\" height=\"200\"", 0), 0U);
  EXPECT_EQ(svg.find("var("), std::string::npos) << "colours that only the page of a report knows";
  EXPECT_NE(svg.find("<g transform=\"translate(300 0)\">"), std::string::npos);
}

// A trunk to the patient's left (+ x) that forks to the head (+ z) and to the front (- y), 100 mm each; the branch to
// the head is the first; model axes L, P, S.
class BranchPictures : public testing::Test {
 protected:
  VesselTree tree_{(Eigen::Matrix3Xd(3, 7) << 0, 0.05, 0.1, 0.1, 0.1, 0.1, 0.1,  //
                    0, 0, 0, -0.05, -0.1, 0, 0,                                  //
                    0, 0, 0, 0, 0, 0.05, 0.1)
                       .finished(),
                   {-1, 0, 1, 2, 3, 2, 5},
                   {1e-3, 1e-3, 3e-3, 2e-3, 2e-3, std::nullopt, std::nullopt}};
};

TEST_F(BranchPictures, NumberWhatATreesTopologyNumbers) {
  const TreeTopology map(tree_);
  const auto branches = numberedBranches(tree_, {"trunk", "to the head", ""});
  ASSERT_EQ(branches.size(), 3U);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(branches[k].number, k);
    EXPECT_EQ(branches[k].parent, map.parent(k));
    EXPECT_DOUBLE_EQ(branches[k].length_m, map.length_m(k));
  }
  EXPECT_NEAR(branches[0].mean_radius_m.value(), 1.5e-3, 1e-12);
  EXPECT_FALSE(branches[1].mean_radius_m) << "no edge of known radii";
}

TEST_F(BranchPictures, ShowLeftOnTheLeftAndFrontOnTheRight) {
  const BranchPicture picture = branchPicture(tree_, numberedBranches(tree_), Eigen::Matrix3d::Identity(), "");
  ASSERT_EQ(picture.views.size(), 2U);
  const Plot &front = picture.views[0], &lateral = picture.views[1];
  EXPECT_EQ(front.sides.left + front.sides.right + front.sides.top + front.sides.bottom, "LRHF");
  EXPECT_EQ(lateral.sides.left + lateral.sides.right + lateral.sides.top + lateral.sides.bottom, "PAHF");
  const auto from = [](const Plot& plot, int branch) {
    const PlotSeries& s = plot.series[branch];
    return Eigen::Vector2d(s.x.back() - s.x.front(), s.y.back() - s.y.front());
  };
  EXPECT_NEAR((from(front, 0) - Eigen::Vector2d(-100, 0)).norm(), 0, 1e-9) << "the patient's left on the left";
  EXPECT_NEAR((from(front, 1) - Eigen::Vector2d(0, 100)).norm(), 0, 1e-9) << "head up";
  EXPECT_NEAR((from(lateral, 2) - Eigen::Vector2d(100, 0)).norm(), 0, 1e-9) << "the front on the right";
  EXPECT_NEAR((from(lateral, 1) - Eigen::Vector2d(0, 100)).norm(), 0, 1e-9);
}

TEST_F(BranchPictures, NumbersStandOnTheirBranches) {
  const BranchPicture picture =
      branchPicture(tree_, numberedBranches(tree_, {"", "", "curve - LVA"}), Eigen::Matrix3d::Identity(), "");
  for (const Plot& view : picture.views) {
    std::map<std::string, PlotLabel> labels;
    for (const PlotLabel& label : view.labels) labels[label.words] = label;
    ASSERT_EQ(labels.size(), 4U);
    const std::string words[] = {"0", "1", "2 LVA"};
    for (int branch = 0; branch < 3; ++branch) {
      const PlotSeries& line = view.series[branch];
      ASSERT_EQ(labels.count(words[branch]), 1U);
      EXPECT_EQ(labels[words[branch]].color, line.color);
      // The first place is the middle, where these branches have a point.
      EXPECT_NEAR(labels[words[branch]].places.front().first, line.x[1], 1e-9);
      EXPECT_NEAR(labels[words[branch]].places.front().second, line.y[1], 1e-9);
    }
    EXPECT_NEAR(labels["root"].places.front().first, view.series[0].x.front(), 1e-9);
    EXPECT_NE(view.series[0].color, view.series[1].color);
    EXPECT_NE(view.series[1].color, view.series[2].color);
  }
}

TEST(Plots, SurviveSeriesWithNothingToShow) {
  const cv::Size size(900, 260);
  for (const bool log : {false, true}) {
    for (const auto& y : std::vector<std::vector<double>>{
             {}, {3}, {0}, {kNan}, {-1, -1}, {kInfinity, kNan}, {5e-324, 1}, {1e-300, 1e300}, {1e12, 1e12}}) {
      std::vector<double> x(y.size());
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<double>(i);
      EXPECT_EQ(drawPlots({plotOf(x, y, log)}).size(), size);
    }
    EXPECT_EQ(drawPlots({{"", {}, {"", log}}}).size(), size);
    EXPECT_EQ(drawPlots({plotOf({0, 1, 2}, {1}, log)}).size(), size) << "lists of different length";
  }
  EXPECT_TRUE(drawPlots({}).empty());
}

}  // namespace
}  // namespace angio::test
