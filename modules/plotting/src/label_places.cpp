// SPDX-License-Identifier: GPL-2.0-or-later
#include "label_places.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace angio::plotting {
namespace {

constexpr double kCell_px = 2, kNear_px = 4;
constexpr double kDistances_px[] = {2, 6, 12, 20, 30, 44, 62, 84, 110, 150, 200};
constexpr int kDirections = 16;

// Costs in pixels of distance.
constexpr double kLineCell = 3, kOtherPlace = 2, kCrossing = 25, kOverlap = 2000;

// How much of the drawn lines lies in a box.
class DrawnLines {
 public:
  DrawnLines(const std::vector<PlotCanvas::Points>& lines, const cv::Rect2d& frame) : corner_(frame.tl()) {
    cv::Mat1b cells(static_cast<int>(frame.height / kCell_px) + 2, static_cast<int>(frame.width / kCell_px) + 2,
                    uchar{0});
    for (const PlotCanvas::Points& line : lines) {
      for (std::size_t i = 1; i < line.size(); ++i) {
        const int steps = 1 + static_cast<int>(cv::norm(line[i] - line[i - 1]) / kCell_px);
        for (int k = 0; k <= steps; ++k) {
          const cv::Point at = cell(line[i - 1] + (line[i] - line[i - 1]) * (static_cast<double>(k) / steps));
          if (cv::Rect({}, cells.size()).contains(at)) cells(at) = 1;
        }
      }
    }
    cv::integral(cells, sums_, CV_32S);
  }

  int in(const cv::Rect2d& box) const {
    const cv::Rect all({}, sums_.size() - cv::Size(1, 1));
    const cv::Rect r = cv::Rect(cell(box.tl()), cell(box.br()) + cv::Point(1, 1)) & all;
    return sums_(r.br()) - sums_(r.y, r.br().x) - sums_(r.br().y, r.x) + sums_(r.tl());
  }

 private:
  cv::Point cell(const cv::Point2d& p) const {
    return {static_cast<int>(std::floor((p.x - corner_.x) / kCell_px)),
            static_cast<int>(std::floor((p.y - corner_.y) / kCell_px))};
  }

  cv::Point2d corner_;
  cv::Mat1i sums_;
};

cv::Point2d nearestIn(const cv::Rect2d& box, const cv::Point2d& p) {
  return {std::clamp(p.x, box.x, box.br().x), std::clamp(p.y, box.y, box.br().y)};
}

bool crosses(const std::pair<cv::Point2d, cv::Point2d>& line, const cv::Rect2d& box) {
  const int steps = 1 + static_cast<int>(cv::norm(line.second - line.first) / 3);
  for (int k = 0; k <= steps; ++k) {
    if (box.contains(line.first + (line.second - line.first) * (static_cast<double>(k) / steps))) return true;
  }
  return false;
}

PlacedLabel placedAt(const cv::Point2d& place, const cv::Rect2d& box) {
  const cv::Point2d end = nearestIn(box, place);
  if (cv::norm(end - place) <= kNear_px) return {box, {}};
  return {box, std::pair(place, end)};
}

double costOf(const PlacedLabel& label, const std::vector<PlacedLabel>& others) {
  double cost = 0;
  for (const PlacedLabel& other : others) {
    if ((label.box & other.box).area() > 0) cost += kOverlap;
    if (other.leader && crosses(*other.leader, label.box)) cost += kCrossing;
    if (label.leader && crosses(*label.leader, other.box)) cost += kCrossing;
  }
  return cost;
}

}  // namespace

std::vector<PlacedLabel> placeLabels(const std::vector<WantedLabel>& labels,
                                     const std::vector<PlotCanvas::Points>& lines, const cv::Rect2d& frame) {
  const DrawnLines drawn(lines, frame);
  std::vector<PlacedLabel> placed;
  for (const WantedLabel& label : labels) {
    // A label that does not fit anywhere stands on its place.
    const cv::Point2d half(0.5 * label.size.width, 0.5 * label.size.height);
    PlacedLabel best = placedAt(label.places.front(), cv::Rect2d(label.places.front() - half, label.size));
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t p = 0; p < label.places.size(); ++p) {
      for (const double distance : kDistances_px) {
        for (int k = 0; k < kDirections; ++k) {
          const double angle = 2 * CV_PI * k / kDirections;
          const cv::Point2d along(std::cos(angle), std::sin(angle));
          const cv::Point2d center =
              label.places[p] + cv::Point2d((half.x + distance) * along.x, (half.y + distance) * along.y);
          const cv::Rect2d box(center - half, label.size);
          if ((box & frame) != box) continue;
          const PlacedLabel here = placedAt(label.places[p], box);
          double cost = distance + kOtherPlace * static_cast<double>(p) + kLineCell * drawn.in(box);
          if (cost >= least) continue;
          cost += costOf(here, placed);
          if (cost >= least) continue;
          least = cost;
          best = here;
        }
      }
    }
    placed.push_back(best);
  }
  return placed;
}

}  // namespace angio::plotting
