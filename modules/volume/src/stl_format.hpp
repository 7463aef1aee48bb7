// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vtkPolyData.h>
#include <vtkSmartPointer.h>

#include <string>

namespace angio {

/// The triangles of an STL file, binary or text; corners that coincide are one point. Throws InputError.
vtkSmartPointer<vtkPolyData> readStl(const std::string& path);

}  // namespace angio
