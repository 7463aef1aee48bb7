// SPDX-License-Identifier: GPL-2.0-or-later
#include "foxglove_json.hpp"

#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace angio::recording {
namespace {

// Of a live image as it is looked at; the pixels themselves stand beside it.
constexpr int kJpegQuality = 50;

// Of the smoothing before: noise is most of a JPEG's bytes, and none of what is looked at.
constexpr double kSmoothing_px = 0.8;

constexpr double kDarkest = 0.005, kBrightest = 0.995;
constexpr int kSampledPixel = 7;  // Every so many pixels tell the range.

cv::Mat as8Bit(const cv::Mat& image) {
  if (image.depth() == CV_8U) return image;
  std::vector<std::uint16_t> sample;
  for (int y = 0; y < image.rows; y += kSampledPixel) {
    const auto* row = image.ptr<std::uint16_t>(y);
    for (int x = 0; x < image.cols; x += kSampledPixel) sample.push_back(row[x]);
  }
  const auto at = [&sample](double share) {
    const auto place = sample.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(sample.size() - 1));
    std::nth_element(sample.begin(), place, sample.end());
    return static_cast<double>(*place);
  };
  const double low = at(kDarkest), scale = 255 / std::max(1.0, at(kBrightest) - low);
  cv::Mat shown;
  image.convertTo(shown, CV_8U, scale, -low * scale);
  return shown;
}

}  // namespace

double rounded(double value, int decimals) {
  const double scale = std::pow(10, decimals);
  return std::round(value * scale) / scale;
}

Json timeJson(std::int64_t time_us) { return {{"sec", time_us / 1'000'000}, {"nsec", 1000 * (time_us % 1'000'000)}}; }

Json pointJson(const Eigen::Vector2d& pixel) { return {{"x", rounded(pixel.x(), 1)}, {"y", rounded(pixel.y(), 1)}}; }

namespace {

Json quaternionJson(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  return {{"x", rounded(q.x(), 9)}, {"y", rounded(q.y(), 9)}, {"z", rounded(q.z(), 9)}, {"w", rounded(q.w(), 9)}};
}

Json vectorJson(const Eigen::Vector3d& v, int decimals) {
  return {{"x", rounded(v.x(), decimals)}, {"y", rounded(v.y(), decimals)}, {"z", rounded(v.z(), decimals)}};
}

constexpr int kPoseDecimals = 8;

}  // namespace

Json poseJson(const Pose& pose) {
  return {{"position", vectorJson(pose.translation(), kPoseDecimals)}, {"orientation", quaternionJson(pose.linear())}};
}

Json colorJson(double red, double green, double blue) { return {{"r", red}, {"g", green}, {"b", blue}, {"a", 1.0}}; }

Json transformJson(std::int64_t time_us, const char* parent, const char* child, const Pose& T_parent_child) {
  return {{"timestamp", timeJson(time_us)},
          {"parent_frame_id", parent},
          {"child_frame_id", child},
          {"translation", vectorJson(T_parent_child.translation(), kPoseDecimals)},
          {"rotation", quaternionJson(T_parent_child.linear())}};
}

// One primitive with all points and the pairs that are joined is half as long as one for each line.
Json lineEntityJson(std::int64_t time_us, const char* frame, const char* id, const std::vector<Line>& lines,
                    int decimals, const Json& color) {
  Json points = Json::array(), joined = Json::array();
  for (const Line& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (i > 0) {
        joined.push_back(points.size() - 1);
        joined.push_back(points.size());
      }
      points.push_back(vectorJson(line[i], decimals));
    }
  }
  const Json primitive{{"type", 2},  // LINE_LIST
                       {"pose", poseJson(Pose::Identity())},
                       {"thickness", 2},  // [px], as it is scale invariant
                       {"scale_invariant", true},
                       {"points", std::move(points)},
                       {"color", color},
                       {"colors", Json::array()},
                       {"indices", std::move(joined)}};
  Json entity{{"timestamp", timeJson(time_us)},
              {"frame_id", frame},
              {"id", id},
              {"lifetime", {{"sec", 0}, {"nsec", 0}}},
              {"frame_locked", true}};
  for (const char* none : {"metadata", "arrows", "cubes", "spheres", "cylinders"}) entity[none] = Json::array();
  entity["lines"] = Json::array({primitive});
  for (const char* none : {"triangles", "texts", "models"}) entity[none] = Json::array();
  return entity;
}

std::string jpegBase64(const cv::Mat& image) {
  cv::Mat shown;
  cv::GaussianBlur(as8Bit(image), shown, {3, 3}, kSmoothing_px);
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", shown, jpeg, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  std::string text(4 * ((jpeg.size() + 2) / 3) + 1, '\0');
  const int length =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()), jpeg.data(), static_cast<int>(jpeg.size()));
  text.resize(static_cast<std::size_t>(length));
  return text;
}

}  // namespace angio::recording
