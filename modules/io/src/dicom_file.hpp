// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcfilefo.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "angio/base/errors.hpp"
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

/// An attribute by group, element and the standard's name.
struct DicomTag {
  std::uint16_t group;
  std::uint16_t element;
  const char* name;

  /// "(0018,1110) Distance Source to Detector".
  std::string label() const;
};

/// A DICOM file in memory, read by DCMTK.
///
/// DCMTK, not GDCM: Debian 12 carries its security fixes as they come, while its GDCM is the upstream release of 2023;
/// it decodes JPEG lossless of 8 to 16 bits; and it gives one frame without decoding the others. Neither can be trusted
/// with a hostile file as it is: the structure is checked before it reads the file, and each frame before it is
/// decoded.
class DicomFile {
 public:
  /// Takes a file's bytes. Throws InputError that names `path` for anything that is no whole DICOM file.
  DicomFile(const std::string& path, std::string content);

  const std::string& path() const { return path_; }
  const DicomSyntax& syntax() const { return *syntax_; }

  /// An attribute's values as text, without blanks around them; none when it is missing or empty. text() gives the
  /// first.
  ///
  /// It is looked for in the frame's own functional groups, then in those that all frames share, then at the top:
  /// the first two exist in enhanced files only.
  std::vector<std::string> texts(const DicomTag& tag, int frame = 0) const;
  std::optional<std::string> text(const DicomTag& tag, int frame = 0) const;

  /// The same as numbers; throws InputError when a value is none.
  std::vector<double> numbers(const DicomTag& tag, int frame = 0) const;
  std::optional<double> number(const DicomTag& tag, int frame = 0) const;

  /// An integer within [low, high], or `otherwise` when it is missing; without `otherwise` it must be there.
  int integer(const DicomTag& tag, int low, int high, std::optional<int> otherwise = {}) const;

  /// The same of an item of a sequence at the top.
  std::vector<DcmItem*> items(const DicomTag& sequence) const;
  std::vector<double> numbers(const DicomTag& tag, DcmItem& item) const;
  std::optional<std::string> text(const DicomTag& tag, DcmItem& item) const;

  /// What is wrong with an attribute, for throwing.
  InputError refusal(const DicomTag& tag, const std::string& value, const std::string& rule) const;

  /// DCMTK reads values on demand and so takes no const; nothing is changed.
  DcmDataset& dataset() const { return *file_.getDataset(); }

 private:
  DcmElement* find(const DicomTag& tag, int frame) const;
  std::vector<std::string> textsOf(const DicomTag& tag, DcmElement* element) const;
  std::vector<double> numbersOf(const DicomTag& tag, DcmElement* element) const;

  std::string path_;
  const DicomSyntax* syntax_;
  mutable DcmFileFormat file_;
};

}  // namespace angio::io
