// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <map>

#include "angio/base/errors.hpp"
#include "header_checks.hpp"
#include "volume_header.hpp"

namespace angio::volume {
namespace {

constexpr std::size_t kMaxHeader = std::size_t{64} << 10;
constexpr std::size_t kMaxLine = 250;  // MetaIO keeps values in buffers of 255 bytes.

struct MetaHeader {
  std::map<std::string, std::string, std::less<>> values;
  std::size_t end = 0;  // Where data would begin.
};

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

MetaHeader parseHeader(const std::string& path) {
  const std::string text = beginningOf(path, kMaxHeader);
  MetaHeader header;
  int number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::string place = path + ":" + std::to_string(++number);
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos || end - at > kMaxLine)
      throw InputError(place, "", "", "the header's line is cut or too long");
    std::string_view line = std::string_view(text).substr(at, end - at);
    at = end + 1;
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (std::any_of(line.begin(), line.end(), [](unsigned char c) { return c < 32 && c != '\t'; })) {
      throw InputError(place, "", "", "the header must be text");
    }
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

std::size_t bytesOfType(const std::string& path, const std::string& type) {
  static const std::map<std::string, std::size_t, std::less<>> kBytes = {
      {"MET_CHAR", 1},  {"MET_UCHAR", 1},  {"MET_SHORT", 2},     {"MET_USHORT", 2},
      {"MET_INT", 4},   {"MET_UINT", 4},   {"MET_LONG", 4},      {"MET_ULONG", 4},
      {"MET_FLOAT", 4}, {"MET_DOUBLE", 8}, {"MET_LONG_LONG", 8}, {"MET_ULONG_LONG", 8}};
  const auto found = kBytes.find(type);
  if (found == kBytes.end())
    throw InputError(path, "ElementType", type.substr(0, 40), "must be one number a voxel, of a known type");
  return found->second;
}

}  // namespace

void checkMetaHeader(const std::string& path) {
  const MetaHeader header = parseHeader(path);
  const auto find = [&](const char* key) {
    const auto found = header.values.find(key);
    return found == header.values.end() ? std::string() : found->second;
  };
  const auto need = [&](const char* key) {
    if (find(key).empty()) throw InputError(path, key, "", "is missing");
    return find(key);
  };
  if (!find("ObjectType").empty() && find("ObjectType") != "Image") {
    throw InputError(path, "ObjectType", find("ObjectType").substr(0, 40), "must be Image");
  }
  if (numbersIn(path, "NDims", need("NDims"), 1)[0] != 3) throw InputError(path, "NDims", need("NDims"), "must be 3");
  const std::size_t voxels = voxelsOf(path, "DimSize", numbersIn(path, "DimSize", need("DimSize"), 3).data());
  for (const char* key : {"ElementSpacing", "ElementSize"}) {
    if (find(key).empty()) continue;
    for (const double value : numbersIn(path, key, find(key), 3)) requireBetween(path, key, value, 1e-3, 1e3);
  }
  for (const char* key : {"Offset", "Position", "Origin"}) {
    if (!find(key).empty()) numbersIn(path, key, find(key), 3);
  }
  for (const char* key : {"TransformMatrix", "Rotation", "Orientation"}) {
    if (!find(key).empty()) numbersIn(path, key, find(key), 9);
  }
  if (!find("ElementNumberOfChannels").empty() && find("ElementNumberOfChannels") != "1") {
    throw InputError(path, "ElementNumberOfChannels", find("ElementNumberOfChannels").substr(0, 40), "must be 1");
  }
  // MetaIO reads these in several ways; none of them is needed.
  for (const char* key : {"HeaderSize", "ElementToIntensityFunctionSlope", "ElementToIntensityFunctionOffset"}) {
    if (!find(key).empty()) numbersIn(path, key, find(key), 1);
  }
  if (!find("HeaderSize").empty() && find("HeaderSize") != "0")
    throw InputError(path, "HeaderSize", find("HeaderSize"), "must be 0");
  if (!find("BinaryData").empty() && find("BinaryData") != "True") {
    throw InputError(path, "BinaryData", find("BinaryData").substr(0, 40), "must be True");
  }
  if (!find("CompressedData").empty() && find("CompressedData") != "True" && find("CompressedData") != "False") {
    throw InputError(path, "CompressedData", find("CompressedData").substr(0, 40), "must be True or False");
  }
  const std::uintmax_t wanted = voxels * bytesOfType(path, need("ElementType"));
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

}  // namespace angio::volume
