// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/extraction_run.hpp"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/geometry/se3.hpp"
#include "angio/imaging/thinning.hpp"
#include "nearest_on_curve.hpp"

namespace angio::evaluation {
namespace {

// What of a truth has a line of its own, and what shares another's.
class OwnLines {
 public:
  OwnLines(const Centerline2d& truth, const std::vector<bool>& own)
      : own_(own.empty() ? Centerline2d() : pointsWhere(truth, own)),
        shared_(own.empty() ? Centerline2d() : pointsWhere(truth, opposite(own))) {}

  // Whether the truth nearest to a place shares its line, and the place is within that vessel.
  bool shared(const Eigen::Vector2d& p) const {
    const auto place = shared_(p);
    return place.distance_px < own_(p).distance_px && place.distance_px <= place.radius_px;
  }

 private:
  static std::vector<bool> opposite(std::vector<bool> flags) {
    flags.flip();
    return flags;
  }

  NearestOnCurve own_, shared_;
};

Centerline2d pointsOf(const cv::Mat& mask) {
  std::vector<cv::Point> pixels;
  cv::findNonZero(mask, pixels);
  Eigen::Matrix2Xd points(2, static_cast<Eigen::Index>(pixels.size()));
  for (std::size_t i = 0; i < pixels.size(); ++i) points.col(i) << pixels[i].x, pixels[i].y;
  return makeCenterline(points);
}

}  // namespace

void ExtractionScore::add(const Centerline2d& found, const Centerline2d& required, const Centerline2d& allowed,
                          const std::vector<bool>& own_line) {
  const Centerline2d line = densified(found, kScoreStep_px), wanted = densified(required, kScoreStep_px);
  const NearestOnCurve nearest_found(line), nearest_true(allowed);
  const OwnLines own(allowed, own_line);
  for (int i = 0; i < wanted.size(); ++i) {
    const Eigen::Vector2d p = wanted.points_px.col(i);
    const bool covered = nearest_found(p).distance_px <= tolerance_px_;
    covered_ += covered;
    if (own_line.empty()) continue;
    ++scored_required_;
    if (own.shared(p)) continue;
    ++own_required_;
    own_covered_ += covered;
  }
  required_ += wanted.size();
  for (int i = 0; i < line.size(); ++i) {
    const Eigen::Vector2d p = line.points_px.col(i);
    const double distance_px = nearest_true(p).distance_px;
    distances_px_.push_back(distance_px);
    correct_ += distance_px <= tolerance_px_;
    if (own_line.empty() || own.shared(p)) continue;
    ++own_found_;
    own_correct_ += distance_px <= tolerance_px_;
  }
  found_ += line.size();
  for (int i = 0; i < found.size(); ++i) {  // The points themselves: between them a line knows nothing of its own.
    const auto place = nearest_true(found.points_px.col(i));
    if (place.distance_px > tolerance_px_) continue;
    errors_px_.push_back(place.distance_px);
    tangent_errors_rad_.push_back(std::abs(undirected(found.tangent_rad[i] - place.tangent_rad)));
    if (found.std_px.size() > 0) {
      squared_ratios_ += std::pow(place.distance_px / found.std_px[i], 2);
      ++ratios_;
    }
  }
}

void ExtractionScore::add(const ExtractionScore& other) {
  covered_ += other.covered_;
  required_ += other.required_;
  correct_ += other.correct_;
  found_ += other.found_;
  own_covered_ += other.own_covered_;
  own_required_ += other.own_required_;
  own_correct_ += other.own_correct_;
  own_found_ += other.own_found_;
  scored_required_ += other.scored_required_;
  squared_ratios_ += other.squared_ratios_;
  ratios_ += other.ratios_;
  const auto append = [](std::vector<double>& all, const std::vector<double>& more) {
    all.insert(all.end(), more.begin(), more.end());
  };
  append(errors_px_, other.errors_px_);
  append(tangent_errors_rad_, other.tangent_errors_rad_);
  append(distances_px_, other.distances_px_);
}

void ExtractionScore::addMask(const Centerline2d& found, const cv::Mat& mask) {
  const Centerline2d line = densified(found, kScoreStep_px);
  cv::Mat outside, distance;
  cv::compare(mask, 0, outside, cv::CMP_EQ);
  cv::distanceTransform(outside, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const auto outsideBy_px = [&](const Eigen::Vector2d& p) {
    const cv::Point pixel(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
    return cv::Rect({}, distance.size()).contains(pixel) ? distance.at<float>(pixel)
                                                         : std::numeric_limits<float>::infinity();
  };
  for (int i = 0; i < line.size(); ++i) {
    const double distance_px = outsideBy_px(line.points_px.col(i));
    distances_px_.push_back(distance_px);
    correct_ += distance_px <= tolerance_px_;
  }
  found_ += line.size();

  cv::Mat lines = mask != 0;
  thin(lines);
  const Centerline2d wanted = pointsOf(lines);
  const NearestOnCurve nearest_found(line);
  for (int i = 0; i < wanted.size(); ++i) {
    covered_ += nearest_found(wanted.points_px.col(i)).distance_px <= tolerance_px_;
  }
  required_ += wanted.size();
}

Json ExtractionScore::asJson() const {
  const auto share = [](double part, double whole) { return whole > 0 ? part / whole : 0; };
  Json json = {{"tolerance_px", tolerance_px_},
               {"covered", share(covered_, required_)},
               {"correct", share(correct_, found_)},
               {"median_distance_px", percentile(distances_px_, 0.5)}};
  if (!errors_px_.empty()) {
    json["median_error_px"] = percentile(errors_px_, 0.5);
    json["median_tangent_error_deg"] = radToDeg(percentile(tangent_errors_rad_, 0.5));
  }
  if (own_required_ > 0) {
    json["own_line_part"] = share(own_required_, scored_required_);
    json["own_line_covered"] = share(own_covered_, own_required_);
    json["own_line_correct"] = share(own_correct_, own_found_);
  }
  if (ratios_ > 0) json["error_over_sigma"] = std::sqrt(squared_ratios_ / ratios_);
  return json;
}

Centerline2d shownIn(const cv::Mat& image, const Centerline2d& projected, double radius_px, double contrast) {
  cv::Mat values, log_image;
  image.convertTo(values, CV_32F, 1, 1);  // One above nothing: black has a logarithm too.
  cv::log(values, log_image);
  const auto at = [&](const Eigen::Vector2d& p) -> std::optional<double> {
    const int x = static_cast<int>(std::floor(p.x())), y = static_cast<int>(std::floor(p.y()));
    if (x < 0 || y < 0 || x + 1 >= log_image.cols || y + 1 >= log_image.rows) return std::nullopt;
    const double a = p.x() - x, b = p.y() - y;
    const float *top = log_image.ptr<float>(y) + x, *bottom = log_image.ptr<float>(y + 1) + x;
    return (1 - b) * ((1 - a) * top[0] + a * top[1]) + b * ((1 - a) * bottom[0] + a * bottom[1]);
  };
  // Mean over a piece of the vessel's length, so that noise is no vessel.
  constexpr int kHalfLength_px = 4;
  const auto meanAlong = [&](const Eigen::Vector2d& p, const Eigen::Vector2d& along) -> std::optional<double> {
    double sum = 0;
    for (int k = -kHalfLength_px; k <= kHalfLength_px; ++k) {
      const auto value = at(p + k * along);
      if (!value) return std::nullopt;
      sum += *value;
    }
    return sum / (2 * kHalfLength_px + 1);
  };
  const auto shown = [&](int i) {
    const Eigen::Vector2d p = projected.points_px.col(i);
    const Eigen::Vector2d along(std::cos(projected.tangent_rad[i]), std::sin(projected.tangent_rad[i]));
    const Eigen::Vector2d across(-along.y(), along.x());
    for (double offset = -radius_px; offset <= radius_px; offset += 1) {
      const auto middle = meanAlong(p + offset * across, along);
      const auto left = meanAlong(p + (offset - 2.5 * radius_px) * across, along);
      const auto right = meanAlong(p + (offset + 2.5 * radius_px) * across, along);
      if (middle && left && right && std::min(*left, *right) - *middle >= contrast) return true;
    }
    return false;
  };
  std::vector<bool> keep(static_cast<std::size_t>(projected.size()));
  for (int i = 0; i < projected.size(); ++i) keep[i] = shown(i);
  return pointsWhere(projected, keep);
}

}  // namespace angio::evaluation
