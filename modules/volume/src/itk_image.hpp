// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <itkImageIOBase.h>

#include <functional>
#include <string>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Runs work of ITK on `path`. What it throws, running out of memory included, becomes an InputError; what it and the
/// libraries below it would print is held back.
void withItk(const std::string& path, const std::function<void()>& work);

/// The grid that an opened image claims, checked: three dimensions (`slices` as the last one's size), one real
/// component, sizes, finite positive spacing, axes at right angles.
VoxelGrid gridOf(const std::string& path, itk::ImageIOBase& image);

/// Reads the voxels of an opened image as floats and refuses those that are not finite. `values` has their number.
void readValues(const std::string& path, itk::ImageIOBase& image, const VoxelGrid& grid, float* values);

}  // namespace angio::volume
