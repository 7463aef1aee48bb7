// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/volume/level_field.hpp"

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

using Pieces = std::vector<std::vector<std::size_t>>;  // Offsets of the voxels of each.

// Takes the pieces out of the mask.
Pieces takePieces(VoxelMask& mask) {
  Pieces pieces;
  std::vector<Eigen::Vector3i> piece;
  forEachVoxel(mask.grid.size, [&](const Eigen::Vector3i& first, std::size_t at) {
    if (mask.inside[at] != 1) return;
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

// Takes away the pieces that hold none of the `wanted` voxels (hysteresis).
void selectTouched(VoxelMask& mask, const std::vector<std::uint8_t>& wanted) {
  for (const auto& piece : takePieces(mask)) {
    if (std::none_of(piece.begin(), piece.end(), [&](std::size_t at) { return wanted[at] != 0; })) continue;
    for (const std::size_t at : piece) mask.inside[at] = 1;
  }
}

// Of a piece's voxels [m].
Eigen::Vector3d centroidOf(const VoxelGrid& grid, const std::vector<std::size_t>& piece) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const auto row = static_cast<std::size_t>(grid.size.x()), layer = row * static_cast<std::size_t>(grid.size.y());
  for (const std::size_t at : piece) {
    sum += Eigen::Vector3d(static_cast<double>(at % row), static_cast<double>(at % layer / row),
                           static_cast<double>(at / layer));
  }
  return grid.pointAt(sum / static_cast<double>(piece.size()));
}

// Takes away the connected pieces (26 neighbours) that the settings and seeds [m] do not want. Throws InputError when
// a seed lies in no piece. Returns what is too small.
std::vector<Repair> selectPieces(VoxelMask& mask, const SelectionSettings& selection,
                                 const std::vector<Eigen::Vector3d>& seeds_m) {
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
  std::vector<Repair> small;
  for (const auto& piece : pieces) {  // The largest first.
    const double volume_mm3 = static_cast<double>(piece.size()) * voxel_mm3;
    if (volume_mm3 >= selection.min_piece_mm3) {
      for (const std::size_t at : piece) mask.inside[at] = 1;
    } else if (small.empty()) {
      small.push_back({Flaw::kSmallPiece, centroidOf(mask.grid, piece), 0, std::cbrt(0.75 * volume_mm3 / kPi) / 1e3, 1,
                       "dropped, below " + formatValue(selection.min_piece_mm3) + " mm3 (min_piece_mm3)"});
    } else {
      ++small.front().count;
    }
  }
  return small;
}

constexpr int kMargin = 2;  // Voxels around the vessels' box, so that they have an outside everywhere.

struct Box {
  Eigen::Vector3i low, high;
};

Box boxOf(const VoxelMask& mask) {
  Box box{Eigen::Vector3i::Constant(std::numeric_limits<int>::max()), Eigen::Vector3i::Constant(-1)};
  forEachVoxel(mask.grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    if (!mask.inside[at]) return;
    box.low = box.low.cwiseMin(v);
    box.high = box.high.cwiseMax(v);
  });
  if (box.high.x() < 0)
    throw InputError("volume", "vessels", "", "nothing is left of them: see threshold, labels and selection");
  return box;
}

// The values in a box that begins at `first`; where it reaches out of the grid they are `outside`.
template <typename Value>
std::vector<Value> valuesIn(const VoxelGrid& box, const Eigen::Vector3i& first, const VoxelGrid& grid,
                            const std::vector<Value>& values, Value outside) {
  std::vector<Value> result(box.count(), outside);
  const Eigen::Vector3i from = first.cwiseMax(0), to = (first + box.size).cwiseMin(grid.size);
  if ((from.array() >= to.array()).any()) return result;
  for (int z = from.z(); z < to.z(); ++z) {
    for (int y = from.y(); y < to.y(); ++y) {
      const Value* const row = &values[grid.offset({from.x(), y, z})];
      std::copy(row, row + (to.x() - from.x()), &result[box.offset(Eigen::Vector3i(from.x(), y, z) - first)]);
    }
  }
  return result;
}

VoxelGrid boxIn(const VoxelGrid& grid, const Box& box, int margin) {
  VoxelGrid result = grid;
  result.size = (box.high - box.low).array() + 1 + 2 * margin;
  result.origin_m = grid.pointAt((box.low.array() - margin).cast<double>().matrix());
  return result;
}

// The wanted pieces without holes, in their box.
struct Cleaned {
  Box box;
  VoxelMask mask;
  std::vector<Repair> repairs;
};

Cleaned cleaned(VoxelMask mask, const SelectionSettings& selection, const std::vector<Eigen::Vector3d>& seeds_m) {
  Cleaned result;
  result.repairs = selectPieces(mask, selection, seeds_m);
  const Box box = result.box = boxOf(mask);
  VoxelMask& small = result.mask = {boxIn(mask.grid, box, kMargin), {}};
  small.inside = valuesIn(small.grid, box.low.array() - kMargin, mask.grid, mask.inside, std::uint8_t{0});
  fillHoles(small);
  return result;
}

template <typename Test>
VoxelMask maskWhere(const Volume& volume, const Test& test) {
  VoxelMask mask{volume.grid, std::vector<std::uint8_t>(volume.values.size())};
  for (std::size_t i = 0; i < volume.values.size(); ++i) mask.inside[i] = test(volume.values[i]) ? 1 : 0;
  return mask;
}

VesselShape shapeBy(const LabelSettings& s, const Volume& volume, const SelectionSettings& selection,
                    const std::vector<Eigen::Vector3d>& seeds_m) {
  return vesselShape(maskWhere(volume,
                               [&](float value) {
                                 if (s.labels.empty()) return value != 0;
                                 return std::any_of(s.labels.begin(), s.labels.end(),
                                                    [&](int label) { return value == static_cast<float>(label); });
                               }),
                     selection, seeds_m);
}

VesselShape shapeBy(const ThresholdSettings& s, const Volume& volume, const SelectionSettings& selection,
                    const std::vector<Eigen::Vector3d>& seeds_m) {
  const auto threshold = static_cast<float>(s.threshold);
  const float sign = s.inside == Inside::kAbove ? 1.0F : -1.0F;
  Cleaned vessels =
      cleaned(maskWhere(volume, [&](float value) { return sign * (value - threshold) > 0; }), selection, seeds_m);
  const Box& box = vessels.box;
  const VoxelMask& mask = vessels.mask;
  VesselShape level{cropped(volume, box.low, box.high, kMargin, std::numeric_limits<float>::quiet_NaN()),
                    std::move(vessels.repairs)};
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < level.values.size(); ++i) {
    const float over = std::abs(level.values[i] - threshold);
    level.values[i] = mask.inside[i] ? over : -over;  // Other pieces are outside, holes are inside.
    if (mask.inside[i]) sum += over, ++count;
  }
  // Beyond the volume there is no value: as far outside as vessels are inside, so that the wall is at its border.
  const auto beyond = static_cast<float>(-sum / count);
  for (float& value : level.values) value = std::isnan(value) ? beyond : value;
  return level;
}

VesselShape shapeBy(const VesselnessSettings& s, const Volume& volume, const SelectionSettings& selection,
                    const std::vector<Eigen::Vector3d>& seeds_m) {
  const Volume tubes{volume.grid, vesselness(volume, s)};
  const auto weak = static_cast<float>(s.weak), strong = static_cast<float>(s.strong);
  VoxelMask mask = maskWhere(tubes, [&](float value) { return value > weak; });
  selectTouched(mask, maskWhere(tubes, [&](float value) { return value > strong; }).inside);
  return vesselShape(std::move(mask), selection, seeds_m);
}

}  // namespace

void fillHoles(VoxelMask& mask) {
  // The open outside becomes kSeen, from all voxels of the border.
  std::vector<Eigen::Vector3i> piece;
  forEachVoxel(mask.grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    if (mask.inside[at] != 0) return;
    const bool at_border = (v.array() == 0).any() || (v.array() == mask.grid.size.array() - 1).any();
    if (at_border) collectPiece(mask, v, false, piece);
  });
  for (std::uint8_t& value : mask.inside) value = value == kSeen ? 0 : 1;
}

Volume cropped(const Volume& volume, const Eigen::Vector3i& low, const Eigen::Vector3i& high, int margin,
               float outside) {
  Volume box{boxIn(volume.grid, {low, high}, margin), {}};
  box.values = valuesIn(box.grid, low.array() - margin, volume.grid, volume.values, outside);
  return box;
}

VesselShape vesselShape(VoxelMask mask, const SelectionSettings& selection,
                        const std::vector<Eigen::Vector3d>& seeds_m) {
  Cleaned vessels = cleaned(std::move(mask), selection, seeds_m);
  return {signedDistance(vessels.mask), std::move(vessels.repairs)};
}

VesselShape vesselShape(const Volume& volume, const ShapeSettings& settings, const SelectionSettings& selection,
                        const std::vector<Eigen::Vector3d>& seeds_m) {
  return std::visit([&](const auto& s) { return shapeBy(s, volume, selection, seeds_m); }, settings);
}

}  // namespace angio::volume
