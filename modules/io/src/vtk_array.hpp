// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "xml.hpp"

namespace angio::io {

/// The numbers of a <DataArray> of a VTK XML file: ascii, binary or appended, compressed with zlib or not.
///
/// VTK's own reader believes the counts and sizes in a file; here each is held against what the file can hold before
/// memory is taken. Throws InputError when there are not `count` numbers.
std::vector<double> readVtkArray(const XmlDocument& document, vtkXMLDataElement& array, std::size_t count);

}  // namespace angio::io
