// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/thinning.hpp"

#include <algorithm>
#include <array>
#include <queue>

namespace angio::volume {
namespace {

constexpr Neighbourhood kMiddle = 1U << 13;

constexpr int manhattan(int a, int b) {
  const int dx = a % 3 - b % 3, dy = a / 3 % 3 - b / 3 % 3, dz = a / 9 - b / 9;
  return (dx < 0 ? -dx : dx) + (dy < 0 ? -dy : dy) + (dz < 0 ? -dz : dz);
}

constexpr bool touch(int a, int b) {
  const int dx = a % 3 - b % 3, dy = a / 3 % 3 - b / 3 % 3, dz = a / 9 - b / 9;
  return a != b && dx * dx <= 1 && dy * dy <= 1 && dz * dz <= 1;
}

struct Tables {
  std::array<Neighbourhood, 27> touching{};  // By a corner at least, the middle left out.
  std::array<Neighbourhood, 27> facing{};    // By a face, within the 18 around the middle.
  Neighbourhood faces = 0, eighteen = 0;
};

constexpr Tables makeTables() {
  Tables tables;
  for (int a = 0; a < 27; ++a) {
    if (a == 13) continue;
    if (manhattan(a, 13) == 1) tables.faces |= 1U << a;
    if (manhattan(a, 13) <= 2) tables.eighteen |= 1U << a;
    for (int b = 0; b < 27; ++b) {
      if (b == 13) continue;
      if (touch(a, b)) tables.touching[a] |= 1U << b;
      if (manhattan(a, b) == 1 && manhattan(b, 13) <= 2) tables.facing[a] |= 1U << b;
    }
  }
  return tables;
}

constexpr Tables kTables = makeTables();

// All of `among` that is connected to the lowest bit of `seeds`.
Neighbourhood flooded(Neighbourhood seeds, Neighbourhood among, const std::array<Neighbourhood, 27>& links) {
  Neighbourhood reached = seeds & (~seeds + 1), front = reached;
  while (front) {
    const auto at = static_cast<std::size_t>(__builtin_ctz(front));
    front &= front - 1;
    const Neighbourhood fresh = links[at] & among & ~reached;
    reached |= fresh;
    front |= fresh;
  }
  return reached;
}

// A mask with a layer of outside around it, so that every voxel has its 26 neighbours.
class Padded {
 public:
  explicit Padded(const VoxelMask& mask) : size_(mask.grid.size) {
    row_ = static_cast<std::size_t>(size_.x()) + 2;
    layer_ = row_ * (static_cast<std::size_t>(size_.y()) + 2);
    inside_.assign(layer_ * (static_cast<std::size_t>(size_.z()) + 2), 0);
    for (int k = 0; k < 27; ++k) {
      steps_[k] = k % 3 - 1 + (k / 3 % 3 - 1) * static_cast<long>(row_) + (k / 9 - 1) * static_cast<long>(layer_);
    }
    forEach([&](std::size_t at, std::size_t voxel) { inside_[at] = mask.inside[voxel] ? 1 : 0; });
  }

  // visit(place here, place in the mask)
  template <typename Visit>
  void forEach(const Visit& visit) const {
    forEachVoxel(size_, [&](const Eigen::Vector3i& v, std::size_t voxel) {
      visit(layer_ * (v.z() + 1) + row_ * (v.y() + 1) + v.x() + 1, voxel);
    });
  }

  Neighbourhood around(std::size_t at) const {
    Neighbourhood bits = 0;
    for (std::size_t k = 0; k < 27; ++k) bits |= static_cast<Neighbourhood>(inside_[neighbour(at, k)]) << k;
    return bits;
  }
  std::size_t neighbour(std::size_t at, std::size_t bit) const { return at + steps_[bit]; }
  bool inside(std::size_t at) const { return inside_[at] != 0; }
  void remove(std::size_t at) { inside_[at] = 0; }
  std::size_t count() const { return inside_.size(); }

 private:
  Eigen::Vector3i size_;
  std::size_t row_, layer_;
  std::array<long, 27> steps_{};
  std::vector<std::uint8_t> inside_;
};

struct Candidate {
  float depth;
  std::uint32_t turn;  // First come, first served: the order among equals is the same on every machine.
  std::size_t at;
  bool operator<(const Candidate& other) const {
    return depth != other.depth ? depth > other.depth : turn > other.turn;
  }
};

}  // namespace

bool isSimple(Neighbourhood neighbourhood) {
  const Neighbourhood inside = neighbourhood & ~kMiddle;
  if (!inside || flooded(inside, inside, kTables.touching) != inside) return false;
  const Neighbourhood outside = ~neighbourhood & kTables.eighteen, faces = outside & kTables.faces;
  return faces && (faces & ~flooded(faces, outside, kTables.facing)) == 0;
}

VoxelMask thinned(const VoxelMask& mask, const std::vector<float>& depth) {
  Padded voxels(mask);
  std::vector<float> depth_at(voxels.count(), 0.0F);
  std::vector<std::uint8_t> waits(voxels.count(), 0);
  std::priority_queue<Candidate> queue;
  std::uint32_t turn = 0;
  const auto enqueue = [&](std::size_t at) {
    if (!voxels.inside(at) || waits[at]) return;
    waits[at] = 1;
    queue.push({depth_at[at], turn++, at});
  };
  voxels.forEach([&](std::size_t at, std::size_t voxel) { depth_at[at] = depth[voxel]; });
  voxels.forEach([&](std::size_t at, std::size_t) {
    if (voxels.inside(at) && (~voxels.around(at) & kTables.faces)) enqueue(at);
  });
  while (!queue.empty()) {
    const std::size_t at = queue.top().at;
    queue.pop();
    waits[at] = 0;
    const Neighbourhood around = voxels.around(at);
    if (__builtin_popcount(around & ~kMiddle) < 2 || !isSimple(around)) continue;
    voxels.remove(at);
    for (std::size_t k = 0; k < 27; ++k) enqueue(voxels.neighbour(at, k));
  }
  VoxelMask skeleton{mask.grid, std::vector<std::uint8_t>(mask.grid.count(), 0)};
  voxels.forEach([&](std::size_t at, std::size_t voxel) { skeleton.inside[voxel] = voxels.inside(at) ? 1 : 0; });
  return skeleton;
}

long long eulerNumber(const VoxelMask& mask) {
  // Cells of all cubes by their doubled coordinates: odd along each axis in which a cell has an extent.
  std::vector<std::uint64_t> cells;
  const Eigen::Vector3i size = mask.grid.size;
  const auto nx = static_cast<std::uint64_t>(2 * size.x() + 1), ny = static_cast<std::uint64_t>(2 * size.y() + 1);
  forEachVoxel(size, [&](const Eigen::Vector3i& v, std::size_t at) {
    if (!mask.inside[at]) return;
    for (int k = 0; k < 27; ++k) {
      const auto cx = static_cast<std::uint64_t>(2 * v.x() + k % 3), cz = static_cast<std::uint64_t>(2 * v.z() + k / 9);
      cells.push_back(cx + nx * (static_cast<std::uint64_t>(2 * v.y() + k / 3 % 3) + ny * cz));
    }
  });
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  long long sum = 0;
  for (const std::uint64_t cell : cells) {
    const std::uint64_t extent = cell % nx % 2 + cell / nx % ny % 2 + cell / nx / ny % 2;
    sum += extent % 2 == 0 ? 1 : -1;
  }
  return sum;
}

}  // namespace angio::volume
