// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "angio/rod/namespace.hpp"

namespace angio::rod {

/// A symmetric matrix whose entries stand within kBand of its diagonal, and its Cholesky factor.
class BandedSystem {
 public:
  static constexpr Eigen::Index kBand = 10;  ///< Three points and the two edges between them: 11 freedoms in a row.

  explicit BandedSystem(Eigen::Index size);

  /// All zero; `softening`: how much of what softens is to be added, see there.
  void clear(double softening);

  /// Share of negative contributions that whoever adds them should add: below 1 it is no second derivative any more.
  double softening() const { return softening_; }

  /// Adds a symmetric block whose first row and column stand at `at`. Rows at negative places are held, and left out.
  template <typename Block>
  void add(Eigen::Index at, const Block& block) {
    for (Eigen::Index c = std::max<Eigen::Index>(0, -at); c < block.cols(); ++c) {
      double* column = matrix_.valuePtr() + matrix_.outerIndexPtr()[at + c] - c;
      for (Eigen::Index r = c; r < block.rows(); ++r) column[r] += block(r, c);
    }
  }

  /// Whether the matrix is positive definite, and then its factor is ready for solve().
  bool factorise();
  Eigen::VectorXd solve(const Eigen::VectorXd& right) const { return factor_.solve(right); }

 private:
  double softening_ = 1;
  Eigen::SparseMatrix<double> matrix_;  // Its lower half, columns from the diagonal down.
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>> factor_;
};

}  // namespace angio::rod
