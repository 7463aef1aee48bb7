// SPDX-License-Identifier: GPL-2.0-or-later
#include "header_data.hpp"

#include <zlib.h>

#include <algorithm>
#include <charconv>
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

}  // namespace angio::volume
