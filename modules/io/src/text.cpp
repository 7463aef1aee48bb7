// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "angio/base/errors.hpp"
#include "angio/io/table.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {
namespace {

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
constexpr std::string_view kBlanks = " \t\r\n";
// So that a file that is one endless line costs no more memory than its own size.
constexpr std::size_t kMaxLine = std::size_t{1} << 20;

template <typename Number>
bool parsesWhole(std::string_view text, Number& number) {
  // from_chars knows no leading plus, yet programs write it.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

double parsed(std::string_view text) {
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

}  // namespace

// Values that are in no file have no line: 0.
std::string atLine(const std::string& path, int line) { return line == 0 ? path : path + ":" + std::to_string(line); }

TextLines::TextLines(const std::string& path, std::string_view content) : path_(path), rest_(content) {
  if (rest_.substr(0, kByteOrderMark.size()) == kByteOrderMark) rest_.remove_prefix(kByteOrderMark.size());
  rest_ = rest_.substr(0, rest_.find_last_not_of(kBlanks) + 1);
  count_ = rest_.empty() ? 0 : 1 + static_cast<int>(std::count(rest_.begin(), rest_.end(), '\n'));
}

bool TextLines::next() {
  if (number_ == count_) return false;
  ++number_;
  const auto end = rest_.find('\n');
  text_ = rest_.substr(0, end);
  rest_ = end == std::string_view::npos ? std::string_view() : rest_.substr(end + 1);
  if (!text_.empty() && text_.back() == '\r') text_.remove_suffix(1);
  if (text_.size() > kMaxLine) {
    throw InputError(place(), "length", std::to_string(text_.size()), "a line must not exceed 1 MiB");
  }
  const auto bad = std::find_if(text_.begin(), text_.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte < 0x20 && c != '\t') || byte == 0x7f;
  });
  if (bad != text_.end()) {
    const int byte = static_cast<unsigned char>(*bad);
    throw InputError(place(), "byte", std::to_string(byte), "must be text, without control characters");
  }
  return true;
}

void TextLines::need(const std::string& what) {
  if (!next()) throw InputError(atLine(path_, number_ + 1), what, "", "is missing: the file ends too early");
}

namespace {

std::string inSmallLetters(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

}  // namespace

std::string extensionOf(const std::string& path) {
  return inSmallLetters(std::filesystem::path(path).extension().string());
}

bool hasExtension(const std::string& path, std::string_view extension) {
  const std::string name = inSmallLetters(std::filesystem::path(path).filename().string());
  return name.size() > extension.size() && endsWith(name, extension);
}

bool endsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

void splitAt(char separator, std::string_view text, std::vector<std::string_view>& parts) {
  parts.clear();
  for (;;) {
    const auto end = text.find(separator);
    parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
}

std::string_view nextWord(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  return word;
}

void splitAtBlanks(std::string_view text, std::vector<std::string_view>& parts) {
  parts.clear();
  for (auto word = nextWord(text); !word.empty(); word = nextWord(text)) parts.push_back(word);
}

double parseNumber(const std::string& place, const std::string& field, std::string_view text) {
  double number = 0;
  if (text.empty()) throw InputError(place, field, "", "must be a number, found nothing");
  if (!parsesWhole(text, number)) throw InputError(place, field, std::string(text), "must be a number");
  if (!std::isfinite(number)) throw InputError(place, field, std::string(text), "must be a finite number");
  return number;
}

int parseInteger(const std::string& place, const std::string& field, std::string_view text) {
  int number = 0;
  if (text.empty()) throw InputError(place, field, "", "must be an integer, found nothing");
  if (!parsesWhole(text, number)) throw InputError(place, field, std::string(text), "must be an integer of 32 bits");
  return number;
}

std::string exact(double value) {
  char text[32];
  return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
}

double millimetres(double value_m) {
  const double value_mm = value_m * 1e3;
  char text[40];
  // Fifteen digits keep what came from a file as it was: 0.0408 m is 40.8 mm, not 40.800000000000004.
  const std::string_view rounded(
      text, static_cast<std::size_t>(
                std::to_chars(text, text + sizeof text, value_mm, std::chars_format::general, 15).ptr - text));
  if (parsed(rounded) / 1e3 == value_m) return parsed(rounded);
  for (const double candidate : {value_mm, std::nextafter(value_mm, -HUGE_VAL), std::nextafter(value_mm, HUGE_VAL)}) {
    if (candidate / 1e3 == value_m) return candidate;
  }
  return value_mm;
}

std::string exactMillimetres(double value_m) { return exact(millimetres(value_m)); }

namespace {

std::string listed(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ",") + name;
  return list;
}

bool contains(const std::vector<std::string>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<std::string> readHeader(const TextLines& lines, const TableColumns& columns) {
  std::vector<std::string_view> parts;
  splitAt(',', lines.text(), parts);
  std::string rule = "must be the columns " + listed(columns.required) + " separated by commas";
  if (!columns.optional.empty()) rule += "; optional: " + listed(columns.optional);
  std::vector<std::string> header;
  for (const std::string_view part : parts) {
    const std::string name(trimmed(part));
    if (!contains(columns.required, name) && !contains(columns.optional, name)) {
      throw InputError(lines.place(), "header", name, rule);
    }
    if (contains(header, name)) throw InputError(lines.place(), "header", name, "must not name a column twice");
    header.push_back(name);
  }
  for (const std::string& name : columns.required) {
    if (!contains(header, name)) throw InputError(lines.place(), "header", "", name + " is missing; " + rule);
  }
  return header;
}

}  // namespace

std::string TableRow::place() const { return atLine(path_, line_); }

bool TableRow::has(std::string_view column) const { return contains(header_, column); }

std::string_view TableRow::text(std::string_view column) const {
  return fields_[std::find(header_.begin(), header_.end(), column) - header_.begin()];
}

double TableRow::number(const std::string& column) const { return parseNumber(place(), column, text(column)); }

std::optional<double> TableRow::numberOrBlank(const std::string& column) const {
  if (text(column).empty()) return std::nullopt;
  return number(column);
}

int TableRow::integer(const std::string& column) const { return parseInteger(place(), column, text(column)); }

void readTable(const std::string& path, const TableColumns& columns,
               const std::function<void(const TableRow&)>& take_row) {
  const std::string content = readWholeFile(path, kMaxTextFile);
  TextLines lines(path, content);
  if (!lines.next()) throw InputError(atLine(path, 1), "header", "", "the file is empty");
  const std::vector<std::string> header = readHeader(lines, columns);
  if (lines.count() < 2) throw InputError(atLine(path, 2), "rows", "0", "must have at least one row after the header");
  if (lines.count() - 1 > kMaxPoints) {
    throw InputError(path, "rows", std::to_string(lines.count() - 1), "must not exceed " + std::to_string(kMaxPoints));
  }
  std::vector<std::string_view> fields;
  while (lines.next()) {
    splitAt(',', lines.text(), fields);
    if (fields.size() != header.size()) {
      throw InputError(lines.place(), "columns", std::to_string(fields.size()),
                       "must be " + std::to_string(header.size()) + " as in the header, separated by commas");
    }
    for (std::string_view& field : fields) field = trimmed(field);
    take_row(TableRow(path, lines.number(), header, fields));
  }
}

}  // namespace angio::io
