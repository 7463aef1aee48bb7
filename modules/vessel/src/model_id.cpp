// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/model_id.hpp"

#include <cmath>

#include "angio/base/fnv1a.hpp"

namespace angio::vessel {
namespace {

constexpr double kPerMetre = 1e9;

}  // namespace

ModelId modelId(const VesselTree& tree) {
  Fnv1a hash;
  for (int i = 0; i < tree.size(); ++i) {
    for (const double x : tree.points().col(i)) hash.add(std::int64_t{std::llround(kPerMetre * x)});
    hash.add(std::int64_t{tree.parents()[static_cast<std::size_t>(i)]});
  }
  const auto id = static_cast<std::int64_t>(hash.value());
  return static_cast<ModelId>(id == 0 ? 1 : id);
}

}  // namespace angio::vessel
