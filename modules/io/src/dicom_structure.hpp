// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// How a DICOM file codes its pixels.
enum class DicomCompression { kNone, kJpeg, kRunLength };

/// One transfer syntax that is read.
struct DicomSyntax {
  const char* uid;
  const char* name;
  bool explicit_vr;
  bool big_endian;
  DicomCompression compression;
};

/// Whether a file begins as DICOM files do: 128 bytes, then DICM.
bool startsAsDicom(const std::string& content);

/// Walks over every element of a DICOM file, nested ones too, and returns its transfer syntax.
///
/// DCMTK takes memory by what lengths say and descends as deep as sequences do. After this walk each length lies inside
/// what holds it, each container is closed, nothing is nested deeper than 16, and there are at most a million elements:
/// DCMTK's memory is then bounded by the file's size. Throws InputError that names `path` and the place of what is
/// wrong, or the transfer syntax when it is none of those that are read.
const DicomSyntax& checkDicomStructure(const std::string& path, const std::string& content);

}  // namespace angio::io
