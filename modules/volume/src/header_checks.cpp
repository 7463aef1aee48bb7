// SPDX-License-Identifier: GPL-2.0-or-later
#include "header_checks.hpp"

#include <zlib.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {
namespace {

// Unpacks what is behind `first` without keeping it; more than `enough` bytes need not be counted.
std::uintmax_t unpackedBytes(const std::string& path, std::uintmax_t first, std::uintmax_t enough) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(first));
  std::vector<char> in(1 << 16), out(1 << 18);
  z_stream stream{};
  if (inflateInit2(&stream, 15 + 32) != Z_OK) throw InputError(path, "", "", "cannot be unpacked");  // zlib or gzip.
  std::uintmax_t count = 0;
  int status = Z_OK;
  while (status == Z_OK && count <= enough) {
    if (stream.avail_in == 0) {
      file.read(in.data(), static_cast<std::streamsize>(in.size()));
      stream.next_in = reinterpret_cast<Bytef*>(in.data());
      stream.avail_in = static_cast<uInt>(file.gcount());
      if (stream.avail_in == 0) break;
    }
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    status = inflate(&stream, Z_NO_FLUSH);
    count += out.size() - stream.avail_out;
  }
  inflateEnd(&stream);
  if (status != Z_STREAM_END && count <= enough) throw InputError(path, "", "", "the packed data are cut or broken");
  return count;
}

// The beginning of a regular file, at most `max_bytes` of it.
std::string beginningOf(const std::string& path, std::size_t max_bytes) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    throw InputError(path, "", "", "must be a file that can be read");
  }
  std::ifstream file(path, std::ios::binary);
  std::string bytes(max_bytes, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(max_bytes));
  if (!file && !file.eof()) throw InputError(path, "", "", "must be a file that can be read");
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

// Bytes of a regular file.
std::uintmax_t sizeOf(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw InputError(path, "", "", "must be a file that can be read");
  return size;
}

// The numbers between blanks (and `also_blank` characters), as many as `count` says and all finite.
std::vector<double> numbersIn(const std::string& path, const std::string& field, std::string_view text,
                              std::size_t count, std::string_view also_blank = "") {
  const std::string blanks = " \t" + std::string(also_blank);
  std::vector<double> numbers;
  for (;;) {
    text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
    if (text.empty()) break;
    const std::string_view word = text.substr(0, text.find_first_of(blanks));
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) {
      throw InputError(path, field, std::string(word.substr(0, 40)), "must be a number");
    }
    numbers.push_back(requireFinite(path, field, value));
    text.remove_prefix(word.size());
    if (numbers.size() > count) break;
  }
  if (numbers.size() != count) {
    throw InputError(path, field, std::to_string(numbers.size()), "must be " + std::to_string(count) + " numbers");
  }
  return numbers;
}

// Voxels of a volume with these sizes, each 1 to 65535, kMaxVoxels in all.
std::size_t voxelsOf(const std::string& path, const std::string& field, const double* sizes) {
  double voxels = 1;
  for (int i = 0; i < 3; ++i) {
    voxels *= requireBetween(path, field, sizes[i], 1, 65535);
    if (sizes[i] != static_cast<int>(sizes[i]))
      throw InputError(path, field, formatValue(sizes[i]), "must be an integer");
  }
  if (voxels > static_cast<double>(kMaxVoxels)) {
    throw InputError(path, field, formatValue(voxels), "the voxels must not exceed " + std::to_string(kMaxVoxels));
  }
  return static_cast<std::size_t>(voxels);
}

// Bytes of a voxel by the name of its type.
using TypeSizes = std::map<std::string, std::size_t>;
std::size_t bytesOfType(const std::string& path, const char* field, const std::string& type, const TypeSizes& sizes) {
  const auto found = sizes.find(type);
  if (found != sizes.end()) return found->second;
  throw InputError(path, field, type.substr(0, 40), "must be one number a voxel, of a known type");
}

// A data file that a header names: a plain name, of a regular file in the header's folder. Returns its path.
std::string dataFileBeside(const std::string& path, const std::string& field, std::string_view name) {
  const bool plain =
      !name.empty() && name.size() < 200 && name.find_first_of("/\\% ") == std::string_view::npos && name != "LIST";
  if (!plain)
    throw InputError(path, field, std::string(name.substr(0, 40)),
                     "must be the plain name of one file in the same folder");
  const auto data = std::filesystem::path(path).parent_path() / std::string(name);
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(data, ignored)) {
    throw InputError(path, field, std::string(name), "must be a file in the same folder");
  }
  return data.string();
}

// Throws unless the bytes of a file behind `first`, unpacked (zlib or gzip) when `packed`, are those of the voxels:
// exactly when packed, at least when not.
enum class Packing { kNone, kDeflate };
void checkData(const std::string& path, std::uintmax_t first, std::uintmax_t wanted, Packing packing) {
  const std::uintmax_t size = sizeOf(path);
  const bool packed = packing == Packing::kDeflate;
  const std::uintmax_t there = first > size ? 0 : packed ? unpackedBytes(path, first, wanted) : size - first;
  if (packed ? there != wanted : there < wanted) {
    throw InputError(path, "data", std::to_string(there),
                     "must be " + std::to_string(wanted) + " bytes, as the header says");
  }
}

constexpr std::size_t kHeaderBytes = 348;

// A NIfTI-1 header, in either byte order.
class NiftiHeader {
 public:
  explicit NiftiHeader(const std::string& path) : path_(path) {
    beginningOf(path, 1);
    const gzFile file = gzopen(path.c_str(), "rb");  // Reads files that are not packed as they are.
    const int count = file ? gzread(file, bytes_, sizeof bytes_) : -1;
    if (file) gzclose(file);
    if (count != static_cast<int>(sizeof bytes_)) throw InputError(path, "header", "", "is cut or broken");
    swapped_ = at<std::int32_t>(0) != static_cast<std::int32_t>(kHeaderBytes);
    if (at<std::int32_t>(0) != static_cast<std::int32_t>(kHeaderBytes) || std::memcmp(bytes_ + 344, "n+1", 4) != 0) {
      throw InputError(path, "header", "", "must be that of a NIfTI-1 file in one piece");
    }
  }

  template <typename T>
  T at(std::size_t place) const {
    char bytes[sizeof(T)];
    std::memcpy(bytes, bytes_ + place, sizeof(T));
    if (swapped_) std::reverse(bytes, bytes + sizeof(T));
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
  }

  // No number of a header that is used is larger; the reader's linear algebra does not come back from far larger ones.
  double number(const char* field, std::size_t place) const {
    requireFinite(path_, field, at<float>(place));
    return requireBetween(path_, field, at<float>(place), -1e8, 1e8);
  }

 private:
  const std::string& path_;
  char bytes_[kHeaderBytes];
  bool swapped_ = false;
};

const TypeSizes kNiftiTypes = {{"2", 1},  {"256", 1}, {"4", 2},  {"512", 2},  {"8", 4},
                               {"16", 4}, {"768", 4}, {"64", 8}, {"1024", 8}, {"1280", 8}};

// ITK takes the nearest rotation when an affine matrix is none.
void checkAxes(const std::string& path, const NiftiHeader& header) {
  Eigen::Matrix3d axes;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double value = header.number("srow", 280 + 16 * row + 4 * column);
      requireBetween(path, "srow", value, -1e4, 1e4);
      if (column < 3) axes(row, column) = value;
    }
  }
  if (header.at<std::int16_t>(254) <= 0) return;
  for (int k = 0; k < 3; ++k) {
    requireBetween(path, "length of srow's axis", axes.col(k).norm(), 1e-3, 1e3);
    axes.col(k).normalize();
  }
  const double defect = (axes.transpose() * axes - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(defect < 1e-3))
    throw InputError(path, "srow", "", "must have axes at right angles (sheared volumes are not read)");
}

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

void checkNiftiHeader(const std::string& path) {
  const NiftiHeader header(path);
  const int dimensions = header.at<std::int16_t>(40);
  bool three = dimensions >= 3 && dimensions <= 7;
  double sizes[3] = {};
  for (int i = 1; i <= 7 && three && i <= dimensions; ++i) {
    const int size = header.at<std::int16_t>(40 + 2 * i);
    if (i <= 3) sizes[i - 1] = size;
    three = i <= 3 || size == 1;
  }
  if (!three) throw InputError(path, "dim", std::to_string(dimensions), "must be 3");
  const std::size_t voxels = voxelsOf(path, "dim", sizes);
  const std::size_t bytes = bytesOfType(path, "datatype", std::to_string(header.at<std::int16_t>(70)), kNiftiTypes);
  if (header.at<std::int16_t>(72) != static_cast<int>(8 * bytes)) {
    throw InputError(path, "bitpix", std::to_string(header.at<std::int16_t>(72)), "must fit the datatype");
  }
  for (std::size_t i = 1; i <= 3; ++i) requireBetween(path, "pixdim", header.number("pixdim", 76 + 4 * i), 1e-3, 1e3);
  for (const std::size_t place : {112U, 116U}) header.number("scl", place);
  for (const std::size_t place : {256U, 260U, 264U})
    requireBetween(path, "quatern", header.number("quatern", place), -1.01, 1.01);
  for (const std::size_t place : {268U, 272U, 276U})
    requireBetween(path, "qoffset", header.number("qoffset", place), -1e4, 1e4);
  checkAxes(path, header);
  const double first = header.number("vox_offset", 108);
  requireBetween(path, "vox_offset", first, 352, 1 << 24);
  const std::uintmax_t wanted = static_cast<std::uintmax_t>(first) + voxels * bytes;
  const std::string magic = beginningOf(path, 2);
  checkData(path, 0, wanted, magic == "\x1f\x8b" ? Packing::kDeflate : Packing::kNone);
}

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
