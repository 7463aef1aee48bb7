// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rod/rod_energy.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "banded_system.hpp"

namespace angio::rod {
namespace {

using Matrix11 = Eigen::Matrix<double, 11, 11>;  // By point, turn, point, turn, point around an inner point.
using Rows11 = Eigen::Matrix<double, 3, 11>;

constexpr int kTurnBefore = 3, kTurnBehind = 7;

Eigen::Matrix3d crossing(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// The edges beside an inner point, and the turn between them: its curvature binormal is 2 tan(phi / 2) of the turn phi,
// normal to both (Bergou et al. 2008, equation 1).
struct Joint {
  Joint(const RodShape& shape, Eigen::Index i) {
    const Eigen::Vector3d e = shape.edge(i - 1), f = shape.edge(i);
    const Eigen::Vector3d te = e.normalized(), tf = f.normalized();
    const double chi = std::max(1 + te.dot(tf), 1e-9);
    binormal = 2 / chi * te.cross(tf);
    const Eigen::Vector3d t = (te + tf) / chi;
    const Eigen::Matrix3d by_e = (-2 / chi * crossing(tf) - binormal * t.transpose()) / e.norm();
    const Eigen::Matrix3d by_f = (2 / chi * crossing(te) - binormal * t.transpose()) / f.norm();
    J << -by_e, Eigen::Vector3d::Zero(), by_e - by_f, Eigen::Vector3d::Zero(), by_f;
    twist_J << -0.5 / e.norm() * binormal.transpose(), -1, (0.5 / e.norm() - 0.5 / f.norm()) * binormal.transpose(), 1,
        0.5 / f.norm() * binormal.transpose();
    directors[0] = shape.directors.col(i - 1);
    directors[1] = shape.directors.col(i);
    across[0] = te.cross(directors[0]);
    across[1] = tf.cross(directors[1]);
  }

  // Curvature in the material frames' mean: towards the director, and across it (Bergou et al. 2010, equation 2).
  Eigen::Vector2d curvature() const {
    return 0.5 * Eigen::Vector2d((across[0] + across[1]).dot(binormal), -(directors[0] + directors[1]).dot(binormal));
  }

  // Its derivatives. A director that is carried along with its edge moves along the edge only, where the binormal has
  // no part: the binormal's own change is all that counts.
  Eigen::Matrix<double, 2, 11> curvatureJ() const {
    Eigen::Matrix<double, 2, 11> K;
    K.row(0) = 0.5 * (across[0] + across[1]).transpose() * J;
    K.row(1) = -0.5 * (directors[0] + directors[1]).transpose() * J;
    for (int side = 0; side < 2; ++side) {
      K.col(side == 0 ? kTurnBefore : kTurnBehind) =
          -0.5 * Eigen::Vector2d(directors[side].dot(binormal), across[side].dot(binormal));
    }
    return K;
  }

  Eigen::Vector3d binormal;
  Rows11 J;                                 // Of the binormal.
  Eigen::Matrix<double, 1, 11> twist_J;     // Of the twist.
  Eigen::Vector3d directors[2], across[2];  // Material frames of both edges.
};

// Second derivatives of bending by its stiffness over the share, K being curvatureJ() and `natural` the natural turn.
// By places they are Gauss-Newton's, by turns they are exact: without a natural turn bending does not know the frames.
Matrix11 bendingHessian(const Joint& joint, Eigen::Matrix<double, 2, 11> K, const Eigen::Vector2d& natural) {
  // Frames that are twisted against each other see less of the curvature in their mean.
  Eigen::Matrix<double, 1, 11> twist = 0.5 * std::sqrt(std::max(natural.dot(joint.curvature()), 0.0)) * joint.twist_J;
  for (const int turn : {kTurnBefore, kTurnBehind}) {
    K.col(turn).setZero();
    twist[turn] = 0;
  }
  Matrix11 H = K.transpose() * K + twist.transpose() * twist;
  for (int side = 0; side < 2; ++side) {
    const int turn = side == 0 ? kTurnBefore : kTurnBehind;
    const Eigen::Vector3d& m1 = joint.directors[side];
    const Eigen::Vector3d& m2 = joint.across[side];
    const Eigen::Matrix<double, 1, 11> mixed = 0.5 * (natural[0] * m1 + natural[1] * m2).transpose() * joint.J;
    H.row(turn) += mixed;
    H.col(turn) += mixed.transpose();
    H(turn, turn) += 0.5 * (natural[0] * m2 - natural[1] * m1).dot(joint.binormal);
  }
  return H;
}

double bentAndTwisted(const RodShape& shape, const RodBody& body, Eigen::VectorXd* gradient, BandedSystem* hessian) {
  double energy = 0;
  for (Eigen::Index i = 1; i + 1 < shape.size(); ++i) {
    const RodSection& section = body.sections[static_cast<std::size_t>(i)];
    const double share_m = body.share_m(i);
    const Joint joint(shape, i);
    Eigen::Vector2d natural = section.curvature_per_m * share_m;
    if (const double angle = natural.norm(); angle > 0) natural *= 2 * std::tan(0.5 * angle) / angle;
    const double bending = section.bending_n_m2 / share_m, twisting = section.twisting_n_m2 / share_m;
    const double twist = shape.twists[i];
    energy +=
        0.5 * bending * (joint.binormal.squaredNorm() - 2 * joint.curvature().dot(natural) + natural.squaredNorm());
    energy += 0.5 * twisting * twist * twist;
    if (!gradient && !hessian) continue;
    const Eigen::Matrix<double, 2, 11> K = joint.curvatureJ();
    const Eigen::Index at = RodShape::placeOf(i - 1);
    if (gradient) {
      const Eigen::Matrix<double, 1, 11> slope =
          bending * (joint.binormal.transpose() * joint.J - natural.transpose() * K) + twisting * twist * joint.twist_J;
      const Eigen::Index held = std::max<Eigen::Index>(0, -at);
      gradient->segment(at + held, 11 - held) += slope.tail(11 - held).transpose();
    }
    if (!hessian) continue;
    const Matrix11 bent = hessian->softening() == 1 ? bendingHessian(joint, K, natural) : Matrix11(K.transpose() * K);
    hessian->add(at, Matrix11(bending * bent + twisting * joint.twist_J.transpose() * joint.twist_J));
  }
  return energy;
}

double stretched(const RodShape& shape, const RodBody& body, Eigen::VectorXd* gradient, BandedSystem* hessian) {
  double energy = 0;
  for (Eigen::Index j = 1; j + 1 < shape.size(); ++j) {
    const double stiffness = body.sections[static_cast<std::size_t>(j)].stretching_n, rest_m = body.lengths_m[j];
    const Eigen::Vector3d edge = shape.edge(j);
    const double length_m = edge.norm(), strain = length_m / rest_m - 1, tension = stiffness * strain;
    const Eigen::Vector3d along = edge / length_m;
    energy += 0.5 * stiffness * rest_m * strain * strain;
    if (gradient) {
      gradient->segment<3>(RodShape::placeOf(j + 1)) += tension * along;
      if (j > 1) gradient->segment<3>(RodShape::placeOf(j)) -= tension * along;
    }
    if (!hessian) continue;
    const Eigen::Matrix3d axial = along * along.transpose();
    const double across = (tension > 0 ? 1 : hessian->softening()) * tension / length_m;
    const Eigen::Matrix3d block = stiffness / rest_m * axial + across * (Eigen::Matrix3d::Identity() - axial);
    Eigen::Matrix<double, 7, 7> both = Eigen::Matrix<double, 7, 7>::Zero();  // Point, turn, point.
    both.topLeftCorner<3, 3>() = both.bottomRightCorner<3, 3>() = block;
    both.topRightCorner<3, 3>() = both.bottomLeftCorner<3, 3>() = -block;
    hessian->add(RodShape::placeOf(j), both);
  }
  return energy;
}

}  // namespace

double RodBody::share_m(Eigen::Index point) const {
  const double before = point > 1 ? lengths_m[point - 1] : 0.0;
  const double after = point < lengths_m.size() ? lengths_m[point] : 0.0;
  return 0.5 * (before + after);
}

double elasticEnergy(const RodShape& shape, const RodBody& body, Eigen::VectorXd* gradient, BandedSystem* hessian) {
  return bentAndTwisted(shape, body, gradient, hessian) + stretched(shape, body, gradient, hessian);
}

double compression_n(const RodShape& shape, const RodBody& body, Eigen::Index edge) {
  const double strain = shape.edge(edge).norm() / body.lengths_m[edge] - 1;
  return -body.sections[static_cast<std::size_t>(edge)].stretching_n * strain;
}

}  // namespace angio::rod
