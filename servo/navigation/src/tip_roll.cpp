// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/tip_roll.hpp"

#include <algorithm>
#include <cmath>

namespace angio::navigation {
namespace {

constexpr double kShaft = 0.3;            // Usual slope of the shaft behind the tip, per axis.
constexpr double kShaftLength_m = 10e-3;  // Over this length it becomes another ...
constexpr double kShaftByRoll = 0.1;      // ... and by so much over a radian of roll: a shaft gives way to its tip.
constexpr double kTurnLength_m = 0.1;     // Over this length the tip turns by about a radian without a command.
constexpr double kTurnByRoll = 0.15;      // Share of a roll that does not come through, or comes through later.
constexpr double kLooseRoll_rad = 1.5;    // A loose tip points elsewhere after so much roll of its drive ...
constexpr double kLooseLength_m = 20e-3;  // ... or when it has slid so far.
constexpr double kEnteredSigma = 0.7;     // In parts of the usual deflection: a fork takes tips from a wide cone.

constexpr double kMinForeshortening = 0.4;  // Of the vessel's image; below, its direction in the image is mostly noise.
constexpr double kMinLength_px = 8;
constexpr double kModel_m = 0.4e-3;  // Of the centreline against the catheter's line, besides the curve's own noise.

// The point `back_px` before a curve's last one, along it; nothing when it is shorter.
std::optional<Eigen::Vector2d> beforeEnd(const Eigen::Matrix2Xd& line, double back_px) {
  double left = back_px;
  for (Eigen::Index i = line.cols() - 1; i > 0; --i) {
    const Eigen::Vector2d step = line.col(i - 1) - line.col(i);
    const double length = step.norm();
    if (length >= left && length > 0) return Eigen::Vector2d(line.col(i) + left / length * step);
    left -= length;
  }
  return std::nullopt;
}

}  // namespace

TipRoll::TipRoll(double deflection, double dead_band_rad)
    : deflection_(deflection), half_band_rad_(0.5 * dead_band_rad) {
  const double bent = deflection * deflection, shaft = kShaft * kShaft;
  P_ = Eigen::Vector4d(bent, bent, shaft, shaft).asDiagonal();
}

Eigen::Matrix2d TipRoll::turn() const {
  const double c = std::cos(roll_rad_), s = std::sin(roll_rad_);
  return (Eigen::Matrix2d() << c, -s, s, c).finished();
}

void TipRoll::move(double roll_rad, double slid_m) {
  const double before = roll_rad_;
  roll_rad_ = moved_ ? std::clamp(roll_rad_, roll_rad - half_band_rad_, roll_rad + half_band_rad_) : roll_rad;
  const double rolled = moved_ ? std::abs(roll_rad_ - before) : 0.0;
  moved_ = true;
  const double slid = std::abs(slid_m);
  // Turning is noise across x, in proportion to its length; how far the tip is deflected changes with the lumen.
  const double turned_variance = slid / kTurnLength_m + kTurnByRoll * kTurnByRoll * std::min(rolled, 1.0);
  const double variance =
      std::min(turned_variance, 1.0) * std::max(state_.head<2>().squaredNorm(), 0.01 * deflection_ * deflection_);
  P_(0, 0) += variance;
  P_(1, 1) += variance;
  const double keep = std::exp(-slid / kShaftLength_m);
  state_.tail<2>() *= keep;
  P_.bottomRows<2>() *= keep;
  P_.rightCols<2>() *= keep;
  P_.diagonal().tail<2>().array() += (1 - keep * keep) * kShaft * kShaft + kShaftByRoll * kShaftByRoll * rolled;
  // Nothing is less known than what is not known at all.
  for (int i = 0; i < 2; ++i) {
    const double shrink = std::sqrt(std::min(1.0, deflection_ * deflection_ / P_(i, i)));
    P_.row(i) *= shrink;
    P_.col(i) *= shrink;
  }
}

void TipRoll::moveLoosely(double roll_rad, double slid_m) {
  const double before = roll_rad_;
  move(roll_rad, slid_m);
  // Back by what move() took the tip to have turned with its drive.
  const double turned = roll_rad_ - before, c = std::cos(turned), s = std::sin(turned);
  const double keep = std::exp(-std::abs(turned) / kLooseRoll_rad - std::abs(slid_m) / kLooseLength_m);
  Eigen::Matrix4d kept = Eigen::Matrix4d::Identity();
  kept.topLeftCorner<2, 2>() << keep * c, keep * s, -keep * s, keep * c;
  state_ = kept * state_;
  P_ = kept * P_ * kept.transpose();
  P_.diagonal().head<2>().array() += (1 - keep * keep) * deflection_ * deflection_;
}

void TipRoll::bend(double deflection) {
  // A tip that bends less falls back in proportion. One that bends more goes on in its direction as far as the wall
  // lets it, which its bend does not tell: its angle stays as sure as it was, its length becomes less sure.
  const double ratio = deflection / deflection_;
  P_.topRows<2>() *= ratio;
  P_.leftCols<2>() *= ratio;
  Eigen::Ref<Eigen::Vector2d> x = state_.head<2>();
  if (ratio < 1) {
    x *= ratio;
  } else {
    const double before = deflection_ * deflection_, gained = deflection * deflection - before;
    P_.topLeftCorner<2, 2>() += gained / std::max(x.squaredNorm(), before) * x * x.transpose();
  }
  deflection_ = deflection;
}

void TipRoll::see(const TipDeflection& deflection) {
  Eigen::Vector4d h;
  h << turn().transpose() * deflection.observable_axis, deflection.observable_axis;
  const double innovation = deflection.slope - h.dot(state_);
  double variance = h.dot(P_ * h) + deflection.sigma * deflection.sigma;
  // A far value is worth less: as if its own variance were what brings it to three standard deviations.
  variance = std::max(variance, innovation * innovation / 9);
  const Eigen::Vector4d gain = P_ * h / variance;
  state_ += gain * innovation;
  P_ -= gain * (P_ * h).transpose();
  P_ = (0.5 * (P_ + P_.transpose())).eval();
}

void TipRoll::entered(const Eigen::Vector2d& direction) {
  if (!(direction.norm() > 0)) return;
  const Eigen::Vector2d seen = deflection_ * direction.normalized();
  Eigen::Matrix<double, 2, 4> H = Eigen::Matrix<double, 2, 4>::Zero();
  H.leftCols<2>() = turn();
  const double sigma = kEnteredSigma * deflection_;
  const Eigen::Matrix2d S = H * P_ * H.transpose() + sigma * sigma * Eigen::Matrix2d::Identity();
  const Eigen::Matrix<double, 4, 2> gain = P_ * H.transpose() * S.inverse();
  state_ += gain * (seen - H * state_);
  P_ -= gain * H * P_;
  P_ = (0.5 * (P_ + P_.transpose())).eval();
}

Eigen::Matrix2d TipRoll::headingCovariance() const {
  Eigen::Matrix<double, 2, 4> H;
  H << turn(), Eigen::Matrix2d::Identity();
  return H * P_ * H.transpose();
}

double TipRoll::angle_rad() const {
  const Eigen::Vector2d x = deflection();
  return std::atan2(x.y(), x.x());
}

double TipRoll::std_rad() const {
  const double length = state_.head<2>().norm(), unknown = 3.14159265358979 / std::sqrt(3.0);
  if (!(length > 0)) return unknown;
  const Eigen::Vector2d sideways(-state_[1] / length, state_[0] / length);
  const double across = std::sqrt(std::max(sideways.dot(P_.topLeftCorner<2, 2>() * sideways), 0.0));
  return std::min(std::atan2(across, length) * 2 / std::sqrt(3.0), unknown);
}

std::optional<TipDeflection> seenDeflection(const SeenCatheter& seen, const XrayCamera& camera,
                                            const Pose& T_camera_model, const TreeTopology& map,
                                            const TreeLocation& tip, double tip_length_m) {
  if (seen.tip_end != TipEnd::kLast || seen.points_px.cols() < 2 || !seen.points_px.allFinite()) return std::nullopt;
  const Eigen::Vector3d p = map.point(tip), knuckle = map.point(map.before(tip, tip_length_m));
  const Eigen::Vector3d p_camera = T_camera_model * p;
  const auto end_px = camera.project(p_camera), start_px = camera.project(T_camera_model * knuckle);
  if (!end_px || !start_px) return std::nullopt;
  const Eigen::Vector2d path = *end_px - *start_px;
  const double length_px = path.norm(), px_per_m = camera.parameters().fx_px / p_camera.z();
  if (length_px < kMinLength_px || length_px < kMinForeshortening * px_per_m * (p - knuckle).norm()) {
    return std::nullopt;
  }
  const auto back = beforeEnd(seen.points_px, length_px);
  if (!back) return std::nullopt;
  const Eigen::Vector2d chord = seen.points_px.rightCols<1>() - *back;
  const Eigen::Vector2d normal(-path.y() / length_px, path.x() / length_px);
  const TreeFrame frame = map.frame(tip);
  const Eigen::Vector3d sideways = T_camera_model.linear().transpose() * Eigen::Vector3d(normal.x(), normal.y(), 0);
  TipDeflection result;
  result.slope = normal.dot(chord) / px_per_m / tip_length_m;
  result.sigma = std::hypot(std::sqrt(2.0) * seen.std_px / px_per_m, kModel_m) / tip_length_m;
  result.offset_m = normal.dot(seen.points_px.rightCols<1>() - *end_px) / px_per_m;
  result.offset_std_m = std::hypot(seen.std_px / px_per_m, kModel_m);
  result.observable_axis = {sideways.dot(frame.normal), sideways.dot(frame.binormal)};
  return result;
}

}  // namespace angio::navigation
