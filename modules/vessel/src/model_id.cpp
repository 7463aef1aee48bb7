// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/model_id.hpp"

#include <cmath>

namespace angio {
namespace {

constexpr double kPerMetre = 1e9;

class Fnv1a {
 public:
  void add(std::int64_t word) {
    for (int byte = 0; byte < 8; ++byte) {
      hash_ = (hash_ ^ (static_cast<std::uint64_t>(word) >> (8 * byte) & 0xFF)) * 0x100000001b3ULL;
    }
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325ULL;
};

}  // namespace

ModelId modelId(const VesselTree& tree) {
  Fnv1a hash;
  for (int i = 0; i < tree.size(); ++i) {
    for (const double x : tree.points().col(i)) hash.add(std::llround(kPerMetre * x));
    hash.add(tree.parents()[static_cast<std::size_t>(i)]);
  }
  const auto id = static_cast<std::int64_t>(hash.value());
  return static_cast<ModelId>(id == 0 ? 1 : id);
}

}  // namespace angio
