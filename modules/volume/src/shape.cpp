// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/base/errors.hpp"
#include "angio/volume/level_field.hpp"
#include "pieces.hpp"

namespace angio::volume {
namespace {

constexpr int kMargin = 2;  // Voxels around the vessels' box, so that they have an outside everywhere.

struct Box {
  Eigen::Vector3i low, high;
};

Box boxOf(const VoxelMask& mask) {
  Box box{Eigen::Vector3i::Constant(std::numeric_limits<int>::max()), Eigen::Vector3i::Constant(-1)};
  std::size_t at = 0;
  Eigen::Vector3i v;
  for (v.z() = 0; v.z() < mask.grid.size.z(); ++v.z()) {
    for (v.y() = 0; v.y() < mask.grid.size.y(); ++v.y()) {
      for (v.x() = 0; v.x() < mask.grid.size.x(); ++v.x(), ++at) {
        if (!mask.inside[at]) continue;
        box.low = box.low.cwiseMin(v);
        box.high = box.high.cwiseMax(v);
      }
    }
  }
  if (box.high.x() < 0)
    throw InputError("volume", "vessels", "", "nothing is left of them: see threshold, labels and selection");
  return box;
}

VoxelMask cropped(const VoxelMask& mask, const Box& box) {
  VoxelMask small;
  small.grid = mask.grid;
  small.grid.size = (box.high - box.low).array() + 1 + 2 * kMargin;
  small.grid.origin_m = mask.grid.pointAt((box.low.array() - kMargin).cast<double>().matrix());
  small.inside.assign(small.grid.count(), 0);
  Eigen::Vector3i v;
  for (v.z() = box.low.z(); v.z() <= box.high.z(); ++v.z()) {
    for (v.y() = box.low.y(); v.y() <= box.high.y(); ++v.y()) {
      for (v.x() = box.low.x(); v.x() <= box.high.x(); ++v.x()) {
        const Eigen::Vector3i to = (v - box.low).array() + kMargin;
        small.inside[small.grid.offset(to)] = mask.inside[mask.grid.offset(v)];
      }
    }
  }
  return small;
}

// The wanted pieces without holes, in their box.
VoxelMask cleaned(VoxelMask mask, const SelectionSettings& selection, const std::vector<Eigen::Vector3d>& seeds_m,
                  Box& box) {
  selectPieces(mask, selection, seeds_m);
  box = boxOf(mask);
  VoxelMask small = cropped(mask, box);
  fillHoles(small);
  return small;
}

template <typename Test>
VoxelMask maskWhere(const Volume& volume, const Test& test) {
  VoxelMask mask{volume.grid, std::vector<std::uint8_t>(volume.values.size())};
  for (std::size_t i = 0; i < volume.values.size(); ++i) mask.inside[i] = test(volume.values[i]) ? 1 : 0;
  return mask;
}

Volume shapeBy(const LabelSettings& s, const Volume& volume, const SelectionSettings& selection,
               const std::vector<Eigen::Vector3d>& seeds_m) {
  return vesselShape(maskWhere(volume,
                               [&](float value) {
                                 if (s.labels.empty()) return value != 0;
                                 return std::any_of(s.labels.begin(), s.labels.end(),
                                                    [&](int label) { return value == static_cast<float>(label); });
                               }),
                     selection, seeds_m);
}

Volume shapeBy(const ThresholdSettings& s, const Volume& volume, const SelectionSettings& selection,
               const std::vector<Eigen::Vector3d>& seeds_m) {
  const auto threshold = static_cast<float>(s.threshold);
  const float sign = s.inside == Inside::kAbove ? 1.0F : -1.0F;
  Box box;
  const VoxelMask mask =
      cleaned(maskWhere(volume, [&](float value) { return sign * (value - threshold) > 0; }), selection, seeds_m, box);
  Volume level = cropped(volume, box.low, box.high, kMargin, std::numeric_limits<float>::quiet_NaN());
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

Volume shapeBy(const VesselnessSettings& s, const Volume& volume, const SelectionSettings& selection,
               const std::vector<Eigen::Vector3d>& seeds_m) {
  const Volume tubes{volume.grid, vesselness(volume, s)};
  const auto weak = static_cast<float>(s.weak), strong = static_cast<float>(s.strong);
  VoxelMask mask = maskWhere(tubes, [&](float value) { return value > weak; });
  selectTouched(mask, maskWhere(tubes, [&](float value) { return value > strong; }).inside);
  return vesselShape(std::move(mask), selection, seeds_m);
}

}  // namespace

Volume vesselShape(VoxelMask mask, const SelectionSettings& selection, const std::vector<Eigen::Vector3d>& seeds_m) {
  Box box;
  return signedDistance(cleaned(std::move(mask), selection, seeds_m, box));
}

Volume vesselShape(const Volume& volume, const ShapeSettings& settings, const SelectionSettings& selection,
                   const std::vector<Eigen::Vector3d>& seeds_m) {
  return std::visit([&](const auto& s) { return shapeBy(s, volume, selection, seeds_m); }, settings);
}

}  // namespace angio::volume
