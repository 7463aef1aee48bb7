// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/xml.hpp"

#include <expat.h>

#include <algorithm>
#include <memory>
#include <type_traits>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"

namespace angio::io {
namespace {

// An element's children go with it recursively, so that their depth bounds the stack.
constexpr std::size_t kMaxDepth = 100;
// A tag of ours has some hundred bytes.
constexpr std::size_t kMaxTag = std::size_t{1} << 16;
constexpr std::string_view kAppendedData = "<AppendedData";

int lineAt(std::string_view content, std::size_t position) {
  return 1 + static_cast<int>(std::count(content.begin(), content.begin() + position, '\n'));
}

// The length of the tag (or comment) that begins the text.
std::size_t tagLength(std::string_view text) {
  const std::pair<std::string_view, std::string_view> brackets[] = {
      {"<!--", "-->"}, {"<![CDATA[", "]]>"}, {"<?", "?>"}};
  for (const auto& [begin, end] : brackets) {
    if (text.substr(0, begin.size()) != begin) continue;
    const auto at = text.find(end, begin.size());
    return at == std::string_view::npos ? text.size() : at + end.size();
  }
  char quote = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (quote ? text[i] == quote : text[i] == '"' || text[i] == '\'') {
      quote = quote ? '\0' : text[i];
    } else if (!quote && text[i] == '>') {
      return i + 1;
    }
  }
  return text.size();
}

void requireTame(const std::string& path, std::string_view content, const XmlBounds& bounds) {
  const std::string_view markup = content.substr(0, content.find(kAppendedData));
  const auto nul = markup.find('\0');
  if (nul != std::string_view::npos) {
    throw InputError(atLine(path, lineAt(content, nul)), "byte", "0", "must be XML text");
  }
  for (const std::string_view forbidden : {"<!DOCTYPE", "<!ENTITY"}) {
    auto at = markup.find(forbidden);
    if (at != std::string_view::npos && !bounds.declaration.empty() &&
        markup.substr(at, bounds.declaration.size()) == bounds.declaration) {
      at = markup.find(forbidden, at + 1);
    }
    if (at == std::string_view::npos) continue;
    throw InputError(atLine(path, lineAt(content, at)), "", std::string(forbidden), "must not be used here");
  }
  const auto place = [&](std::size_t position) { return atLine(path, lineAt(content, position)); };
  int tags = 0;
  for (auto at = markup.find('<'); at != std::string_view::npos;) {
    const std::size_t length = tagLength(markup.substr(at));
    if (length > kMaxTag) throw InputError(place(at), "tag", std::to_string(length), "must not exceed 65,536 bytes");
    if (++tags > bounds.max_tags) {
      throw InputError(place(at), "tags", std::to_string(tags), "must not exceed " + std::to_string(bounds.max_tags));
    }
    at = markup.find('<', at + length);
  }
}

// Gathers the elements that Expat reports, below `top`.
struct Gathering {
  XmlElement top;
  // From the outside in. Elements move with their sisters once they are closed only.
  std::vector<XmlElement*> open = {&top};
  bool appended = false, deep = false;
  XML_Parser parser = nullptr;

  static void XMLCALL begin(void* self, const XML_Char* name, const XML_Char** attributes) {
    auto& all = *static_cast<Gathering*>(self);
    XmlElement& element = all.open.back()->children.emplace_back();
    element.name = name;
    for (; *attributes; attributes += 2) element.attributes.emplace_back(attributes[0], attributes[1]);
    element.at = static_cast<std::size_t>(XML_GetCurrentByteIndex(all.parser));
    all.open.push_back(&element);
    if (all.open.size() > kMaxDepth) {
      all.deep = true;
      XML_StopParser(all.parser, XML_FALSE);
    }
    if (element.name != kAppendedData.substr(1)) return;
    all.appended = true;
    XML_StopParser(all.parser, XML_FALSE);
  }
  static void XMLCALL end(void* self, const XML_Char*) { static_cast<Gathering*>(self)->open.pop_back(); }
};

// Where what is XML ends: behind the tag of <AppendedData>.
std::string_view markupOf(std::string_view content) {
  const auto appended = content.find(kAppendedData);
  if (appended == std::string_view::npos) return content;
  return content.substr(0, appended + tagLength(content.substr(appended)));
}

}  // namespace

const std::string* XmlElement::attribute(std::string_view wanted) const {
  for (const auto& [its_name, value] : attributes) {
    if (its_name == wanted) return &value;
  }
  return nullptr;
}

const XmlElement* XmlElement::child(std::string_view wanted) const {
  for (const XmlElement& element : children) {
    if (element.name == wanted) return &element;
  }
  return nullptr;
}

std::vector<const XmlElement*> XmlElement::childrenOf(std::string_view wanted) const {
  std::vector<const XmlElement*> found;
  for (const XmlElement& element : children) {
    if (element.name == wanted) found.push_back(&element);
  }
  return found;
}

XmlDocument::XmlDocument(std::string path, std::string content, const XmlBounds& bounds)
    : path_(std::move(path)), content_(std::move(content)) {
  requireTame(path_, content_, bounds);
  const std::string_view markup = markupOf(content_);
  const std::unique_ptr<std::remove_pointer_t<XML_Parser>, decltype(&XML_ParserFree)> parser(XML_ParserCreate(nullptr),
                                                                                             XML_ParserFree);
  Gathering all;
  all.parser = parser.get();
  XML_SetUserData(parser.get(), &all);
  XML_SetElementHandler(parser.get(), Gathering::begin, Gathering::end);
  const bool parsed =
      XML_Parse(parser.get(), markup.data(), static_cast<int>(markup.size()), XML_TRUE) == XML_STATUS_OK;
  if (all.deep) {
    throw InputError(atLine(path_, static_cast<int>(XML_GetCurrentLineNumber(parser.get()))), "elements", "",
                     "must not be nested deeper than " + std::to_string(kMaxDepth));
  }
  if ((!parsed && !all.appended) || all.top.children.empty()) {
    throw InputError(atLine(path_, static_cast<int>(XML_GetCurrentLineNumber(parser.get()))), "", "",
                     std::string("is not valid XML: ") + XML_ErrorString(XML_GetErrorCode(parser.get())));
  }
  root_ = std::move(all.top.children.front());
}

std::string XmlDocument::placeOf(const XmlElement& element) const {
  return atLine(path_, lineAt(content_, element.at));
}

std::string_view XmlDocument::textOf(const XmlElement& element) const {
  const std::string_view content = content_;
  char quote = 0;
  for (std::size_t i = element.at; i < content.size(); ++i) {
    if (quote) {
      if (content[i] == quote) quote = 0;
    } else if (content[i] == '"' || content[i] == '\'') {
      quote = content[i];
    } else if (content[i] == '>') {
      if (content[i - 1] == '/') return {};
      const std::string_view rest = content.substr(i + 1);
      return rest.substr(0, rest.find('<'));
    }
  }
  return {};
}

std::optional<std::string_view> XmlDocument::appendedData() const {
  const std::string_view content = content_;
  const auto element = content.find(kAppendedData);
  if (element == std::string_view::npos) return std::nullopt;
  const auto end = content.find('>', element);
  if (end == std::string_view::npos) return std::nullopt;
  const auto first = content.find_first_not_of(" \t\r\n", end + 1);
  if (first == std::string_view::npos || content[first] != '_') return std::nullopt;
  return content.substr(first + 1);
}

std::string XmlDocument::need(const XmlElement& element, const char* attribute) const {
  const std::string* const value = element.attribute(attribute);
  if (!value) throw InputError(placeOf(element), element.name + "." + attribute, "", "is missing");
  return *value;
}

}  // namespace angio::io
