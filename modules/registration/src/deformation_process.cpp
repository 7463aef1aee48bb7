// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_process.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "lower_factor.hpp"
#include "place_correlation.hpp"

namespace angio::registration {
namespace {

// Variances of the linear part of a deformation at the tree's radius of gyration, over that of the smooth one: a
// displacement whose nine gradients are free, and growth alike on all axes. Measured motions of lungs carried over to
// brains: with a quarter of it the depth of a tree deformed by 1 mm is claimed too well in one trial of five.
constexpr double kStrain = 2;

// The shorter lengths of a process, of its length.
constexpr double kHalf = 1.0 / 2, kShort = 1.0 / 6;

// Variance of what goes together over so short a length only, over that of the smooth part. Without it one deformed
// fit in five to such a motion of 3 mm claims places in the image that are wrong; with it one in fifty.
constexpr double kRough = 0.015, kRough_m = 20e-3;

// Over such a length the model's own error goes together: how it was traced, and how vessels are found in an image.
const std::vector<CorrelationPart> kLocalError = {{1, 8e-3, false}};

// Amplitudes that are tried [m]. Of errors that are local no more is believed than a voxel of a CT.
constexpr std::array<double, 10> kDeformation_m = {0,      0.05e-3, 0.1e-3, 0.2e-3, 0.4e-3,
                                                   0.8e-3, 1.6e-3,  3.2e-3, 6.4e-3, 12.8e-3};
constexpr std::array<double, 4> kLocalError_m = {0.01e-3, 0.06e-3, 0.12e-3, 0.2e-3};
// How many neighbouring points of a centreline err alike: drawn ones singly, extracted ones by the filter's width.
constexpr std::array<double, 2> kTogether = {1, 5};
constexpr double kFloor_px = 0.05;
constexpr std::size_t kMaxAsked = 64;

// Matrices of a thousand rows are made some columns at a time, which stay in the cache. `make` is told the first and
// how many.
template <typename Make>
void inColumns(Eigen::Index columns, Make&& make) {
  constexpr Eigen::Index kSome = 16;
  for (Eigen::Index first = 0, count = 0; first < columns; first += count) {
    const Eigen::Index left = columns - first;
    count = left <= kSome + 1 ? left : kSome;  // No last one by itself.
    make(first, count);
  }
}

// What residuals see of displacements that go together as `together` says of two sets of places: its lower triangle,
// which is all that a factor asks for, and zeros above. `add` adds to some columns of it, from a row on.
template <typename Together, typename Add>
Eigen::MatrixXd lowerOfResiduals(const ResidualArrays& groups, Together&& together, Add&& add) {
  const Eigen::Index n = groups.at.cols();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(n, n);
  inColumns(n, [&](Eigen::Index first, Eigen::Index count) {
    const Eigen::Index rows = n - first;
    Eigen::MatrixXd block =
        groups.gradient.rightCols(rows).transpose().lazyProduct(groups.gradient.middleCols(first, count));
    block.array() *= together(groups.at.rightCols(rows).eval(), groups.at.middleCols(first, count).eval()).array();
    add(first, count, block);
    result.block(first, first, rows, count) = block;
  });
  return result;
}

// The sums over the groups of weight, gradient and correlation with each of the places.
Eigen::Matrix3Xd weightedCorrelation(const std::vector<CorrelationPart>& parts, const ResidualArrays& groups,
                                     const Eigen::VectorXd& weights, const Eigen::Matrix3Xd& at) {
  const Eigen::MatrixX3d weighted = weights.asDiagonal() * groups.gradient.transpose();
  Eigen::Matrix3Xd result(3, at.cols());
  inColumns(at.cols(), [&](Eigen::Index first, Eigen::Index count) {
    const Eigen::MatrixXd some = placeCorrelation(parts, groups.at, at.middleCols(first, count)).cast<double>();
    result.middleCols(first, count) = weighted.transpose().lazyProduct(some);
  });
  return result;
}

// Jacobians and residuals, in columns of like size for the determinant's sake.
Eigen::Matrix<double, Eigen::Dynamic, 7> designOf(const ResidualArrays& groups) {
  Eigen::Matrix<double, Eigen::Dynamic, 7> design(groups.residual_px.size(), 7);
  design << groups.jacobian, groups.residual_px;
  for (int k = 0; k < 6; ++k) design.col(k) /= std::max(1e-12, design.col(k).norm());
  return design;
}

// `whitened` is the design with the factor's inverse applied, `log_determinant` that of the residuals' covariance.
double restrictedLikelihood(const Eigen::Ref<const Eigen::Matrix<double, Eigen::Dynamic, 7>>& whitened,
                            double log_determinant) {
  const Matrix6d normal = whitened.leftCols<6>().transpose() * whitened.leftCols<6>();
  const Vector6d right = whitened.leftCols<6>().transpose() * whitened.col(6);
  const Eigen::LDLT<Matrix6d> of_pose(normal);
  const double left = whitened.col(6).squaredNorm() - right.dot(of_pose.solve(right));
  const double log_determinants = log_determinant + of_pose.vectorD().array().max(1e-300).log().sum();
  return -0.5 * (log_determinants + left);
}

// A matrix of moments as one of groups.
Eigen::MatrixXd ofGroups(const Eigen::MatrixXd& by_moment, const Moments& moments, Eigen::Index groups) {
  Eigen::MatrixXd result(groups, groups);
  for (Eigen::Index j = 0; j < groups; ++j) {
    for (Eigen::Index i = 0; i < groups; ++i) result(i, j) = by_moment(moments.at(i), moments.at(j));
  }
  return result;
}

std::vector<ResidualGroup> thinnedTo(std::size_t most, std::vector<ResidualGroup> groups) {
  const std::size_t stride = (groups.size() + most - 1) / most;
  if (stride <= 1) return groups;
  for (std::size_t i = 0; i * stride < groups.size(); ++i) groups[i] = groups[i * stride];
  groups.resize((groups.size() + stride - 1) / stride);
  return groups;
}

}  // namespace

ResidualArrays::ResidualArrays(const std::vector<ResidualGroup>& groups) {
  const auto n = static_cast<Eigen::Index>(groups.size());
  at.resize(3, n);
  gradient.resize(3, n);
  jacobian.resize(n, 6);
  residual_px.resize(n);
  noise_px2.resize(n);
  double scatter = 0, weight = 0;
  for (const ResidualGroup& group : groups) {
    scatter += group.weight * group.scatter_px2;
    weight += group.weight;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const ResidualGroup& group = groups[i];
    at.col(i) = group.at;
    gradient.col(i) = group.gradient;
    jacobian.row(i) = group.jacobian.transpose();
    residual_px[i] = group.residual_px;
    noise_px2[i] = kFloor_px * kFloor_px + scatter / weight / std::max(1.0, group.weight);
  }
  outwards = at.cwiseProduct(gradient).colwise().sum().transpose();
}

DeformationProcess::DeformationProcess(const std::vector<ResidualGroup>& groups, double length_m,
                                       const ProcessShape& shape)
    : radius2_m2_(1e-6), shape_(shape) {
  for (const CorrelationPart& part : {CorrelationPart{shape.over_long, length_m, true},
                                      {shape.over_half, kHalf * length_m, true},
                                      {shape.over_short, kShort * length_m, true},
                                      {kRough, kRough_m, false}}) {
    if (part.share > 0) parts_.push_back(part);
  }
  for (const ResidualGroup& group : groups) radius2_m2_ += group.at.squaredNorm() / static_cast<double>(groups.size());
}

Eigen::MatrixXd DeformationProcess::alike(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) const {
  Eigen::MatrixXd result = placeCorrelation(parts_, a, b).cast<double>();
  result += (kStrain / radius2_m2_ * a).transpose().lazyProduct(b);
  return result;
}

double DeformationProcess::growth() const { return shape_.growth / radius2_m2_; }

Eigen::Matrix3d DeformationProcess::covariance(const Eigen::Vector3d& at) const {
  return (1 + kRough + kStrain / radius2_m2_ * at.squaredNorm()) * Eigen::Matrix3d::Identity() +
         growth() * at * at.transpose();
}

Eigen::MatrixXd DeformationProcess::ofResiduals(const ResidualArrays& groups) const {
  return lowerOfResiduals(
      groups, [&](const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) { return alike(a, b); },
      [&](Eigen::Index first, Eigen::Index count, Eigen::MatrixXd& block) {
        const Eigen::Index rows = block.rows();
        block += growth() * groups.outwards.tail(rows) * groups.outwards.segment(first, count).transpose();
      });
}

Eigen::Matrix<double, Eigen::Dynamic, 3> DeformationProcess::withPlace(const ResidualArrays& groups,
                                                                       const Eigen::Vector3d& at) const {
  const Eigen::VectorXd factor = alike(groups.at, at);
  return factor.asDiagonal() * groups.gradient.transpose() + growth() * groups.outwards * at.transpose();
}

Eigen::Matrix3Xd DeformationProcess::ofWeights(const ResidualArrays& groups, const Eigen::VectorXd& weights,
                                               const Eigen::Matrix3Xd& at) const {
  // What is linear in the place needs no pairs.
  Eigen::Matrix3d linear = kStrain / radius2_m2_ * groups.gradient * weights.asDiagonal() * groups.at.transpose();
  linear.diagonal().array() += growth() * groups.outwards.dot(weights);
  return linear * at + weightedCorrelation(parts_, groups, weights, at);
}

Eigen::MatrixXd localCorrelation(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
  return placeCorrelation(kLocalError, a, b).cast<double>();
}

Eigen::Matrix3Xd localOfWeights(const ResidualArrays& groups, const Eigen::VectorXd& weights,
                                const Eigen::Matrix3Xd& at) {
  return weightedCorrelation(kLocalError, groups, weights, at);
}

Eigen::MatrixXd localErrorOfResiduals(const ResidualArrays& groups) {
  return lowerOfResiduals(groups, localCorrelation, [](Eigen::Index, Eigen::Index, Eigen::MatrixXd&) {});
}

ErrorSizes errorSizes(const DeformationProcess& process, std::vector<ResidualGroup> all) {
  const ResidualArrays groups(thinnedTo(kMaxAsked, std::move(all)));
  const Eigen::MatrixXd deformed = process.ofResiduals(groups), local = localErrorOfResiduals(groups);
  const Eigen::Index n = deformed.rows();
  const Eigen::Matrix<double, Eigen::Dynamic, 7> design = designOf(groups);

  struct Weighed {
    double log_likelihood, deformation2_m2, local2_m2, together;
  };
  std::vector<Weighed> tried;
  Eigen::MatrixXd base(n, n), C(n, n);
  Eigen::Matrix<double, Eigen::Dynamic, 7> whitened(n, 7);
  for (const double together : kTogether) {
    for (const double local_m : kLocalError_m) {
      base = local_m * local_m * local;
      base.diagonal() += together * groups.noise_px2;
      for (const double deformation_m : kDeformation_m) {
        C = base + deformation_m * deformation_m * deformed;
        const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(C);
        if (factor.info() != Eigen::Success) continue;
        whitened = design;
        factor.matrixL().solveInPlace(whitened);
        const double log_likelihood =
            restrictedLikelihood(whitened, 2 * factor.matrixLLT().diagonal().array().log().sum());
        if (std::isfinite(log_likelihood)) {
          tried.push_back({log_likelihood, deformation_m * deformation_m, local_m * local_m, together});
        }
      }
    }
  }
  double best = -1e300, sum = 0;
  Weighed mean{0, 0, 0, 0};
  for (const Weighed& w : tried) best = std::max(best, w.log_likelihood);
  for (const Weighed& w : tried) {
    const double probability = std::exp(w.log_likelihood - best);
    sum += probability;
    mean.deformation2_m2 += probability * w.deformation2_m2;
    mean.local2_m2 += probability * w.local2_m2;
    mean.together += probability * w.together;
  }
  if (tried.empty()) return {};
  return {std::sqrt(mean.deformation2_m2 / sum), std::sqrt(mean.local2_m2 / sum), mean.together / sum};
}

Eigen::MatrixXd covarianceOfResiduals(const DeformationProcess& process, const ResidualArrays& groups,
                                      const Moments& moments, double amplitude_m, double local_m) {
  Eigen::MatrixXd C = process.ofResiduals(groups);
  const bool one_moment = moments.of_group.empty();
  if (!one_moment) C.array() *= ofGroups(moments.deformation, moments, C.rows()).array();
  C *= amplitude_m * amplitude_m;
  C += local_m * local_m * localErrorOfResiduals(groups);
  if (!one_moment) {
    C.array() +=
        ofGroups(moments.shift_m2, moments, C.rows()).array() * (groups.gradient.transpose() * groups.gradient).array();
  }
  return C;
}

double restrictedLogLikelihood(const DeformationProcess& process, const std::vector<ResidualGroup>& all,
                               const Moments& moments, const ErrorSizes& sizes) {
  const ResidualArrays groups(all);
  Eigen::MatrixXd C = covarianceOfResiduals(process, groups, moments, sizes.deformation_m, sizes.local_m);
  C.diagonal() += sizes.together * groups.noise_px2;
  if (!factorLower(C)) return std::nan("");
  const Eigen::Matrix<double, Eigen::Dynamic, 7> whitened = C.triangularView<Eigen::Lower>().solve(designOf(groups));
  return restrictedLikelihood(whitened, 2 * C.diagonal().array().log().sum());
}

}  // namespace angio::registration
