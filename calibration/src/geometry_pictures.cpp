// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/geometry_pictures.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/plot.hpp"
#include "chart.hpp"

namespace angio {
namespace {

const cv::Scalar kPrimary(0, 94, 213), kSecondary(115, 158, 0), kBeam(178, 114, 0);  // Vermilion, green, blue.

// A line in the patient frame: its direction and its point nearest to the isocentre [m].
using Line = Eigen::ParametrizedLine<double, 3>;

// The axis that a joint turns about, the other at zero, before the arm bends.
Line axisOf(CArmGeometry carm, int joint) {
  carm.deviations.flex.count = 0;
  CArmJoints low = CArmJoints::Zero(), high = CArmJoints::Zero();
  low[joint] = -degToRad(30);
  high[joint] = degToRad(30);
  const Pose turn = carm.T_camera_patient(high).inverse() * carm.T_camera_patient(low);
  const Eigen::Vector3d axis = logSO3(turn.linear()).normalized();
  // Points of the axis stay: (I - R) p = t, of least length.
  const Eigen::Matrix3d moved = Eigen::Matrix3d::Identity() - turn.linear();
  return {moved.completeOrthogonalDecomposition().solve(turn.translation()), axis};
}

Line beamOf(CArmGeometry carm) {
  carm.deviations.flex.count = 0;
  const Pose T_patient_camera = carm.T_camera_patient(CArmJoints::Zero()).inverse();
  const Eigen::Vector3d direction = T_patient_camera.linear().col(2), source = T_patient_camera.translation();
  return {source - direction * direction.dot(source), direction};
}

struct NamedLine {
  std::string name;
  Line line;
  cv::Scalar colour;
};

// Seen along an axis of the patient; `right` and `up` say which axes are where, with their signs.
cv::Mat lookedAt(const std::string& title, const std::vector<NamedLine>& lines, const Chart::Axis& x,
                 const Chart::Axis& y, const Eigen::Vector3d& right, const Eigen::Vector3d& up) {
  Chart chart = Chart::ofEqualScale(title, x, y, {560, 540});
  const auto seen = [&](const Eigen::Vector3d& p_mm) { return Eigen::Vector2d(right.dot(p_mm), up.dot(p_mm)); };
  chart.line({-1e3, 0}, {1e3, 0}, cv::Scalar::all(170), 1);
  chart.line({0, -1e3}, {0, 1e3}, cv::Scalar::all(170), 1);
  double row = 0;
  for (const NamedLine& one : lines) {
    const Eigen::Vector3d at_mm = 1e3 * one.line.origin();
    const Eigen::Vector2d along = seen(one.line.direction());
    if (along.norm() < 0.5) {
      // Comes towards the reader.
      chart.disc(seen(at_mm), 4, one.colour);
      chart.ring(seen(at_mm), 9, one.colour);
    } else {
      chart.line(seen(at_mm) - 100 * along, seen(at_mm) + 100 * along, one.colour);
    }
    chart.text(one.name, {x.low, y.high}, one.colour, {10, static_cast<int>(20 + 18 * row++)});
  }
  return chart.picture();
}

}  // namespace

cv::Mat residualsByAngle(const GeometryCalibration& result) {
  double primary_deg = 10, secondary_deg = 10, largest = 1e-9;
  for (const GeometryViewFit& view : result.views) {
    primary_deg = std::max(primary_deg, radToDeg(std::abs(view.joints[0])));
    secondary_deg = std::max(secondary_deg, radToDeg(std::abs(view.joints[1])));
    if (!view.left_out) largest = std::max(largest, view.residual);
  }
  const char* unit = result.record.residual_unit.c_str();
  Chart chart(
      formatted("Residual of each view: rms %.2f %s, largest %.2f %s", result.record.residual_rms, unit, largest, unit),
      {"primary, RAO - LAO + [deg]", -1.12 * primary_deg, 1.12 * primary_deg},
      {"secondary, CAU - CRA + [deg]", -1.35 * secondary_deg, 1.2 * secondary_deg});
  constexpr double kLargest_px = 17;
  for (const GeometryViewFit& view : result.views) {
    const Eigen::Vector2d place = radToDeg(1) * view.joints.head<2>();
    const double radius_px = std::max(2.0, kLargest_px * std::min(1.5, view.residual / largest));
    if (view.left_out) {
      chart.ring(place, radius_px, kChartLeftOut, 3);
      chart.text(view.name, place, kChartLeftOut, {static_cast<int>(radius_px) + 4, 4});
    } else {
      chart.ring(place, radius_px, view.held_out ? kChartHeldOut : kChartGood);
      chart.disc(place, 2, view.held_out ? kChartHeldOut : kChartGood);
    }
  }
  const double y = -1.28 * secondary_deg;
  chart.disc({-1.05 * primary_deg, y}, 5, kChartGood);
  chart.text("used", {-1.05 * primary_deg, y}, kChartInk, {10, 4});
  chart.disc({-0.45 * primary_deg, y}, 5, kChartHeldOut);
  chart.text("held out", {-0.45 * primary_deg, y}, kChartInk, {10, 4});
  chart.disc({0.25 * primary_deg, y}, 5, kChartLeftOut);
  chart.text("left out", {0.25 * primary_deg, y}, kChartInk, {10, 4});
  return chart.picture();
}

cv::Mat axesSketch(const GeometryCalibration& result) {
  const CArmDeviations& d = result.carm.deviations;
  const std::vector<NamedLine> lines = {
      {"primary axis", axisOf(result.carm, 0), kPrimary},
      {formatted("secondary axis: gap %.2f mm, skew %.2f deg", 1e3 * d.axis_gap_m, radToDeg(d.axis_skew_rad)),
       axisOf(result.carm, 1), kSecondary},
      {formatted("beam at zero: source %.2f mm right, %.2f mm down", 1e3 * d.source_right_m, 1e3 * d.source_down_m),
       beamOf(result.carm), kBeam}};
  double reach_mm = 2;
  for (const NamedLine& one : lines) reach_mm = std::max(reach_mm, 1.6e3 * one.line.origin().norm());
  const auto axis = [&](const char* label) { return Chart::Axis{label, -reach_mm, reach_mm}; };
  const Eigen::Vector3d L = Eigen::Vector3d::UnitX(), P = Eigen::Vector3d::UnitY(), S = Eigen::Vector3d::UnitZ();
  cv::Mat both;
  cv::hconcat(
      lookedAt("From the feet", lines, axis("patient's left [mm]"), axis("up (anterior) [mm]"), L, -P),
      lookedAt("From the patient's left", lines, axis("towards the head [mm]"), axis("up (anterior) [mm]"), S, -P),
      both);
  return both;
}

cv::Mat flexCurves(const GeometryCalibration& result) {
  const CArmFlex& flex = result.carm.deviations.flex;
  static const char* const kNames[6] = {"right",       "down",       "along the beam",
                                        "about right", "about down", "about the beam"};
  std::vector<cv::Mat> columns;
  for (const int joint : {0, 1}) {
    std::vector<Panel> panels;
    double low_deg = 0, high_deg = 0;
    for (const GeometryViewFit& view : result.views) {
      low_deg = std::min(low_deg, radToDeg(view.joints[joint]));
      high_deg = std::max(high_deg, radToDeg(view.joints[joint]));
    }
    for (const int first : {0, 3}) {
      Panel panel;
      panel.title = std::string(first == 0 ? "Camera shifted by bending [mm]" : "Camera turned by bending [deg]");
      panel.x_label = joint == 0 ? "primary [deg], secondary 0" : "secondary [deg], primary 0";
      panel.y_label = first == 0 ? "mm" : "deg";
      for (int k = first; k < first + 3; ++k) {
        Series series{kNames[k], {}, {}, plotColour(k - first)};
        constexpr int kSteps = 60;
        for (int i = 0; i <= kSteps; ++i) {
          const double angle_deg = low_deg + (high_deg - low_deg) * i / kSteps, angle_rad = degToRad(angle_deg);
          series.x.push_back(angle_deg);
          const Twist twist = joint == 0 ? flex.at(angle_rad, 0) : flex.at(0, angle_rad);
          series.y.push_back((first == 0 ? 1e3 : radToDeg(1)) * twist[k]);
        }
        panel.series.push_back(series);
      }
      panels.push_back(panel);
    }
    columns.push_back(drawPlot(panels, 720, 270));
  }
  cv::Mat both;
  cv::hconcat(columns, both);
  return both;
}

}  // namespace angio
