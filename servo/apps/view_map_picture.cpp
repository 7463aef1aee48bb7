// SPDX-License-Identifier: GPL-2.0-or-later
#include "view_map_picture.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/formatted.hpp"
#include "angio/servo/desired_view.hpp"

namespace angio {
namespace {

constexpr int kPanelWidth_px = 600, kPanelHeight_px = 290;
constexpr int kLeft_px = 70, kRight_px = 70, kTop_px = 34, kBottom_px = 38;
constexpr int kTick_deg = 30;
const cv::Scalar kInk(40, 40, 40), kOutOfReach(200, 200, 200), kVessel(150, 130, 120), kSegment(0, 94, 213);

void write(cv::Mat& picture, const std::string& text, const cv::Point& at, double size = 0.42) {
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, kInk, 1, cv::LINE_AA);
}

cv::Mat3b coloured(const cv::Mat1f& share) {
  cv::Mat1b levels;
  share.convertTo(levels, CV_8U, 255);
  cv::Mat3b colours;
  cv::applyColorMap(levels, colours, cv::COLORMAP_VIRIDIS);
  return colours;
}

// One cost over the angles, in one corner of the picture.
class MapPanel {
 public:
  MapPanel(cv::Mat& picture, int top_px, const ViewMap& map)
      : picture_(picture),
        map_(map),
        area_(kLeft_px, top_px + kTop_px, kPanelWidth_px - kLeft_px - kRight_px,
              kPanelHeight_px - kTop_px - kBottom_px) {}

  void draw(const std::string& title, const Eigen::MatrixXf& cost, float most) {
    cv::Mat3b cells = coloured(upright(cost / most));
    for (int y = 0; y < cells.rows; ++y) {
      for (int x = 0; x < cells.cols; ++x) {
        if (!map_.reachable(cells.rows - 1 - y, x))
          cells(y, x) = cv::Vec3b::all(static_cast<std::uint8_t>(kOutOfReach[0]));
      }
    }
    cv::Mat area = picture_(area_);
    cv::resize(cells, area, area.size(), 0, 0, cv::INTER_NEAREST);
    write(picture_, title, {area_.x, area_.y - 12}, 0.5);
    axes();
    scale(most);
  }

  void mark(const ViewAngles& angles) {
    const cv::Point at = place(radToDeg(angles.primary_rad), radToDeg(angles.secondary_rad));
    for (const auto& [colour, thickness] : {std::pair(cv::Scalar::all(0), 4), std::pair(cv::Scalar::all(255), 2)}) {
      cv::circle(picture_, at, 8, colour, thickness, cv::LINE_AA);
      cv::drawMarker(picture_, at, colour, cv::MARKER_CROSS, 28, thickness);
    }
  }

 private:
  cv::Mat1f upright(const Eigen::MatrixXf& cost) const {
    cv::Mat1f m(static_cast<int>(cost.rows()), static_cast<int>(cost.cols()));
    for (int y = 0; y < m.rows; ++y) {
      for (int x = 0; x < m.cols; ++x) m(y, x) = cost(m.rows - 1 - y, x);
    }
    return m;
  }
  cv::Point place(double primary_deg, double secondary_deg) const {
    const double step_deg = radToDeg(map_.step_rad);
    const double column = (primary_deg - radToDeg(map_.first_primary_rad)) / step_deg + 0.5;
    const double row = (secondary_deg - radToDeg(map_.first_secondary_rad)) / step_deg + 0.5;
    return {area_.x + cvRound(area_.width * column / static_cast<double>(map_.overlap.cols())),
            area_.y + cvRound(area_.height * (1 - row / static_cast<double>(map_.overlap.rows())))};
  }
  void axes() {
    cv::rectangle(picture_, area_, kInk);
    const int most_primary = static_cast<int>(-radToDeg(map_.first_primary_rad) + 1e-6);
    const int most_secondary = static_cast<int>(-radToDeg(map_.first_secondary_rad) + 1e-6);
    for (int d = -most_primary / kTick_deg * kTick_deg; d <= most_primary; d += kTick_deg) {
      const cv::Point foot(place(d, 0).x, area_.y + area_.height);
      cv::line(picture_, foot, foot + cv::Point(0, 5), kInk);
      const std::string text = d == 0 ? "0" : formatted("%s %d", d < 0 ? "RAO" : "LAO", std::abs(d));
      write(picture_, text, foot + cv::Point(-4 * static_cast<int>(text.size()), 20));
    }
    for (int d = -most_secondary / kTick_deg * kTick_deg; d <= most_secondary; d += kTick_deg) {
      const cv::Point foot(area_.x, place(0, d).y);
      cv::line(picture_, foot, foot - cv::Point(5, 0), kInk);
      const std::string text = d == 0 ? "0" : formatted("%s %d", d < 0 ? "CAU" : "CRA", std::abs(d));
      write(picture_, text, foot - cv::Point(10 + 8 * static_cast<int>(text.size()), -4));
    }
  }
  void scale(float most) {
    const cv::Rect bar(area_.x + area_.width + 12, area_.y, 12, area_.height);
    cv::Mat1f ramp(area_.height, 1);
    for (int y = 0; y < ramp.rows; ++y) ramp(y, 0) = 1 - static_cast<float>(y) / static_cast<float>(ramp.rows);
    cv::Mat target = picture_(bar);
    cv::resize(coloured(ramp), target, target.size(), 0, 0, cv::INTER_NEAREST);
    write(picture_, formatted("%.2g", most), {bar.x + 15, bar.y + 10});
    write(picture_, "0", {bar.x + 15, bar.y + bar.height});
  }

  cv::Mat& picture_;
  const ViewMap& map_;
  cv::Rect area_;
};

// The tree as a view has it, filling a square.
void drawTree(cv::Mat picture, const VesselTree& tree, const TreeSegment& segment, const Pose& T_camera_model,
              const std::string& title) {
  const Eigen::Matrix3Xd seen = (T_camera_model.linear() * tree.points()).colwise() + T_camera_model.translation();
  const Eigen::Matrix2Xd rays = seen.colwise().hnormalized();
  const Eigen::Vector2d middle = 0.5 * (rays.rowwise().minCoeff() + rays.rowwise().maxCoeff());
  const double extent = (rays.rowwise().maxCoeff() - rays.rowwise().minCoeff()).maxCoeff();
  const double px_per_ray = 0.88 * picture.cols / std::max(extent, 1e-9);
  const auto line = [&](int a, int b, const cv::Scalar& colour, int thinnest_px) {
    const auto pixel = [&](int i) {
      const Eigen::Vector2d p = px_per_ray * (rays.col(i) - middle);
      return cv::Point(cvRound(p.x()) + picture.cols / 2, cvRound(p.y()) + picture.rows / 2 + 10);
    };
    const double radius_m = tree.radii()[static_cast<std::size_t>(b)].value_or(0);
    const int width_px = std::max(thinnest_px, cvRound(2 * px_per_ray * radius_m / seen(2, b)));
    cv::line(picture, pixel(a), pixel(b), colour, width_px, cv::LINE_AA);
  };
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    if (parent >= 0) line(parent, i, kVessel, 1);
  }
  for (std::size_t k = 1; k < segment.size(); ++k) line(segment[k - 1], segment[k], kSegment, 2);
  write(picture, title, {12, 22}, 0.5);
  cv::rectangle(picture, cv::Rect(0, 0, picture.cols, picture.rows), kOutOfReach);
}

}  // namespace

std::string inWords(const ViewAngles& angles) {
  const double primary_deg = radToDeg(angles.primary_rad), secondary_deg = radToDeg(angles.secondary_rad);
  return formatted("%s %.1f, %s %.1f", primary_deg < 0 ? "RAO" : "LAO", std::abs(primary_deg),
                   secondary_deg < 0 ? "CAU" : "CRA", std::abs(secondary_deg));
}

cv::Mat viewMapPicture(const VesselTree& tree, const TreeSegment& segment, const BestView& best,
                       const BestViewScene& scene, double overlap_weight) {
  const int height_px = 3 * kPanelHeight_px, side_px = height_px / 2;
  cv::Mat picture(height_px, kPanelWidth_px + side_px, CV_8UC3, cv::Scalar::all(255));
  const auto weight = static_cast<float>(overlap_weight);
  int top_px = 0;
  const auto panel = [&](const std::string& title, const Eigen::MatrixXf& cost, float most) {
    MapPanel one(picture, top_px, best.map);
    one.draw(title, cost, most);
    one.mark(best.angles);
    top_px += kPanelHeight_px;
  };
  panel(formatted("foreshortening: %.1f %% at best", 100 * best.cost.foreshortening), best.map.foreshortening, 1);
  panel(formatted("overlap: %.1f %% at best", 100 * best.cost.overlap), best.map.overlap, 1);
  panel(formatted("cost: foreshortening + %.3g overlap", overlap_weight),
        best.map.foreshortening + weight * best.map.overlap, 1 + weight);
  const auto square = [&](int y_px) { return picture(cv::Rect(kPanelWidth_px, y_px, side_px, side_px)); };
  const auto pose = [&](const ViewAngles& angles) {
    return desiredPose({angles, best.target_model, scene.R_lps_model}, scene.source_isocentre_distance_m);
  };
  drawTree(square(0), tree, segment, pose({0, 0}), "from the front");
  drawTree(square(side_px), tree, segment, pose(best.angles), "best view: " + inWords(best.angles));
  return picture;
}

}  // namespace angio
