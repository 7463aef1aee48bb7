// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// An element of an XML document, without its text.
struct XmlElement {
  std::string name;
  std::vector<std::pair<std::string, std::string>> attributes;
  std::vector<XmlElement> children;
  std::size_t at = 0;  ///< Where its tag begins in the document [bytes].

  /// An attribute's value; null when it has none of this name.
  const std::string* attribute(std::string_view wanted) const;
  /// The first element of this name right under it, or null; and all of them, in their order.
  const XmlElement* child(std::string_view wanted) const;
  std::vector<const XmlElement*> childrenOf(std::string_view wanted) const;
};

/// What a document may be beyond a small one that declares nothing.
struct XmlBounds {
  int max_tags = 2000;
  std::string_view declaration = {};  ///< The one document type that may be declared, as "<!DOCTYPE NAME>".
};

/// The elements of an XML document, by Expat. It may end in VTK's AppendedData, which is no XML any more.
class XmlDocument {
 public:
  /// Throws InputError "path:line: ..." for broken XML, other document types (they can define entities that explode),
  /// more tags, tags beyond 64 KiB and elements nested deeper than 100.
  XmlDocument(std::string path, std::string content, const XmlBounds& bounds = {});

  const XmlElement& root() const { return root_; }
  const std::string& path() const { return path_; }
  std::string placeOf(const XmlElement& element) const;  ///< "path:line".

  /// What stands between the start of an element and the next tag.
  std::string_view textOf(const XmlElement& element) const;

  /// What stands behind the underscore of AppendedData, up to the end of the file.
  std::optional<std::string_view> appendedData() const;

  /// An attribute; throws InputError when it is missing.
  std::string need(const XmlElement& element, const char* attribute) const;

 private:
  std::string path_;
  std::string content_;
  XmlElement root_;
};

/// The numbers of a DataArray of a VTK XML file: ascii, binary or appended, compressed with zlib or not.
///
/// VTK's own reader believes the counts and sizes in a file; here each is held against what the file can hold before
/// memory is taken. Throws InputError when there are not `count` numbers.
std::vector<double> readVtkArray(const XmlDocument& document, const XmlElement& array, std::size_t count);

}  // namespace angio::io
