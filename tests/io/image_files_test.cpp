// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/image_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::contentOf;
using test::refusalOf;
using test::TemporaryFolder;

cv::Mat pattern(int type) {
  cv::Mat image(19, 23, type);
  cv::RNG random(5);
  random.fill(image, cv::RNG::UNIFORM, 0, image.depth() == CV_16U ? 65536 : 256);
  return image;
}

void expectSame(const cv::Mat& a, const cv::Mat& b) {
  ASSERT_EQ(a.type(), b.type());
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0);
}

TEST(ImageFiles, RoundTripKeepsEveryPixel) {
  const TemporaryFolder folder;
  for (const char* name : {"a.png", "a.tif", "a.TIFF"}) {
    for (const int type : {CV_8UC1, CV_16UC1}) {
      const cv::Mat image = pattern(type);
      writeImage(folder.path(name), image);
      expectSame(readXrayImage(folder.path(name)), image);
    }
  }
}

TEST(ImageFiles, GreyStoredAsColorPassesColourDoesNot) {
  const TemporaryFolder folder;
  const cv::Mat grey = pattern(CV_8UC1);
  cv::Mat color;
  cv::merge(std::vector<cv::Mat>{grey, grey, grey}, color);
  for (const char* name : {"a.png", "a.tif"}) {
    writeImage(folder.path(name), color);
    expectSame(readXrayImage(folder.path(name)), grey);
    color.at<cv::Vec3b>(4, 5)[1] ^= 1;
    writeImage(folder.path(name), color);
    EXPECT_NE(refusalOf([&] { readXrayImage(folder.path(name)); }).find("channels = 3"), std::string::npos);
    color.at<cv::Vec3b>(4, 5)[1] ^= 1;
  }
}

TEST(ImageFiles, JpegKeepsItsGreyLevelsAndRefusesColoursAndCutFiles) {
  const TemporaryFolder folder;
  cv::Mat smooth(40, 56, CV_8UC1), color;
  for (int y = 0; y < smooth.rows; ++y) {
    for (int x = 0; x < smooth.cols; ++x) smooth.at<unsigned char>(y, x) = static_cast<unsigned char>(20 + 3 * x + y);
  }
  cv::merge(std::vector<cv::Mat>{smooth, smooth, smooth}, color);
  for (const cv::Mat& image : {smooth, color}) {
    writeImage(folder.path("a.JPG"), image);
    const cv::Mat read = readXrayImage(folder.path("a.JPG"));
    ASSERT_EQ(read.type(), CV_8UC1);
    EXPECT_LE(cv::norm(read, smooth, cv::NORM_INF), 4);  // What quality 95 leaves of a slope.
  }
  const std::string whole = contentOf(folder.path("a.JPG"));
  color(cv::Rect(8, 8, 16, 16)).setTo(cv::Scalar(0, 0, 255));
  writeImage(folder.path("b.jpg"), color);
  EXPECT_NE(refusalOf([&] { readXrayImage(folder.path("b.jpg")); }).find("b.jpg: channels = 3"), std::string::npos);
  const std::string cut = folder.write("c.jpg", whole.substr(0, whole.size() - 40));
  EXPECT_NE(refusalOf([&] { readXrayImage(cut); }).find("c.jpg: is not a readable JPEG"), std::string::npos);
}

// Little endian, one strip, 2 x 1 pixels 10 and 200; the photometric interpretation is the last byte but 16 of the
// entries.
std::string smallTiff(int photometric, const std::string& width = std::string("\2\0\0\0", 4)) {
  const auto entry = [](char tag_low, const std::string& value) {
    return std::string{tag_low, 1, 4, 0, 1, 0, 0, 0} + value;
  };
  const auto word = [](int value) { return std::string{static_cast<char>(value), 0, 0, 0}; };
  std::string file("II*\0\x0a\0\0\0\x0a\xc8", 10);
  file += std::string("\7\0", 2) + entry(0, width) + entry(1, word(1)) + entry(2, word(8)) + entry(3, word(1)) +
          entry(6, word(photometric)) + entry(17, word(8)) + entry(23, word(2)) + word(0);
  return file;
}

TEST(ImageFiles, TiffWhoseZeroIsWhiteIsTurned) {
  const TemporaryFolder folder;
  const cv::Mat image = readXrayImage(folder.write("a.tif", smallTiff(1)));
  EXPECT_EQ(image.at<unsigned char>(0, 0), 10);
  EXPECT_EQ(image.at<unsigned char>(0, 1), 200);
  EXPECT_EQ(readXrayImage(folder.write("a.tif", smallTiff(0))).at<unsigned char>(0, 0), 245);
}

TEST(ImageFiles, HugeSizesAreRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  const std::string huge("\0\0\0\x40", 4);
  EXPECT_NE(refusalOf([&] { readXrayImage(folder.write("a.tif", smallTiff(1, huge))); }).find("width = 1073741824"),
            std::string::npos);
  writeImage(folder.path("a.png"), cv::Mat::zeros(1, 8193, CV_8U));
  EXPECT_NE(refusalOf([&] { readXrayImage(folder.path("a.png")); }).find("not a readable PNG"), std::string::npos);
  writeImage(folder.path("a.png"), cv::Mat::zeros(1, 8192, CV_8U));
  EXPECT_EQ(readXrayImage(folder.path("a.png")).cols, 8192);
}

TEST(ImageFiles, CutOrChangedFilesAreReadOrRefusedInSilence) {
  const TemporaryFolder folder;
  int refused = 0;
  const auto tryTo = [&](const std::string& content) {
    try {
      const XrayFrames frames(folder.write("hostile", content));
      frames.frame(frames.count() - 1);
    } catch (const InputError&) {
      ++refused;
    }
  };
  std::vector<std::string> goods{smallTiff(1)};
  for (const char* name : {"a.png", "a.tif"}) {
    for (const int type : {CV_8UC1, CV_16UC1, CV_8UC3}) {
      writeImage(folder.path(name), pattern(type).rowRange(0, 5));
      goods.push_back(contentOf(folder.path(name)));
    }
  }
  for (const int type : {CV_8UC1, CV_8UC3}) {
    writeImage(folder.path("a.jpg"), pattern(type).rowRange(0, 5));
    goods.push_back(contentOf(folder.path("a.jpg")));
  }
  writeImageSequence(folder.path("a.tif"), std::vector<cv::Mat>(2, pattern(CV_16UC1).rowRange(0, 5)));
  goods.push_back(contentOf(folder.path("a.tif")));
  unsigned random = 1;
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  std::size_t cuts = 0;
  for (const std::string& good : goods) {
    for (std::size_t length = 0; length < good.size(); ++length, ++cuts) tryTo(good.substr(0, length));
    for (int trial = 0; trial < 2000; ++trial) {
      std::string bad = good;
      random = random * 1664525U + 1013904223U;
      bad[(random >> 8) % bad.size()] ^= static_cast<char>(1U << (random >> 5) % 8);
      tryTo(bad);
    }
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_GT(refused, static_cast<int>(cuts) / 2);
}

TEST(ImageFiles, SequencesRoundTripFrameByFrame) {
  const TemporaryFolder folder;
  for (const int type : {CV_8UC1, CV_16UC1}) {
    for (const cv::Size& size : {cv::Size(23, 19), cv::Size(700, 900)}) {  // One strip, and several.
      std::vector<cv::Mat> frames(3);
      cv::RNG random(6);
      for (cv::Mat& frame : frames) {
        frame.create(size, type);
        random.fill(frame, cv::RNG::UNIFORM, 0, type == CV_16UC1 ? 65536 : 256);
      }
      const cv::Mat cut = cv::Mat(frames[1], cv::Rect(0, 0, size.width, size.height));
      writeImageSequence(folder.path("a.tif"), {frames[0], cut, frames[2]});
      const XrayFrames read(folder.path("a.tif"));
      ASSERT_EQ(read.count(), 3);
      for (const int f : {2, 0, 1}) expectSame(read.frame(f), frames[static_cast<std::size_t>(f)]);
      expectSame(readXrayImage(folder.path("a.tif")), frames[0]);
      EXPECT_NE(refusalOf([&] { read.frame(3); }).find("a.tif: frame = 3: must lie between 0 and 2"),
                std::string::npos);
    }
  }
  EXPECT_EQ(folder.files(), 1U);
}

TEST(ImageFiles, SequencesOfOtherThingsAreRefused) {
  const TemporaryFolder folder;
  const cv::Mat good = pattern(CV_8UC1);
  const auto refused = [&](const char* name, const std::vector<cv::Mat>& frames) {
    return refusalOf([&] { writeImageSequence(folder.path(name), frames); });
  };
  EXPECT_NE(refused("a.png", {good}).find("extension = .png"), std::string::npos);
  EXPECT_NE(refused("a.tif", {}).find("frames = 0"), std::string::npos);
  EXPECT_NE(refused("a.tif", {good, pattern(CV_16UC1)}).find("frame = 1"), std::string::npos);
  EXPECT_NE(refused("a.tif", {good, good.rowRange(0, 5)}).find("frame = 1"), std::string::npos);
  EXPECT_NE(refused("a.tif", {pattern(CV_8UC3)}).find("frame = 0"), std::string::npos);
  EXPECT_EQ(folder.files(), 0U);
}

TEST(ImageFiles, PagesThatGoRoundInACircleAreRefused) {
  const TemporaryFolder folder;
  std::string circle = smallTiff(1);
  circle[circle.size() - 4] = 10;  // The next directory is the first one, at byte 10.
  EXPECT_NE(refusalOf([&] { XrayFrames(folder.write("a.tif", circle)); }).find("a.tif: "), std::string::npos);
}

TEST(ImageFiles, OtherFilesAndTypesAreRefused) {
  const TemporaryFolder folder;
  const auto says = [&](const std::string& message, const std::string& expected) {
    EXPECT_NE(message.find(expected), std::string::npos) << message;
  };
  says(refusalOf([&] { readXrayImage(folder.write("a.png", "")); }), "a.png: must be a PNG, TIFF, JPEG or DICOM image");
  says(refusalOf([&] { writeImage(folder.path("a.bmp"), pattern(CV_8UC1)); }), "extension = .bmp");
  says(refusalOf([&] { writeImage(folder.path("a.jpg"), pattern(CV_16UC1)); }), "CV_16UC1");
  says(refusalOf([&] { writeImage(folder.path("a.png"), cv::Mat()); }), "empty");
  says(refusalOf([&] { writeImage(folder.path("none/a.png"), pattern(CV_8UC1)); }), "cannot be written");
  EXPECT_EQ(folder.files(), 1U);
}

}  // namespace
}  // namespace angio::test
