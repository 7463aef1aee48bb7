// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/geometry_pictures.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/results/overlay.hpp"

namespace angio::calibration {
namespace {

constexpr int kPrimary = 1, kSecondary = 2, kBeam = 0;  // Vermilion, green, blue.
constexpr int kGood = 0, kHeldOut = 4;                  // Blue, orange.

// A line in the patient frame: its direction and its point nearest to the isocentre [m].
using Line = Eigen::ParametrizedLine<double, 3>;

// The axis that a joint turns about, the other at zero, before the arm bends.
Line axisOf(CArmGeometry carm, int joint) {
  carm.deviations.flex.count = 0;
  CArmJoints low = CArmJoints::Zero(), high = CArmJoints::Zero();
  low[joint] = -degToRad(30);
  high[joint] = degToRad(30);
  const Pose turn = carm.T_camera_patient(high).inverse() * carm.T_camera_patient(low);
  const Eigen::Vector3d rotation = logSO3(turn.linear()), axis = rotation.normalized();
  // Points of the axis stay: (I - R) p = t. Of those, the one nearest to the isocentre.
  const Eigen::Vector3d t = turn.translation() - axis * axis.dot(turn.translation());
  return {0.5 * (t + axis.cross(t) / std::tan(0.5 * rotation.norm())), axis};
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
  int color;
};

constexpr double kReach_mm = 100;  // Of the lines that are drawn, either way.

// Seen along an axis of the patient; `right` and `up` say which axes are where, with their signs.
cv::Mat lookedAt(const std::string& title, const std::vector<NamedLine>& lines, const PlotAxis& x, const PlotAxis& y,
                 const Eigen::Vector3d& right, const Eigen::Vector3d& up) {
  Plot plot{title, x, y};
  plot.equal_scale = true;
  plot.guides = {{0, ""}, {0, "", true}};
  for (const NamedLine& one : lines) {
    const auto seen = [&](const Eigen::Vector3d& p) { return Eigen::Vector2d(right.dot(p), up.dot(p)); };
    const Eigen::Vector2d at = seen(1e3 * one.line.origin()), along = kReach_mm * seen(one.line.direction());
    PlotSeries s{"", {at.x() - along.x(), at.x() + along.x()}, {at.y() - along.y(), at.y() + along.y()}, one.color};
    if (along.norm() < 0.5 * kReach_mm) {  // Comes towards the reader.
      s = {"", {at.x(), at.x()}, {at.y(), at.y()}, one.color, PlotSeries::Kind::kDots};
      s.hollow = {false, true};
      s.radii_px = {4, 9};
    }
    plot.series.push_back(s);
    const int row = static_cast<int>(plot.texts.size());
    plot.texts.push_back({x.range->first, y.range->second, one.name, one.color, {10, 20 + 18 * row}});
  }
  return drawPlots({plot}, 560, 540);
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
  Plot plot{
      formatted("Residual of each view: rms %.2f %s, largest %.2f %s", result.record.residual_rms, unit, largest, unit),
      {"primary, RAO - LAO + [deg]", false, std::pair(-1.12 * primary_deg, 1.12 * primary_deg)},
      {"secondary, CAU - CRA + [deg]", false, std::pair(-1.2 * secondary_deg, 1.2 * secondary_deg)}};
  constexpr auto kDots = PlotSeries::Kind::kDots;
  PlotSeries used{"used", {}, {}, kGood, kDots}, held_out{"held out", {}, {}, kHeldOut, kDots},
      left_out{"left out", {}, {}, kWarningColor, kDots};
  constexpr double kMaxRadius_px = 17;
  for (const GeometryViewFit& view : result.views) {
    const double x = radToDeg(view.joints[0]), y = radToDeg(view.joints[1]);
    const double radius_px = std::max(2.0, kMaxRadius_px * std::min(1.5, view.residual / largest));
    PlotSeries& s = view.left_out ? left_out : view.held_out ? held_out : used;
    for (const double r : {radius_px, 2.0}) {
      s.x.push_back(x);
      s.y.push_back(y);
      s.radii_px.push_back(r);
      s.hollow.push_back(r == radius_px);
    }
    if (view.left_out) plot.texts.push_back({x, y, view.name, kWarningColor, {static_cast<int>(radius_px) + 4, 4}});
  }
  plot.series = {used, held_out, left_out};
  return drawPlots({plot}, 720, 540);
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
  const auto axis = [&](const char* label) { return PlotAxis{label, false, std::pair(-reach_mm, reach_mm)}; };
  const Eigen::Vector3d L = Eigen::Vector3d::UnitX(), P = Eigen::Vector3d::UnitY(), S = Eigen::Vector3d::UnitZ();
  return sideBySide(
      {lookedAt("From the feet", lines, axis("patient's left [mm]"), axis("up (anterior) [mm]"), L, -P),
       lookedAt("From the patient's left", lines, axis("towards the head [mm]"), axis("up (anterior) [mm]"), S, -P)});
}

cv::Mat flexCurves(const GeometryCalibration& result) {
  const CArmFlex& flex = result.carm.deviations.flex;
  static const char* const kNames[6] = {"right",       "down",       "along the beam",
                                        "about right", "about down", "about the beam"};
  std::vector<cv::Mat> columns;
  for (const int joint : {0, 1}) {
    double low_deg = 0, high_deg = 0;
    for (const GeometryViewFit& view : result.views) {
      low_deg = std::min(low_deg, radToDeg(view.joints[joint]));
      high_deg = std::max(high_deg, radToDeg(view.joints[joint]));
    }
    const char* const angle = joint == 0 ? "primary [deg], secondary 0" : "secondary [deg], primary 0";
    std::vector<Plot> plots{{"Camera shifted by bending", {angle}, {"mm"}},
                            {"Camera turned by bending", {angle}, {"deg"}}};
    for (int k = 0; k < 6; ++k) {
      PlotSeries series{kNames[k], {}, {}, k % 3};
      constexpr int kSteps = 60;
      for (int i = 0; i <= kSteps; ++i) {
        const double angle_deg = low_deg + (high_deg - low_deg) * i / kSteps, angle_rad = degToRad(angle_deg);
        series.x.push_back(angle_deg);
        const Twist twist = joint == 0 ? flex.at(angle_rad, 0) : flex.at(0, angle_rad);
        series.y.push_back((k < 3 ? 1e3 : radToDeg(1)) * twist[k]);
      }
      plots[k < 3 ? 0 : 1].series.push_back(series);
    }
    columns.push_back(drawPlots(plots, 720, 270));
  }
  return sideBySide(columns);
}

}  // namespace angio::calibration
