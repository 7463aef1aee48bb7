// SPDX-License-Identifier: GPL-2.0-or-later
#include "pieces.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "angio/base/errors.hpp"

namespace angio::volume {
namespace {

constexpr std::uint8_t kSeen = 2;  // Beside 0 and 1, while pieces are walked.

// All voxels connected to `first` that have its value; they become kSeen.
void collectPiece(VoxelMask& mask, const Eigen::Vector3i& first, bool by_corners, std::vector<Eigen::Vector3i>& piece) {
  piece.assign(1, first);
  std::uint8_t& value = mask.inside[mask.grid.offset(first)];
  const std::uint8_t wanted = value;
  value = kSeen;
  for (std::size_t i = 0; i < piece.size(); ++i) {
    for (int k = 0; k < 27; ++k) {
      const Eigen::Vector3i step(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      if (!by_corners && step.cwiseAbs().sum() != 1) continue;
      const Eigen::Vector3i next = piece[i] + step;
      if (!mask.grid.holds(next)) continue;
      std::uint8_t& its_value = mask.inside[mask.grid.offset(next)];
      if (its_value != wanted) continue;
      its_value = kSeen;
      piece.push_back(next);
    }
  }
}

// visit(voxel, offset) for all voxels of a value, as they are when it comes to them.
void forEachOf(VoxelMask& mask, std::uint8_t value, const std::function<void(const Eigen::Vector3i&)>& visit) {
  std::size_t at = 0;
  Eigen::Vector3i v;
  for (v.z() = 0; v.z() < mask.grid.size.z(); ++v.z()) {
    for (v.y() = 0; v.y() < mask.grid.size.y(); ++v.y()) {
      for (v.x() = 0; v.x() < mask.grid.size.x(); ++v.x(), ++at) {
        if (mask.inside[at] == value) visit(v);
      }
    }
  }
}

using Pieces = std::vector<std::vector<std::size_t>>;  // Offsets of the voxels of each.

// Takes the pieces out of the mask.
Pieces takePieces(VoxelMask& mask) {
  Pieces pieces;
  std::vector<Eigen::Vector3i> piece;
  forEachOf(mask, 1, [&](const Eigen::Vector3i& first) {
    collectPiece(mask, first, true, piece);
    auto& offsets = pieces.emplace_back();
    for (const auto& v : piece) offsets.push_back(mask.grid.offset(v));
  });
  std::fill(mask.inside.begin(), mask.inside.end(), std::uint8_t{0});
  return pieces;
}

// The inside voxel nearest to a seed, within two voxels.
std::size_t voxelOfSeed(const VoxelMask& mask, const Eigen::Vector3d& seed_m) {
  const Eigen::Vector3d index = mask.grid.indexAt(seed_m);
  const std::string text =
      formatValue(seed_m.x() * 1e3) + "," + formatValue(seed_m.y() * 1e3) + "," + formatValue(seed_m.z() * 1e3);
  // Far away it would not even be an integer.
  if (!(index.cwiseAbs().maxCoeff() < 1e6)) throw InputError("volume", "seed", text, "must lie in the volume");
  const Eigen::Vector3i middle = index.array().round().cast<int>();
  double nearest = 1e300;
  std::size_t found = 0;
  for (int k = 0; k < 125; ++k) {
    const Eigen::Vector3i v = middle + Eigen::Vector3i(k % 5 - 2, k / 5 % 5 - 2, k / 25 - 2);
    if (!mask.grid.holds(v) || mask.inside[mask.grid.offset(v)] != 1) continue;
    const double distance = (v.cast<double>() - index).cwiseProduct(mask.grid.spacing_m).norm();
    if (distance < nearest) {
      nearest = distance;
      found = mask.grid.offset(v);
    }
  }
  if (nearest == 1e300) throw InputError("volume", "seed", text, "must lie in a vessel, or within two voxels of one");
  return found;
}

}  // namespace

void selectPieces(VoxelMask& mask, const SelectionSettings& selection, const std::vector<Eigen::Vector3d>& seeds_m) {
  std::vector<std::size_t> seeds;
  for (const auto& seed_m : seeds_m) seeds.push_back(voxelOfSeed(mask, seed_m));
  if (!seeds.empty()) {
    std::vector<std::uint8_t> wanted(mask.inside.size(), 0);
    for (const std::size_t seed : seeds) wanted[seed] = 1;
    selectTouched(mask, wanted);
  }
  Pieces pieces = takePieces(mask);
  std::stable_sort(pieces.begin(), pieces.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  if (selection.max_pieces > 0 && pieces.size() > static_cast<std::size_t>(selection.max_pieces)) {
    pieces.resize(static_cast<std::size_t>(selection.max_pieces));
  }
  const double voxel_mm3 = 1e9 * mask.grid.spacing_m.prod();
  for (const auto& piece : pieces) {
    if (static_cast<double>(piece.size()) * voxel_mm3 < selection.smallest_piece_mm3) continue;
    for (const std::size_t at : piece) mask.inside[at] = 1;
  }
}

void selectTouched(VoxelMask& mask, const std::vector<std::uint8_t>& wanted) {
  for (const auto& piece : takePieces(mask)) {
    if (std::none_of(piece.begin(), piece.end(), [&](std::size_t at) { return wanted[at] != 0; })) continue;
    for (const std::size_t at : piece) mask.inside[at] = 1;
  }
}

void fillHoles(VoxelMask& mask) {
  // The open outside becomes kSeen, from all voxels of the border.
  std::vector<Eigen::Vector3i> piece;
  forEachOf(mask, 0, [&](const Eigen::Vector3i& v) {
    const bool at_border = (v.array() == 0).any() || (v.array() == mask.grid.size.array() - 1).any();
    if (at_border) collectPiece(mask, v, false, piece);
  });
  for (std::uint8_t& value : mask.inside) value = value == kSeen ? 0 : 1;
}

}  // namespace angio::volume
