// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_step.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/decompositions.hpp"

namespace angio::registration {
namespace {

// Least share of a kernel's own curvature that a point holds along a line. With none, the first steps slide.
constexpr double kMinStiffness = 0.1;

// |A| of a symmetric 2 x 2 matrix, its eigenvalues brought into [low, high].
Eigen::Matrix2d clampedAbsolute(const Eigen::Matrix2d& A, double low, double high) {
  const double mean = 0.5 * (A(0, 0) + A(1, 1)), half = 0.5 * (A(0, 0) - A(1, 1));
  const double radius = std::hypot(half, A(0, 1));
  const double a = std::clamp(std::abs(mean + radius), low, high), b = std::clamp(std::abs(mean - radius), low, high);
  // f(A) is linear in A for two eigenvalues: the mean of f and, along A's deviator, half of their difference.
  const double slope = radius > 0 ? 0.5 * (a - b) / radius : 0.0;
  Eigen::Matrix2d result;
  result << half, A(0, 1), A(0, 1), -half;
  return slope * result + 0.5 * (a + b) * Eigen::Matrix2d::Identity();
}

// Calls visit(weight, point, pixel, Jacobian of the pixel) for each point that the view sees.
template <typename Visit>
void eachSeen(const WeightedPoints& points, const XrayView& view, const Pose& T_view_centered, const Visit& visit) {
  Eigen::Matrix<double, 2, 3> J;
  for (Eigen::Index i = 0; i < points.centered.cols(); ++i) {
    const Eigen::Vector3d p = points.centered.col(i);
    const auto pixel = view.camera.project(T_view_centered * p, &J);
    if (pixel && view.sees(*pixel)) visit(points.weight[i], p, *pixel, J);
  }
}

double weightedValues(const WeightedPoints& points, const XrayView& view, const RidgeImage& image,
                      const Pose& T_view_centered) {
  double sum = 0;
  eachSeen(points, view, T_view_centered,
           [&](double weight, const auto&, const auto& pixel, const auto&) { sum += weight * image.valueAt(pixel); });
  return sum;
}

double twiceVariance(const RidgeImage& image) { return 2 * image.scale_px() * image.scale_px(); }

}  // namespace

WeightedPoints weightedPoints(const VesselTree& tree) {
  WeightedPoints points{tree.points().colwise() - tree.centroid(), Eigen::ArrayXd::Ones(tree.size())};
  for (int i = 0; i < tree.size(); ++i) {
    if (const auto radius_m = tree.radii()[i]) points.weight[i] = 2 / (1 + std::exp(-2 * 1e3 * *radius_m));
  }
  points.weight /= points.weight.mean();
  return points;
}

double ridgeMetric(const WeightedPoints& points, const XrayViews& views, const std::vector<const RidgeImage*>& images,
                   const Pose& T_camera_centered) {
  double sum = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    sum += weightedValues(points, views[v], *images[v], views[v].T_view_first * T_camera_centered);
  }
  return sum / (static_cast<double>(views.size()) * points.weight.sum());
}

double ridgeCost(const WeightedPoints& points, const XrayViews& views, const std::vector<const RidgeImage*>& images,
                 const Pose& T_camera_centered, const PosePriorTerm& prior) {
  double cost = prior.cost(T_camera_centered);
  const double all = points.weight.sum();
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Pose T_view_centered = views[v].T_view_first * T_camera_centered;
    cost += twiceVariance(*images[v]) * (all - weightedValues(points, views[v], *images[v], T_view_centered));
  }
  return cost;
}

RidgeEquations ridgeEquations(const WeightedPoints& points, const XrayViews& views,
                              const std::vector<const RidgeImage*>& images, const Pose& T_camera_centered,
                              const PosePriorTerm& prior) {
  RidgeEquations sum;
  const double all = points.weight.sum();
  for (std::size_t v = 0; v < views.size(); ++v) {
    const RidgeImage& image = *images[v];
    const Pose T_view_centered = views[v].T_view_first * T_camera_centered;
    const Eigen::Matrix3d R = T_view_centered.linear();
    const double half = 0.5 * twiceVariance(image), inverse_variance = 1 / half;
    double values = 0;
    eachSeen(points, views[v], T_view_centered,
             [&](double weight, const Eigen::Vector3d& p, const Eigen::Vector2d& pixel, const auto& J_projection) {
               const RidgeImage::Reading reading = image.read(pixel);
               values += weight * reading.value;
               const double kernel = std::max(0.0, reading.value * inverse_variance);
               const Eigen::Matrix2d M =
                   half * weight * clampedAbsolute(reading.hessian, kMinStiffness * kernel, kernel);
               // d(T exp(dx) p) = R (v + w x p).
               Eigen::Matrix<double, 2, 6> J;
               J.leftCols<3>().noalias() = J_projection * R;
               for (int row = 0; row < 2; ++row) {
                 const Eigen::Vector3d a = J.row(row).head<3>();
                 J.row(row).tail<3>() = p.cross(a);
               }
               sum.g.noalias() -= half * weight * J.transpose() * reading.gradient;
               sum.H.noalias() += J.transpose() * (M * J).eval();
             });
    sum.cost_px2 += twiceVariance(image) * (all - values);
  }
  prior.add(T_camera_centered, sum.H, sum.g);
  sum.cost_px2 += prior.cost(T_camera_centered);
  return sum;
}

LevenbergMarquardt::Step RidgeAscent::step(const WeightedPoints& points, const XrayViews& views,
                                           const std::vector<const RidgeImage*>& images, const Pose& T_camera_centered,
                                           const PosePriorTerm& prior, RidgeFreedom freedom) {
  const RidgeEquations n = ridgeEquations(points, views, images, T_camera_centered, prior);
  // In camera axes: what is held is an axis there, and the damping does not depend on the model's frame.
  Matrix6d model_of_camera = Matrix6d::Zero();
  model_of_camera.topLeftCorner<3, 3>() = model_of_camera.bottomRightCorner<3, 3>() =
      T_camera_centered.linear().transpose();
  Matrix6d H = model_of_camera.transpose() * n.H * model_of_camera;
  Vector6d g = model_of_camera.transpose() * n.g;
  if (freedom == RidgeFreedom::kInPlane) {
    for (const int held : {2, 3, 4}) {
      H.row(held).setZero();
      H.col(held).setZero();
      H(held, held) = 1;
      g[held] = 0;
    }
  }
  LevenbergMarquardt::Step step{T_camera_centered};
  step.lowered = damping_.step([&](double damping) {
    Matrix6d damped = H;
    damped.diagonal() += damping * H.diagonal() + Vector6d::Constant(1e-12);
    const Twist dx = -(model_of_camera * solveSymmetric(damped, g));
    if (!dx.allFinite()) return false;
    Pose trial = T_camera_centered * expSE3(dx);
    trial.linear() = nearestRotation(trial.linear());
    if (!(ridgeCost(points, views, images, trial, prior) <= n.cost_px2)) return false;
    step.T_camera_centered = trial;
    step.dx = dx;
    return true;
  });
  return step;
}

}  // namespace angio::registration
