// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/labels.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"

namespace angio::volume {
namespace {

constexpr float kLargestLabel = 1 << 24;  // Beyond it not every whole number is a float.
constexpr std::size_t kMaxLabels = 255;   // Of a label map: a file of bytes has no more.
constexpr double kSameAsNeighbor = 0.9;   // Of a label map, at least; masks of thin vessels have 0.99.
constexpr std::size_t kListed = 30;

bool isWhole(float value) { return std::abs(value) <= kLargestLabel && value == std::floor(value); }

}  // namespace

std::vector<LabelSize> labelsIn(const Volume& volume) {
  std::map<int, std::size_t> counts;
  const auto& values = volume.values;
  for (std::size_t first = 0, end = 0; first < values.size(); first = end) {
    while (end < values.size() && values[end] == values[first]) ++end;  // A run at once: there are few of them.
    end = std::max(end, first + 1);                                     // Not a number is not equal to itself.
    if (isWhole(values[first]) && values[first] != 0) counts[static_cast<int>(values[first])] += end - first;
  }
  const double voxel_m3 = volume.grid.spacing_m.prod();
  std::vector<LabelSize> labels;
  for (const auto& [label, voxels] : counts) labels.push_back({label, voxels, voxel_m3 * static_cast<double>(voxels)});
  return labels;
}

bool isLabelMap(const Volume& volume) {
  const auto& values = volume.values;
  if (values.size() < 2) return false;
  std::size_t same = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!isWhole(values[i]) || values[i] < 0) return false;
    same += i > 0 && values[i] == values[i - 1];
  }
  if (static_cast<double>(same) < kSameAsNeighbor * static_cast<double>(values.size() - 1)) return false;
  const std::size_t labels = labelsIn(volume).size();
  return labels > 0 && labels <= kMaxLabels;
}

std::string listOfLabels(std::vector<LabelSize> labels) {
  const std::size_t all = labels.size();
  if (all > kListed) {
    std::stable_sort(labels.begin(), labels.end(), [](const auto& a, const auto& b) { return a.voxels > b.voxels; });
    labels.resize(kListed);
  }
  std::string list;
  for (const LabelSize& one : labels) {
    list += (list.empty() ? "" : ", ") + std::to_string(one.label) + formatted(" (%.2f ml)", 1e6 * one.volume_m3);
  }
  return all > kListed ? list + " and " + std::to_string(all - kListed) + " smaller ones" : list;
}

void requireLabels(const std::string& path, const Volume& volume, const std::vector<int>& wanted) {
  const std::vector<LabelSize> labels = labelsIn(volume);
  for (const int label : wanted) {
    if (label == 0) continue;  // What has no label may be asked for too.
    if (std::any_of(labels.begin(), labels.end(), [&](const LabelSize& one) { return one.label == label; })) continue;
    throw InputError(path, "--label", std::to_string(label),
                     labels.empty() ? "is not in the volume, which has no labels"
                                    : "is not in the volume, which has " + listOfLabels(labels));
  }
}

}  // namespace angio::volume
