// SPDX-License-Identifier: GPL-2.0-or-later
#include "trial_deformation.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "simulation_image.hpp"

namespace angio::evaluation {
namespace {

// Of the measured points as many decide about a place, by a plane through their displacements.
constexpr int kNeighbors = 40;

using PointFunction = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

double extentOf(const Eigen::Matrix3Xd& points) {
  return (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).maxCoeff();
}

// Four plane waves, of wavelengths of 1 to 3 times the tree's extent.
PointFunction waves(const VesselTree& tree, const SimulationSettings& s, SimulationRandom random) {
  struct Wave {
    Eigen::Vector3d wave_vector, amplitude;
    double phase = 0;
  };
  const Eigen::Matrix3d R = lpsOf(s.model_axes);
  const Eigen::Vector3d by_axis(1, 1, s.deformation_anisotropy);
  const double extent_m = extentOf(tree.points());
  std::vector<Wave> all;
  for (int k = 0; k < 4; ++k) {
    Wave wave;
    const double wavelength_m = extent_m * random.uniform(1, 3);
    wave.wave_vector = 2 * kPi / wavelength_m * random.direction<3>();
    wave.amplitude = R.transpose() * by_axis.asDiagonal() * R * random.normals<3>();
    wave.phase = random.uniform(0, 2 * kPi);
    all.push_back(wave);
  }
  return [all](const Eigen::Vector3d& p) {
    Eigen::Vector3d d = Eigen::Vector3d::Zero();
    for (const Wave& wave : all) d += wave.amplitude * std::sin(wave.wave_vector.dot(p) + wave.phase);
    return d;
  };
}

// A uniform rotation (Shoemake 1992).
Eigen::Matrix3d randomRotation(SimulationRandom& random) {
  const double u = random.uniform(), a = 2 * kPi * random.uniform(), b = 2 * kPi * random.uniform();
  const double r = std::sqrt(1 - u), q = std::sqrt(u);
  return Eigen::Quaterniond(q * std::cos(b), r * std::sin(a), r * std::cos(a), q * std::sin(b)).toRotationMatrix();
}

// A displacement at a place: of the plane that fits those of its nearest neighbours best, the nearer the more.
PointFunction carriedOver(const MeasuredMotion& motion, const VesselTree& tree, SimulationRandom random) {
  const Eigen::Matrix3d R = randomRotation(random);
  const double scale = extentOf(tree.points()) / std::max(1e-6, extentOf(motion.points));
  const Eigen::Vector3d middle = motion.points.rowwise().mean();
  const Eigen::Matrix3Xd points = scale * R * (motion.points.colwise() - middle), moved = R * motion.displacements_m;
  return [points, moved](const Eigen::Vector3d& p) -> Eigen::Vector3d {
    std::vector<std::pair<double, Eigen::Index>> near;
    for (Eigen::Index i = 0; i < points.cols(); ++i) near.emplace_back((points.col(i) - p).squaredNorm(), i);
    const auto count = std::min<std::ptrdiff_t>(kNeighbors, static_cast<std::ptrdiff_t>(near.size()));
    std::nth_element(near.begin(), near.begin() + (count - 1), near.end());
    const double reach2 = near[count - 1].first;
    Eigen::Matrix4d normal = 1e-6 * Eigen::Matrix4d::Identity();
    Eigen::Matrix<double, 4, 3> right = Eigen::Matrix<double, 4, 3>::Zero();
    const double unit_m = std::sqrt(std::max(reach2, 1e-12));
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      const auto [squared, i] = near[k];
      const double weight = std::exp(-2 * squared / std::max(reach2, 1e-12));
      Eigen::Vector4d basis;
      basis << 1, (points.col(i) - p) / unit_m;
      normal += weight * basis * basis.transpose();
      right += weight * basis * moved.col(i).transpose();
    }
    return normal.ldlt().solve(right).row(0).transpose();
  };
}

// The best small rigid motion [v; w] through the displacements, about the centroid.
Twist rigidPartOf(const Eigen::Matrix3Xd& displacements, const Eigen::Matrix3Xd& centered) {
  Matrix6d normal = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  Eigen::Matrix<double, 3, 6> J;
  J.leftCols<3>().setIdentity();
  for (Eigen::Index i = 0; i < centered.cols(); ++i) {
    J.rightCols<3>() = -skew(centered.col(i));
    normal += J.transpose() * J;
    right += J.transpose() * displacements.col(i);
  }
  return normal.completeOrthogonalDecomposition().solve(right);  // A straight vessel has no roll.
}

}  // namespace

TrialDeformation::TrialDeformation(const VesselTree& tree, const SimulationSettings& settings, int trial,
                                   const MeasuredMotion* measured)
    : centroid_(tree.centroid()) {
  const SimulationRandom random(settings.seed, trial, DrawFor::kDeformation);
  raw_ = measured ? carriedOver(*measured, tree, random) : waves(tree, settings, random);
  const Eigen::Matrix3Xd& p = tree.points();
  rigid_ = rigidPartOf(at(p), p.colwise() - centroid_);
  const double rms = std::sqrt(at(p).squaredNorm() / static_cast<double>(p.cols()));
  scale_ = 1e-3 * settings.deformation_rms_mm / std::max(rms, 1e-12);
}

Eigen::Matrix3Xd TrialDeformation::at(const Eigen::Matrix3Xd& points) const {
  Eigen::Matrix3Xd d(3, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d centered = points.col(i) - centroid_;
    d.col(i) = scale_ * (raw_(centered) - rigid_.head<3>() - rigid_.tail<3>().cross(centered));
  }
  return d;
}

}  // namespace angio::evaluation
