// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/distortion.hpp"

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "angio/base/errors.hpp"

namespace angio::geometry {
namespace {

Eigen::Vector2d perpendicular(const Eigen::Vector2d& v) { return {-v.y(), v.x()}; }

// The radius at which r (1 + k1 r^2 + k2 r^4) stops rising; infinity if never.
double foldRadius(const RadialBend& bend) {
  // Zeros of 1 + 3 k1 x + 5 k2 x^2 with x = r^2, in the form that does not cancel: x = 2 / (-3 k1 +- root).
  const double discriminant = 9 * bend.k1 * bend.k1 - 20 * bend.k2;
  double fold = std::numeric_limits<double>::infinity();
  if (discriminant < 0) return fold;
  for (const double root : {std::sqrt(discriminant), -std::sqrt(discriminant)}) {
    const double denominator = -3 * bend.k1 + root;
    if (denominator > 0) fold = std::min(fold, std::sqrt(2 / denominator));
  }
  return fold;
}

double bentRadius(const RadialBend& bend, double r) {
  const double r2 = r * r;
  return r * (1 + r2 * (bend.k1 + bend.k2 * r2));
}

// The r below the fold with bentRadius(r) = wanted: Newton, within bounds.
std::optional<double> unbentRadius(const RadialBend& bend, double wanted) {
  const double fold = foldRadius(bend);
  double low = 0, high = std::min(fold, 2 * wanted);
  while (bentRadius(bend, high) < wanted) {
    if (high >= fold || !(high < 1e6)) return std::nullopt;
    low = high;
    high = std::min(fold, 2 * high);
  }
  double r = std::min(std::max(wanted, low), high);
  for (int i = 0; i < 60; ++i) {
    const double error = bentRadius(bend, r) - wanted;
    (error > 0 ? high : low) = r;
    const double r2 = r * r, slope = 1 + r2 * (3 * bend.k1 + 5 * bend.k2 * r2);
    double next = r - error / slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double step = std::abs(next - r);
    r = next;
    if (step <= 1e-15 * wanted) break;
  }
  return r;
}

constexpr int kGridSteps = 16;  // Along each side of a detector whose polynomial is checked.
constexpr double kSolved_px = 1e-9;

// Newton's method, with shorter steps where a full one leads away; nothing where it does not end.
std::optional<Eigen::Vector2d> solvedPinhole(const DetectorDistortion& distortion, const Eigen::Vector2d& image_px) {
  Eigen::Vector2d at = image_px;
  Eigen::Matrix2d J;
  Eigen::Vector2d error = distortion.distorted(at, &J) - image_px;
  for (int i = 0; i < 60 && error.norm() > kSolved_px; ++i) {
    if (!(J.determinant() > 0)) return std::nullopt;
    const Eigen::Vector2d step = J.inverse() * error;
    double share = 1;
    for (; share > 1e-3; share *= 0.5) {
      Eigen::Matrix2d J_next;
      const Eigen::Vector2d next = at - share * step, error_next = distortion.distorted(next, &J_next) - image_px;
      if (!(error_next.norm() < error.norm())) continue;
      at = next;
      error = error_next;
      J = J_next;
      break;
    }
    if (!(share > 1e-3)) break;
  }
  if (!(error.norm() <= 1e3 * kSolved_px) || !(J.determinant() > 0)) return std::nullopt;
  return at;
}

}  // namespace

Eigen::Vector2d RadialBend::bent(const Eigen::Vector2d& p, Eigen::Matrix2d* J_point,
                                 Eigen::Matrix<double, 2, 4>* J_bend) const {
  const double r2 = p.squaredNorm(), r4 = r2 * r2;
  const double out = 1 + k1 * r2 + k2 * r4, turn = s1_rad * r2 + s2_rad * r4;
  const double c = std::cos(turn), s = std::sin(turn);
  const Eigen::Vector2d turned(c * p.x() - s * p.y(), s * p.x() + c * p.y());
  if (J_point) {
    const Eigen::Vector2d by_r2 =
        (k1 + 2 * k2 * r2) * turned + out * (s1_rad + 2 * s2_rad * r2) * perpendicular(turned);
    *J_point << out * c, -out * s, out * s, out * c;
    *J_point += 2 * by_r2 * p.transpose();
  }
  if (J_bend) {
    J_bend->col(0) = r2 * turned;
    J_bend->col(1) = r4 * turned;
    J_bend->col(2) = out * r2 * perpendicular(turned);
    J_bend->col(3) = out * r4 * perpendicular(turned);
  }
  return out * turned;
}

std::optional<Eigen::Vector2d> RadialBend::unbent(const Eigen::Vector2d& q) const {
  const double wanted = q.norm();
  if (wanted == 0) return q;
  const auto r = unbentRadius(*this, wanted);
  if (!r) return std::nullopt;
  const double r2 = *r * *r, turn = -r2 * (s1_rad + s2_rad * r2);
  const double c = std::cos(turn), s = std::sin(turn);
  return Eigen::Vector2d(c * q.x() - s * q.y(), s * q.x() + c * q.y()) * (*r / wanted);
}

DetectorDistortion DetectorDistortion::radial(const XrayCamera& camera, double k1, double k2, double skew_px) {
  const auto& p = camera.parameters();
  return {Model::kRadial, {p.cx_px, p.cy_px}, {p.fx_px, p.fy_px}, {k1, k2, 0, 0}, skew_px, {}};
}

DetectorDistortion DetectorDistortion::intensifier(const XrayCamera& camera, const RadialBend& bend) {
  const Eigen::Vector2d center_px(0.5 * (camera.width_px() - 1), 0.5 * (camera.height_px() - 1));
  return {Model::kIntensifier, center_px, Eigen::Vector2d::Constant(0.5 * camera.width_px()), bend, 0, {}};
}

DetectorDistortion DetectorDistortion::polynomial(const Eigen::Vector2d& center_px, double unit_px,
                                                  const DisplacementPolynomial& shift) {
  return {Model::kPolynomial, center_px, Eigen::Vector2d::Constant(unit_px), {}, 0, shift};
}

void DetectorDistortion::check(const std::string& place, int width_px, int height_px) const {
  requireFinite(place, "k1", bend.k1);
  requireFinite(place, "k2", bend.k2);
  requireFinite(place, "s1_rad", bend.s1_rad);
  requireFinite(place, "s2_rad", bend.s2_rad);
  requireFinite(place, "skew_px", skew_px);
  for (int i = 0; i < 2; ++i) {
    requireFinite(place, "centre_px", center_px[i]);
    requirePositive(place, "unit_px", unit_px[i]);
  }
  const bool polynomial = model == Model::kPolynomial;
  if (polynomial) shift.check(place);
  const int steps = polynomial ? kGridSteps : 1;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      const Eigen::Vector2d at(-0.5 + static_cast<double>(i * width_px) / steps,
                               -0.5 + static_cast<double>(j * height_px) / steps);
      if (undistorted(at)) continue;
      throw InputError(
          place, "distortion",
          polynomial ? "order " + std::to_string(shift.order) : formatValue(bend.k1) + ", " + formatValue(bend.k2),
          "must be one-to-one out to the detector's corners");
    }
  }
}

Eigen::Vector2d DetectorDistortion::distorted(const Eigen::Vector2d& pinhole_px, Eigen::Matrix2d* J) const {
  const Eigen::Vector2d p = (pinhole_px - center_px).cwiseQuotient(unit_px);
  if (model == Model::kPolynomial) {
    const Eigen::Vector2d moved_px = pinhole_px + shift.at(p, J);
    if (J) *J = Eigen::Matrix2d::Identity() + *J * unit_px.cwiseInverse().asDiagonal();
    return moved_px;
  }
  const Eigen::Vector2d q = bend.bent(p, J);
  Eigen::Matrix2d A;
  A << unit_px.x(), skew_px, 0, unit_px.y();
  if (J) *J = A * *J * unit_px.cwiseInverse().asDiagonal();
  return center_px + A * q;
}

std::optional<Eigen::Vector2d> DetectorDistortion::undistorted(const Eigen::Vector2d& image_px,
                                                               Eigen::Matrix2d* J) const {
  std::optional<Eigen::Vector2d> pinhole_px;
  if (model == Model::kPolynomial) {
    pinhole_px = solvedPinhole(*this, image_px);
  } else {
    const Eigen::Vector2d offset = image_px - center_px;
    const double y = offset.y() / unit_px.y();
    const auto p = bend.unbent({(offset.x() - skew_px * y) / unit_px.x(), y});
    if (p) pinhole_px = center_px + p->cwiseProduct(unit_px);
  }
  if (pinhole_px && J) {
    Eigen::Matrix2d forward;
    distorted(*pinhole_px, &forward);
    *J = forward.inverse();
  }
  return pinhole_px;
}

}  // namespace angio::geometry
