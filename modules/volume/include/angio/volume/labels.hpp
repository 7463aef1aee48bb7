// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// How much of a volume has a label.
struct LabelSize {
  int label = 0;
  std::size_t voxels = 0;
  double volume_m3 = 0;
};

/// The labels of a volume: its whole values but 0, the smallest first. Values that are not whole are passed over.
std::vector<LabelSize> labelsIn(const Volume& volume);

/// Whether a volume shows labels and not an image: whole values from 0 up, no more than 255 but 0, and nearly all
/// voxels with the value of their neighbour, which noise would not leave.
bool isLabelMap(const Volume& volume);

/// Returns the labels with their volumes, as "1 (3.20 ml), 2 (0.45 ml)"; of many the largest 30 and how many more.
std::string listOfLabels(std::vector<LabelSize> labels);

/// Throws InputError, which lists the labels there are, when one of `wanted` is not in the volume.
///
/// @param path  Name of the volume, for the message.
void requireLabels(const std::string& path, const Volume& volume, const std::vector<int>& wanted);

}  // namespace angio::volume
