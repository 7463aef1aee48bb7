// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <map>

#include "angio/base/errors.hpp"
#include "header_checks.hpp"
#include "volume_header.hpp"

namespace angio::volume {
namespace {

constexpr std::size_t kMaxHeader = std::size_t{64} << 10;

struct NrrdHeader {
  std::map<std::string, std::string, std::less<>> values;
  std::size_t end = 0;  // Where data would begin.
};

NrrdHeader parseHeader(const std::string& path) {
  const std::string text = beginningOf(path, kMaxHeader);
  if (text.compare(0, 7, "NRRD000") != 0) throw InputError(path + ":1", "magic", "", "must be NRRD000 and a version");
  NrrdHeader header;
  int number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::string place = path + ":" + std::to_string(++number);
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) break;
    std::string line = text.substr(at, end - at);
    header.end = at = end + 1;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) return header;
    if (std::any_of(line.begin(), line.end(), [](unsigned char c) { return c < 32 && c != '\t'; })) {
      throw InputError(place, "", "", "the header must be text");
    }
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

std::size_t bytesOfType(const std::string& path, const std::string& type) {
  static const std::map<std::string, std::size_t, std::less<>> kBytes = {
      {"signed char", 1}, {"int8", 1},         {"int8_t", 1},     {"uchar", 1},          {"unsigned char", 1},
      {"uint8", 1},       {"uint8_t", 1},      {"short", 2},      {"short int", 2},      {"signed short", 2},
      {"int16", 2},       {"int16_t", 2},      {"ushort", 2},     {"unsigned short", 2}, {"uint16", 2},
      {"uint16_t", 2},    {"int", 4},          {"signed int", 4}, {"int32", 4},          {"int32_t", 4},
      {"uint", 4},        {"unsigned int", 4}, {"uint32", 4},     {"uint32_t", 4},       {"float", 4},
      {"double", 8}};
  const auto found = kBytes.find(type);
  if (found == kBytes.end())
    throw InputError(path, "type", type.substr(0, 40), "must be one number a voxel, of a known type");
  return found->second;
}

}  // namespace

void checkNrrdHeader(const std::string& path) {
  const NrrdHeader header = parseHeader(path);
  const auto find = [&](const char* key) {
    const auto found = header.values.find(key);
    return found == header.values.end() ? std::string() : found->second;
  };
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
  checkData(data, named.empty() ? header.end : 0, voxels * bytesOfType(path, find("type")),
            packed ? Packing::kDeflate : Packing::kNone);
}

}  // namespace angio::volume
