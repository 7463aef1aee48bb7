// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vtkSmartPointer.h>
#include <vtkXMLDataElement.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// The elements of this name right under another, in their order.
std::vector<vtkXMLDataElement*> childrenOf(vtkXMLDataElement& parent, const char* name);

/// The elements of an XML document, with VTK's parser. It may end in VTK's <AppendedData>, which is no XML any more.
class XmlDocument {
 public:
  /// Throws InputError "path:line: ..." for broken XML, document types (they can define entities that explode) more
  /// than 2000 tags and tags beyond 64 KiB.
  XmlDocument(std::string path, std::string content);

  vtkXMLDataElement& root() const { return *root_; }
  const std::string& path() const { return path_; }
  std::string placeOf(vtkXMLDataElement& element) const;  ///< "path:line".

  /// What stands between the start of an element and the next tag.
  std::string_view textOf(vtkXMLDataElement& element) const;

  /// What stands behind the underscore of <AppendedData>, up to the end of the file.
  std::optional<std::string_view> appendedData() const;

  /// An attribute; throws InputError when it is missing.
  std::string need(vtkXMLDataElement& element, const char* attribute) const;

 private:
  std::string path_;
  std::string content_;
  vtkSmartPointer<vtkXMLDataElement> root_;
};

/// The numbers of a <DataArray> of a VTK XML file: ascii, binary or appended, compressed with zlib or not.
///
/// VTK's own reader believes the counts and sizes in a file; here each is held against what the file can hold before
/// memory is taken. Throws InputError when there are not `count` numbers.
std::vector<double> readVtkArray(const XmlDocument& document, vtkXMLDataElement& array, std::size_t count);

}  // namespace angio::io
