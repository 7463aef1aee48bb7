// SPDX-License-Identifier: GPL-2.0-or-later
#include "place_correlation.hpp"

// Compiled once for every vector target by the include below; placeCorrelation chooses at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "place_correlation.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace angio::registration {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// One column: `places` is n x 3, `from` a place.
void correlationColumn(const std::vector<CorrelationPart>& parts, const Eigen::MatrixX3f& places,
                       const Eigen::Vector3f& from, float* out) {
  const hn::ScalableTag<float> d;
  const auto set = [&](float value) { return hn::Set(d, value); };
  const float *const x = places.col(0).data(), *const y = places.col(1).data(), *const z = places.col(2).data();
  const std::size_t count = static_cast<std::size_t>(places.rows()), lanes = hn::Lanes(d);
  for (std::size_t first = 0; first < count; first += lanes) {
    const auto some = hn::FirstN(d, count - first);
    const auto away = [&](const float* values, int axis) {
      return hn::Sub(hn::MaskedLoad(some, d, values + first), set(from[axis]));
    };
    const auto dx = away(x, 0), dy = away(y, 1), dz = away(z, 2);
    const auto apart_m = hn::Sqrt(hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz))));
    auto sum = hn::Zero(d);
    for (const CorrelationPart& part : parts) {
      const auto s = hn::Mul(apart_m, set(static_cast<float>(1 / part.length_m)));
      const auto decay = hn::Mul(set(static_cast<float>(part.share)), hn::Exp(d, hn::Neg(s)));
      const auto one = set(1);
      const auto factor = part.smooth ? hn::MulAdd(s, hn::MulAdd(s, set(1.0F / 3), one), one) : one;
      sum = hn::MulAdd(factor, decay, sum);
    }
    hn::BlendedStore(sum, some, d, out + first);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::registration
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::registration {
HWY_EXPORT(correlationColumn);

Eigen::MatrixXf placeCorrelation(const std::vector<CorrelationPart>& parts, const Eigen::Matrix3Xd& a,
                                 const Eigen::Matrix3Xd& b) {
  const Eigen::MatrixX3f places = a.transpose().cast<float>();
  Eigen::MatrixXf result(a.cols(), b.cols());
  const auto column = HWY_DYNAMIC_DISPATCH(correlationColumn);
  for (Eigen::Index j = 0; j < b.cols(); ++j) {
    column(parts, places, b.col(j).cast<float>(), result.col(j).data());
  }
  return result;
}

}  // namespace angio::registration
#endif
