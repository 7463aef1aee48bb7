// SPDX-License-Identifier: GPL-2.0-or-later
#include "lower_factor_avx2.hpp"

// This file is compiled for AVX2 and FMA. Its Eigen has a name of its own, so that the linker cannot take its functions
// for those of the other files, which have to run without.
#define Eigen EigenAvx2
#include <Eigen/Cholesky>
#undef Eigen

namespace angio::registration {

bool factorLowerAvx2(double* columns, long n, long stride) {
  using Matrix = EigenAvx2::MatrixXd;
  EigenAvx2::Map<Matrix, 0, EigenAvx2::OuterStride<>> mapped(columns, n, n, EigenAvx2::OuterStride<>(stride));
  EigenAvx2::Ref<Matrix> matrix(mapped);
  return EigenAvx2::LLT<EigenAvx2::Ref<Matrix>>(matrix).info() == EigenAvx2::Success;
}

}  // namespace angio::registration
