// SPDX-License-Identifier: GPL-2.0-or-later
#include "header_checks.hpp"

#include <zlib.h>

#include <Eigen/Core>
#include <cstdint>
#include <cstring>

#include "angio/base/errors.hpp"
#include "header_data.hpp"

namespace angio::volume {
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
