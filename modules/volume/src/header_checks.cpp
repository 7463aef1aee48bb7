// SPDX-License-Identifier: GPL-2.0-or-later
#include "header_checks.hpp"

#include <zlib.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "angio/base/errors.hpp"
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

}  // namespace

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

std::uintmax_t sizeOf(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw InputError(path, "", "", "must be a file that can be read");
  return size;
}

std::vector<double> numbersIn(const std::string& path, const std::string& field, std::string_view text,
                              std::size_t count, std::string_view also_blank) {
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

std::size_t bytesOfType(const std::string& path, const char* field, const std::string& type, const TypeSizes& sizes) {
  const auto found = sizes.find(type);
  if (found != sizes.end()) return found->second;
  throw InputError(path, field, type.substr(0, 40), "must be one number a voxel, of a known type");
}

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

void checkData(const std::string& path, std::uintmax_t first, std::uintmax_t wanted, Packing packing) {
  const std::uintmax_t size = sizeOf(path);
  const bool packed = packing == Packing::kDeflate;
  const std::uintmax_t there = first > size ? 0 : packed ? unpackedBytes(path, first, wanted) : size - first;
  if (packed ? there != wanted : there < wanted) {
    throw InputError(path, "data", std::to_string(there),
                     "must be " + std::to_string(wanted) + " bytes, as the header says");
  }
}

namespace {

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

}  // namespace angio::volume
