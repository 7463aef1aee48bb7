// SPDX-License-Identifier: GPL-2.0-or-later
#include "lower_factor.hpp"

#include <Eigen/Cholesky>

#include "lower_factor_avx2.hpp"

namespace angio::registration {

bool factorLower(Eigen::Ref<Eigen::MatrixXd> symmetric) {
#ifdef ANGIO_HAS_AVX2_SOURCE
  static const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (avx2) return factorLowerAvx2(symmetric.data(), symmetric.cols(), symmetric.outerStride());
#endif
  return Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(symmetric).info() == Eigen::Success;
}

}  // namespace angio::registration
