// SPDX-License-Identifier: GPL-2.0-or-later
#include "information.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/decompositions.hpp"
#include "least_squares.hpp"

namespace angio::calibration {

Eigen::MatrixXd covarianceOf(const Eigen::MatrixXd& information, double floor) {
  const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  scaled.diagonal().array() += floor;
  const Eigen::MatrixXd inverse = inverseOfSymmetric(scaled);
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

namespace {

constexpr double kShares = 0.3;  // Of a unit direction: a parameter with less takes no part worth a name.

// `direction` has unit length in units of `known_stds`, and is determined `loss` times worse than one of those.
WeakDirection named(const std::vector<std::string>& parameters, const Eigen::VectorXd& direction,
                    const Eigen::VectorXd& known_stds, double loss) {
  std::vector<Eigen::Index> order(parameters.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](Eigen::Index a, Eigen::Index b) { return std::abs(direction[a]) > std::abs(direction[b]); });
  const auto name = [&](std::size_t k) { return parameters[order[k]]; };
  const auto change = [&](std::size_t k) { return direction[order[k]] * known_stds[order[k]]; };
  WeakDirection weak;
  weak.name = name(0);
  for (std::size_t k = 1; k < order.size() && std::abs(direction[order[k]]) > kShares; ++k) {
    const double factor = change(k) / change(0);
    weak.name += formatted(" %c %.3g ", factor < 0 ? '-' : '+', std::abs(factor)) + name(k);
  }
  weak.sigma = loss * std::abs(change(0));
  const std::size_t mark = name(0).rfind('_');
  if (mark != std::string::npos) weak.unit = name(0).substr(mark + 1);
  return weak;
}

}  // namespace

Observability observability(const std::vector<std::string>& parameters, const Eigen::MatrixXd& covariance,
                            double threshold) {
  const auto size = static_cast<Eigen::Index>(parameters.size());
  const bool sized = size > 0 && covariance.rows() == size && covariance.cols() == size && covariance.allFinite();
  if (!sized || !(covariance.diagonal().array() > 0).all()) {
    throw InputError("calibration", "covariance", "",
                     "must be finite, with a positive variance for each of " + std::to_string(size) + " parameters");
  }
  // Scaled first: metres beside radians and pixels would cost digits.
  const Eigen::VectorXd sigmas = covariance.diagonal().cwiseSqrt(), inverse = sigmas.cwiseInverse();
  const Eigen::MatrixXd information =
      inverseOfSymmetric(Eigen::MatrixXd(inverse.asDiagonal() * covariance * inverse.asDiagonal()));
  const Eigen::VectorXd own = information.diagonal().cwiseMax(1).cwiseSqrt();  // Exactly: at least 1.
  const Eigen::MatrixXd scaled = own.cwiseInverse().asDiagonal() * information * own.cwiseInverse().asDiagonal();
  // Of a positive definite matrix, singular values are eigenvalues: falling.
  const SingularValues svd = singularValuesOf(scaled, Eigen::ComputeFullU);
  const double largest = svd.values[0];
  const Eigen::VectorXd eigenvalues = svd.values.cwiseMax(1e-15 * largest);
  Observability result;
  result.condition = largest / eigenvalues[size - 1];
  for (Eigen::Index i = size - 1; i >= 0 && eigenvalues[i] * threshold < 1; --i) {
    result.weak_directions.push_back(
        named(parameters, svd.U.col(i), sigmas.cwiseQuotient(own), 1 / std::sqrt(eigenvalues[i])));
  }
  return result;
}

void recordObservability(CalibrationRecord& record) {
  const Observability seen = observability(record.parameters, record.covariance);
  record.condition = seen.condition;
  record.weak_directions = seen.weak_directions;
}

}  // namespace angio::calibration
