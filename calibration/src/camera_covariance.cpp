// SPDX-License-Identifier: GPL-2.0-or-later
#include "camera_covariance.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "angio/geometry/decompositions.hpp"
#include "information.hpp"

namespace angio::calibration {
namespace {

// One view by the normal equations in blocks: with the values' Schur complement S, Cov(values) = S^-1, Cov(pose) = P^-1
// + G S^-1 G^T and Cov(pose, values) = -G S^-1, with G = P^-1 C^T.
struct ViewBlocks {
  ViewInformation at;
  Matrix6d P_inverse;
  Eigen::MatrixXd G;  // 6 x n.
};

std::vector<ViewBlocks> blocksOf(const CameraBundle& bundle) {
  std::vector<ViewBlocks> blocks;
  for (const BundleView& view : bundle.views) {
    ViewInformation at = informationOf(bundle, view);
    const Matrix6d P_inverse = inverseOfSymmetric(at.pose);
    const Eigen::MatrixXd G = P_inverse * at.cross.transpose();
    blocks.push_back({std::move(at), P_inverse, G});
  }
  return blocks;
}

// Of the values, for beads of unit variance.
struct SchurComplement {
  Eigen::MatrixXd covariance;
  double squared = 0, freedom = 1;  // Of all residuals.
};

SchurComplement schurOf(const CameraBundle& bundle, const std::vector<ViewBlocks>& blocks) {
  const Eigen::MatrixXd prior = bundle.priorInformation();
  Eigen::MatrixXd S = prior;
  SchurComplement schur;
  double residuals = 0;
  for (const ViewBlocks& view : blocks) {
    S += view.at.reducedLens();
    schur.squared += view.at.squared;
    residuals += view.at.residuals;
  }
  schur.covariance = covarianceOf(S);
  // What is known of the plates' shifts before is not determined by the beads.
  const double numbers = static_cast<double>(bundle.values.size() + 6 * bundle.views.size());
  schur.freedom = std::max(1.0, residuals - numbers + (prior * schur.covariance).trace());
  return schur;
}

// Of values and pose, for beads of unit variance.
Eigen::MatrixXd jointOf(const ViewBlocks& view, const Eigen::MatrixXd& values) {
  const Eigen::Index n = values.rows();
  Eigen::MatrixXd joint(n + 6, n + 6);
  joint.topLeftCorner(n, n) = values;
  joint.bottomLeftCorner(6, n) = -view.G * values;
  joint.topRightCorner(n, 6) = joint.bottomLeftCorner(6, n).transpose();
  joint.bottomRightCorner(6, 6) = view.P_inverse + view.G * values * view.G.transpose();
  return joint;
}

// A bead's residual and its derivatives by values and pose.
struct BeadRow {
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, Eigen::Dynamic> J;
};

BeadRow beadRow(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead) {
  const Eigen::Index n = bundle.values.size();
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> J_values(2, n);
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> J_pose;
  const Vector6d no_step = Vector6d::Zero();
  const double* const blocks[] = {bundle.values.data(), no_step.data()};
  double* jacobians[] = {J_values.data(), J_pose.data()};
  BeadRow row;
  beadCost(bundle, view, bead)->Evaluate(blocks, row.r.data(), jacobians);
  row.J.resize(2, n + 6);
  row.J << J_values, J_pose;
  return row;
}

// Terms of the map at a bead's pinhole pixel, within the circle that was fitted.
Eigen::VectorXd mapTerms(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead) {
  const DetectorDistortion& map = bundle.model.known.value();
  LensModel pinhole = bundle.model;
  pinhole.known.reset();
  const Eigen::Vector2d px =
      pinhole.seen(bundle.lens(), view.distance_m, view.T_camera_phantom * bundle.point_m(view, bead));
  Eigen::Vector2d at = (px - map.center_px).cwiseQuotient(map.unit_px);
  at /= std::max(1.0, at.norm());
  return DisplacementPolynomial::terms(map.shift.order, at);
}

// How values and poses follow the map's coefficients, by axis: -(J^T J)^-1 J^T terms, in blocks.
struct MapGain {
  std::array<Eigen::MatrixXd, 2> values;              // n x terms.
  std::vector<std::array<Eigen::MatrixXd, 2>> poses;  // 6 x terms.
};

MapGain mapGain(const CameraBundle& bundle, const std::vector<ViewBlocks>& blocks, const Eigen::MatrixXd& values) {
  const Eigen::Index n = bundle.values.size(),
                     terms = DisplacementPolynomial::termCount(bundle.model.known.value().shift.order);
  std::array<Eigen::MatrixXd, 2> by_values;
  by_values.fill(Eigen::MatrixXd::Zero(n, terms));
  MapGain gain;
  for (std::size_t v = 0; v < blocks.size(); ++v) {
    const BundleView& view = bundle.views[v];
    std::array<Eigen::MatrixXd, 2> by_pose;
    by_pose.fill(Eigen::MatrixXd::Zero(6, terms));
    for (Eigen::Index i = 0; i < view.points_m.cols(); ++i) {
      if (!view.use[static_cast<std::size_t>(i)]) continue;
      const BeadRow row = beadRow(bundle, view, i);
      const Eigen::RowVectorXd at = mapTerms(bundle, view, i).transpose() / view.stds_px[i];
      for (Eigen::Index axis = 0; axis < 2; ++axis) {
        by_pose[static_cast<std::size_t>(axis)] += row.J.row(axis).tail<6>().transpose() * at;
        by_values[static_cast<std::size_t>(axis)] += row.J.row(axis).head(n).transpose() * at;
      }
    }
    gain.poses.emplace_back();
    for (std::size_t axis = 0; axis < 2; ++axis) {
      by_values[axis] -= blocks[v].G.transpose() * by_pose[axis];
      gain.poses.back()[axis] = -blocks[v].P_inverse * by_pose[axis];
    }
  }
  for (std::size_t axis = 0; axis < 2; ++axis) {
    gain.values[axis] = -values * by_values[axis];
    for (std::size_t v = 0; v < blocks.size(); ++v) gain.poses[v][axis] -= blocks[v].G * gain.values[axis];
  }
  return gain;
}

// d(mean depth of the phantom) / d(pose) of each view.
std::vector<Vector6d> depthRows(const CameraBundle& bundle, const Eigen::Vector3d& center_m) {
  std::vector<Vector6d> rows;
  for (const BundleView& view : bundle.views) {
    Vector6d depth;
    depth << 0, 0, 1, -skew(view.T_camera_phantom.linear() * center_m).row(2).transpose();
    rows.emplace_back(depth / static_cast<double>(bundle.views.size()));
  }
  return rows;
}

void addMapError(const MapGain& gain, const Eigen::MatrixXd& map, const std::vector<Vector6d>& depths,
                 JointCovariance& joint) {
  const Eigen::Index n = joint.values.rows();
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const Eigen::MatrixXd& values = gain.values[axis];
    joint.values += values * map * values.transpose();
    Eigen::RowVectorXd depth = Eigen::RowVectorXd::Zero(map.cols());
    for (std::size_t v = 0; v < depths.size(); ++v) {
      Eigen::MatrixXd both(n + 6, map.cols());
      both << values, gain.poses[v][axis];
      joint.views[v] += both * map * both.transpose();
      depth += depths[v].transpose() * gain.poses[v][axis];
    }
    joint.mean_depth.head(n) += depth * map * values.transpose();
    joint.mean_depth[n] += depth * map * depth.transpose();
  }
}

}  // namespace

double measuredVariance(const CameraBundle& bundle) {
  const SchurComplement schur = schurOf(bundle, blocksOf(bundle));
  return schur.squared / schur.freedom;
}

JointCovariance jointCovariance(const CameraBundle& bundle, const Eigen::Vector3d& center_m, double noise_px,
                                const Eigen::MatrixXd& map_covariance_px2) {
  const Eigen::Index n = bundle.values.size();
  const std::vector<ViewBlocks> blocks = blocksOf(bundle);
  const SchurComplement schur = schurOf(bundle, blocks);
  const Eigen::MatrixXd& unit = schur.covariance;
  JointCovariance joint;
  joint.freedom = schur.freedom;
  const double variance = noise_px > 0 ? noise_px * noise_px : schur.squared / schur.freedom;
  joint.values = variance * unit;
  const std::vector<Vector6d> depths = depthRows(bundle, center_m);
  Eigen::RowVectorXd depth_by_values = Eigen::RowVectorXd::Zero(n);
  double own = 0;
  for (std::size_t v = 0; v < blocks.size(); ++v) {
    const Eigen::MatrixXd of_view = jointOf(blocks[v], unit);
    joint.views.emplace_back(variance * of_view);
    depth_by_values -= depths[v].transpose() * blocks[v].G;
    own += variance * depths[v].dot(blocks[v].P_inverse * depths[v]);
    const BundleView& view = bundle.views[v];
    for (Eigen::Index i = 0; i < view.points_m.cols(); ++i) {
      if (!view.use[static_cast<std::size_t>(i)]) continue;
      const BeadRow row = beadRow(bundle, view, i);
      const Eigen::MatrixXd left = Eigen::Matrix2d::Identity() - row.J * of_view * row.J.transpose();
      joint.left_out_squared_px2 += (view.stds_px[i] * solveSymmetric(left, Eigen::VectorXd(row.r))).squaredNorm();
    }
  }
  joint.mean_depth.resize(n + 1);
  joint.mean_depth.head(n) = depth_by_values * joint.values;
  joint.mean_depth[n] = own + depth_by_values * joint.values * depth_by_values.transpose();
  if (map_covariance_px2.size() > 0) addMapError(mapGain(bundle, blocks, unit), map_covariance_px2, depths, joint);
  return joint;
}

}  // namespace angio::calibration
