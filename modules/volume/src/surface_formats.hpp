// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/io/surface_files.hpp"
#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// The triangles of an STL file, binary or text, each with corners of its own. Throws InputError.
Surface readStlSurface(const std::string& path);

/// The polygons of a Wavefront OBJ file; normals, textures, materials and lines are passed over. Throws InputError that
/// names file and line.
Surface readObjSurface(const std::string& path);

/// Reads the polygons and triangle strips of VTK's legacy poly data (.vtk, versions 1 to 5), text or binary; vertices
/// and lines are passed over, and the data of points and cells, which stand last, are not looked at. VTK's own reader
/// believes what a file says of itself, and falls over it. Throws InputError as readVtpSurface.
Surface readVtkSurface(const std::string& path);

}  // namespace angio::volume
