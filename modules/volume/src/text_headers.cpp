// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <functional>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "header_checks.hpp"
#include "header_data.hpp"

namespace angio::volume {
namespace {

constexpr std::size_t kMaxHeader = std::size_t{64} << 10;
constexpr std::size_t kMaxLine = 250;  // MetaIO keeps values in buffers of 255 bytes.

// The fields of a header that is text, and where data would begin.
struct TextHeader {
  std::map<std::string, std::string, std::less<>> values;
  std::size_t end = 0;

  // Empty when it is missing.
  std::string find(const std::string& key) const {
    const auto found = values.find(key);
    return found == values.end() ? std::string() : found->second;
  }
};

// The next line of a header, without its end.
std::string_view lineAt(const std::string& text, std::size_t at, std::size_t end) {
  std::string_view line = std::string_view(text).substr(at, end - at);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

void requireText(const std::string& place, std::string_view line) {
  if (std::any_of(line.begin(), line.end(), [](unsigned char c) { return c < 32 && c != '\t'; })) {
    throw InputError(place, "", "", "the header must be text");
  }
}

TextHeader parseMeta(const std::string& path) {
  const std::string text = beginningOf(path, kMaxHeader);
  TextHeader header;
  int number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::string place = path + ":" + std::to_string(++number);
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos || end - at > kMaxLine)
      throw InputError(place, "", "", "the header's line is cut or too long");
    const std::string_view line = lineAt(text, at, end);
    at = end + 1;
    requireText(place, line);
    const auto equals = line.find('=');
    const std::string key(trimmed(line.substr(0, equals)));
    if (equals == std::string_view::npos || key.empty()) throw InputError(place, "", "", "must be key = value");
    if (!header.values.emplace(key, trimmed(line.substr(equals + 1))).second)
      throw InputError(place, key.substr(0, 40), "", "must not be given twice");
    if (header.values.size() == 1 && key != "ObjectType" && key != "NDims")
      throw InputError(place, key.substr(0, 40), "", "must be ObjectType or NDims");
    header.end = at;
    if (key == "ElementDataFile") return header;
  }
  throw InputError(path, "ElementDataFile", "", "is missing");
}

TextHeader parseNrrd(const std::string& path) {
  const std::string text = beginningOf(path, kMaxHeader);
  if (text.compare(0, 7, "NRRD000") != 0) throw InputError(path + ":1", "magic", "", "must be NRRD000 and a version");
  TextHeader header;
  int number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::string place = path + ":" + std::to_string(++number);
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) break;
    const std::string line(lineAt(text, at, end));
    header.end = at = end + 1;
    if (line.empty()) return header;
    requireText(place, line);
    const auto colon = line.find(':');
    if (number == 1 || line[0] == '#' || (colon != std::string::npos && line.compare(colon, 2, ":=") == 0)) continue;
    if (colon == std::string::npos) throw InputError(place, "", "", "must be field: value");
    const auto value = line.find_first_not_of(' ', colon + 1);
    if (!header.values.emplace(line.substr(0, colon), value == std::string::npos ? "" : line.substr(value)).second) {
      throw InputError(place, line.substr(0, std::min<std::size_t>(colon, 40)), "", "must not be given twice");
    }
  }
  if (header.values.count("data file") + header.values.count("datafile") > 0) return header;  // Needs no end.
  throw InputError(path, "header", "", "must end with a blank line");
}

const TypeSizes kMetaTypes = {{"MET_CHAR", 1},  {"MET_UCHAR", 1},  {"MET_SHORT", 2},     {"MET_USHORT", 2},
                              {"MET_INT", 4},   {"MET_UINT", 4},   {"MET_LONG", 4},      {"MET_ULONG", 4},
                              {"MET_FLOAT", 4}, {"MET_DOUBLE", 8}, {"MET_LONG_LONG", 8}, {"MET_ULONG_LONG", 8}};

const TypeSizes kNrrdTypes = {{"signed char", 1},   {"int8", 1},           {"int8_t", 1},  {"uchar", 1},
                              {"unsigned char", 1}, {"uint8", 1},          {"uint8_t", 1}, {"short", 2},
                              {"short int", 2},     {"signed short", 2},   {"int16", 2},   {"int16_t", 2},
                              {"ushort", 2},        {"unsigned short", 2}, {"uint16", 2},  {"uint16_t", 2},
                              {"int", 4},           {"signed int", 4},     {"int32", 4},   {"int32_t", 4},
                              {"uint", 4},          {"unsigned int", 4},   {"uint32", 4},  {"uint32_t", 4},
                              {"float", 4},         {"double", 8}};

}  // namespace

void checkMetaHeader(const std::string& path) {
  const TextHeader header = parseMeta(path);
  const auto find = [&](const char* key) { return header.find(key); };
  const auto need = [&](const char* key) {
    if (find(key).empty()) throw InputError(path, key, "", "is missing");
    return find(key);
  };
  const auto requireNumbers = [&](std::initializer_list<const char*> keys, std::size_t count) {
    for (const char* key : keys) {
      if (!find(key).empty()) numbersIn(path, key, find(key), count);
    }
  };
  const auto requireOneOf = [&](const char* key, const std::vector<std::string>& allowed, const char* rule) {
    const std::string value = find(key);
    if (value.empty() || std::find(allowed.begin(), allowed.end(), value) != allowed.end()) return;
    throw InputError(path, key, value.substr(0, 40), rule);
  };
  requireOneOf("ObjectType", {"Image"}, "must be Image");
  if (numbersIn(path, "NDims", need("NDims"), 1)[0] != 3) throw InputError(path, "NDims", need("NDims"), "must be 3");
  const std::size_t voxels = voxelsOf(path, "DimSize", numbersIn(path, "DimSize", need("DimSize"), 3).data());
  for (const char* key : {"ElementSpacing", "ElementSize"}) {
    if (find(key).empty()) continue;
    for (const double value : numbersIn(path, key, find(key), 3)) requireBetween(path, key, value, 1e-3, 1e3);
  }
  requireNumbers({"Offset", "Position", "Origin"}, 3);
  requireNumbers({"TransformMatrix", "Rotation", "Orientation"}, 9);
  requireOneOf("ElementNumberOfChannels", {"1"}, "must be 1");
  // MetaIO reads these in several ways; none of them is needed.
  requireNumbers({"HeaderSize", "ElementToIntensityFunctionSlope", "ElementToIntensityFunctionOffset"}, 1);
  requireOneOf("HeaderSize", {"0"}, "must be 0");
  requireOneOf("BinaryData", {"True"}, "must be True");
  requireOneOf("CompressedData", {"True", "False"}, "must be True or False");
  const std::uintmax_t wanted = voxels * bytesOfType(path, "ElementType", need("ElementType"), kMetaTypes);
  const std::string& data_name = need("ElementDataFile");
  const bool local = data_name == "LOCAL" || data_name == "Local" || data_name == "local";
  const std::string data = local ? path : dataFileBeside(path, "ElementDataFile", data_name);
  const bool packed = find("CompressedData") == "True";
  if (!find("CompressedDataSize").empty()) {
    requireBetween(path, "CompressedDataSize", numbersIn(path, "CompressedDataSize", find("CompressedDataSize"), 1)[0],
                   0, static_cast<double>(sizeOf(data) - (local ? header.end : 0)));
  }
  checkData(data, local ? header.end : 0, wanted, packed ? Packing::kDeflate : Packing::kNone);
}

void checkNrrdHeader(const std::string& path) {
  const TextHeader header = parseNrrd(path);
  const auto find = [&](const char* key) { return header.find(key); };
  if (find("dimension") != "3") throw InputError(path, "dimension", find("dimension").substr(0, 40), "must be 3");
  const std::size_t voxels = voxelsOf(path, "sizes", numbersIn(path, "sizes", find("sizes"), 3).data());
  if (!find("space directions").empty()) numbersIn(path, "space directions", find("space directions"), 9, "(),");
  if (!find("space origin").empty()) numbersIn(path, "space origin", find("space origin"), 3, "(),");
  if (!find("spacings").empty()) {
    for (const double value : numbersIn(path, "spacings", find("spacings"), 3))
      requireBetween(path, "spacings", value, 1e-3, 1e3);
  }
  for (const char* key : {"line skip", "lineskip", "byte skip", "byteskip"}) {
    if (!find(key).empty() && find(key) != "0") throw InputError(path, key, find(key).substr(0, 40), "must be 0");
  }
  const std::string encoding = find("encoding");
  const bool packed = encoding == "gzip" || encoding == "gz";
  if (!packed && encoding != "raw") throw InputError(path, "encoding", encoding.substr(0, 40), "must be raw or gzip");
  const std::string named = find("data file") + find("datafile");
  const std::string data = named.empty() ? path : dataFileBeside(path, "data file", named);
  checkData(data, named.empty() ? header.end : 0, voxels * bytesOfType(path, "type", find("type"), kNrrdTypes),
            packed ? Packing::kDeflate : Packing::kNone);
}

}  // namespace angio::volume
