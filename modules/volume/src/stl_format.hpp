// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vtkPolyData.h>
#include <vtkSmartPointer.h>

#include <string>

#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// The triangles of an STL file, binary or text; corners that coincide are one point. Throws InputError.
vtkSmartPointer<vtkPolyData> readStl(const std::string& path);

}  // namespace angio::volume
