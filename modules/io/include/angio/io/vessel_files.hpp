// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/io/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::io {

/// Reads a vessel tree; lengths are millimetres in every file. The extension (in any case) is the choice of the format:
///
/// - `.csv`: `id,x_mm,y_mm,z_mm,radius_mm,parent`; ids are any integers, parent -1 at a root, radius blank if unknown.
///   With a column `frame`, LPS or RAS in all rows, points in RAS are turned to LPS.
/// - `.swc`: `id type x y z radius parent`, `#` begins a comment; a radius that is not positive is unknown.
/// - `.vtp`: VMTK centrelines: polylines from one source to many outlets with MaximumInscribedSphereRadius. The
///   trunk that the lines repeat, exactly or to a tenth of its radius, becomes one.
/// - `.vtk`: lines of VTK's legacy text (versions 1 to 4; an unstructured grid's cells or poly data's lines), in any
///   order and direction; where ends coincide they are joined, and the first begins at the inlet. Radii are not read.
/// - `.mrk.json`: 3D Slicer's markups: open curves in any order and direction, joined where their ends coincide; the
///   first begins at the inlet. Radii are those of a measurement "Radius". Curves that say RAS are turned to LPS.
/// - `.tre`: tubes of ITK's spatial objects (TubeTK) as text, each with its own place, linked by ParentID and
///   ParentPoint. A radius that is not positive is unknown.
/// - `.txt`: centreline of the HMM catheter project: points with their neighbours, walked from the given root.
///
/// - A folder: the curves of all its `.mrk.json` files as one tree; see joinedCurves. The first file's begins at the
///   inlet.
///
/// Points stand in the order of the file (.vtp and .vtk: line by line, without repetitions). Throws InputError that
/// names file, line, field, value and rule.
VesselTree readVesselTree(const std::string& path);

/// Patient axes of a file: x to the left and y to the back (DICOM, ITK), or to the right and front (VMTK, 3D Slicer's
/// scene). z is to the head in both.
enum class PatientFrame { kLps, kRas };

/// Whether the tree's file says which patient axes it is in, so that readVesselTree() returns LPS: all markups, and
/// .csv with a column `frame`. Other trees are read as they stand. Throws InputError.
bool saysItsFrame(const std::string& path);

/// A tree with x and y turned around: LPS as RAS, and RAS as LPS.
VesselTree withOtherFrame(const VesselTree& tree);

/// Writes `.csv`, `.swc`, `.vtp` (lines from root to end, as VMTK's; radius 0 is unknown), `.mrk.json` (a curve a
/// branch) or `.tre` (a tube a branch), by extension. Ids are point indices (from 0; from 1 in .swc). Lengths have as
/// many digits as it takes to read the same number back.
///
/// With `frame` the tree is in LPS and is written in `frame`, which .csv and .mrk.json say; without it points are
/// written as they are, which .mrk.json calls LPS. Throws InputError for another extension or when the file cannot be
/// written.
void writeVesselTree(const std::string& path, const VesselTree& tree, std::optional<PatientFrame> frame = {});

}  // namespace angio::io
