// SPDX-License-Identifier: GPL-2.0-or-later
#include "xml.hpp"

#include <vtkCallbackCommand.h>
#include <vtkNew.h>
#include <vtkXMLDataParser.h>

#include <algorithm>
#include <cstring>
#include <sstream>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"

namespace angio::io {
namespace {

// Elements are taken apart recursively, so that their number bounds the stack; a file of ours has some dozens.
constexpr int kMaxTags = 2000;
// Expat begins a tag again with every piece of the file it is given, which takes the square of its length.
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

void requireTame(const std::string& path, std::string_view content) {
  const std::string_view markup = content.substr(0, content.find(kAppendedData));
  const auto nul = markup.find('\0');
  if (nul != std::string_view::npos) {
    throw InputError(atLine(path, lineAt(content, nul)), "byte", "0", "must be XML text");
  }
  for (const std::string_view forbidden : {"<!DOCTYPE", "<!ENTITY"}) {
    const auto at = markup.find(forbidden);
    if (at == std::string_view::npos) continue;
    throw InputError(atLine(path, lineAt(content, at)), "", std::string(forbidden), "must not be used here");
  }
  const auto place = [&](std::size_t position) { return atLine(path, lineAt(content, position)); };
  int tags = 0;
  for (auto at = markup.find('<'); at != std::string_view::npos;) {
    const std::size_t length = tagLength(markup.substr(at));
    if (length > kMaxTag) throw InputError(place(at), "tag", std::to_string(length), "must not exceed 65,536 bytes");
    if (++tags > kMaxTags) throw InputError(place(at), "tags", std::to_string(tags), "must not exceed 2000");
    at = markup.find('<', at + length);
  }
}

// The parser reports to whoever observes it, and only else to the terminal.
void keepMessage(vtkObject*, unsigned long, void* first_message, void* message) {
  auto& kept = *static_cast<std::string*>(first_message);
  if (kept.empty() && message) kept = static_cast<const char*>(message);
}

InputError brokenXml(const std::string& path, const std::string& message) {
  // "... Error parsing XML in stream at line 3, column 7, byte index 120: mismatched tag"
  const auto at = message.find("at line ");
  if (at == std::string::npos) return InputError(path, "", "", "is not valid XML");
  const std::string line = message.substr(at + 8, message.find_first_not_of("0123456789", at + 8) - at - 8);
  const auto reason = message.find(": ", at) == std::string::npos ? message.size() : message.rfind(": ");
  const std::string why(trimmed(std::string_view(message).substr(reason)));
  return InputError(line.empty() ? path : path + ":" + line, "", "", "is not valid XML" + why);
}

}  // namespace

XmlDocument::XmlDocument(std::string path, std::string content) : path_(std::move(path)), content_(std::move(content)) {
  requireTame(path_, content_);
  std::istringstream stream(content_);
  std::string message;
  vtkNew<vtkCallbackCommand> observer;
  observer->SetCallback(keepMessage);
  observer->SetClientData(&message);
  vtkNew<vtkXMLDataParser> parser;
  parser->AddObserver("ErrorEvent", observer);
  parser->AddObserver("WarningEvent", observer);
  parser->SetStream(&stream);
  parser->SetIgnoreCharacterData(1);  // It would be gathered bit by bit; textOf looks at the file instead.
  const bool parsed = parser->Parse() != 0;
  root_ = parser->GetRootElement();
  if (!parsed || !root_ || !message.empty()) throw brokenXml(path_, message);
}

std::string XmlDocument::placeOf(vtkXMLDataElement& element) const {
  const auto index = std::max<vtkTypeInt64>(element.GetXMLByteIndex(), 0);
  return atLine(path_, lineAt(content_, std::min(static_cast<std::size_t>(index), content_.size())));
}

std::string_view XmlDocument::textOf(vtkXMLDataElement& element) const {
  const auto index = std::max<vtkTypeInt64>(element.GetXMLByteIndex(), 0);
  const std::string_view content = content_;
  char quote = 0;
  for (auto i = static_cast<std::size_t>(index); i < content.size(); ++i) {
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

std::string XmlDocument::need(vtkXMLDataElement& element, const char* attribute) const {
  const char* value = element.GetAttribute(attribute);
  if (!value) {
    throw InputError(placeOf(element), std::string(element.GetName()) + "." + attribute, "", "is missing");
  }
  return value;
}

std::vector<vtkXMLDataElement*> childrenOf(vtkXMLDataElement& parent, const char* name) {
  std::vector<vtkXMLDataElement*> found;
  for (int i = 0; i < parent.GetNumberOfNestedElements(); ++i) {
    vtkXMLDataElement* const element = parent.GetNestedElement(i);
    if (std::strcmp(element->GetName(), name) == 0) found.push_back(element);
  }
  return found;
}

}  // namespace angio::io
