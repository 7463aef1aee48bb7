// SPDX-License-Identifier: GPL-2.0-or-later
#include "itk_image.hpp"

#include <itkObject.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <sstream>

#include "angio/base/errors.hpp"

namespace angio::volume {
namespace {

// ITK's own warnings have a switch; MetaIO, GDCM and teem write to the C++ streams.
class Silence {
 public:
  Silence() {
    itk::Object::SetGlobalWarningDisplay(false);
    for (Held& held : held_) held.before = held.stream->rdbuf(sink_.rdbuf());
  }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;
  ~Silence() {
    for (Held& held : held_) held.stream->rdbuf(held.before);
    itk::Object::SetGlobalWarningDisplay(before_);
  }

 private:
  struct Held {
    std::ostream* stream;
    std::streambuf* before = nullptr;
  };
  bool before_ = itk::Object::GetGlobalWarningDisplay();
  std::ostringstream sink_;
  Held held_[3] = {{&std::cout}, {&std::cerr}, {&std::clog}};
};

// ITK's messages have several lines, with places in its own sources first.
std::string lastLine(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  text = text.substr(text.rfind('\n') + 1);
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 32 || c > 126; }, '?');
  return text.substr(0, 200);
}

template <typename T>
void convert(const std::vector<char>& bytes, std::size_t count, float* values) {
  const T* const from = reinterpret_cast<const T*>(bytes.data());
  for (std::size_t i = 0; i < count; ++i) values[i] = static_cast<float>(from[i]);
}

using Converter = void(const std::vector<char>&, std::size_t, float*);

Converter* converterOf(itk::IOComponentEnum type) {
  switch (type) {
    case itk::IOComponentEnum::UCHAR:
      return convert<unsigned char>;
    case itk::IOComponentEnum::CHAR:
      return convert<signed char>;
    case itk::IOComponentEnum::USHORT:
      return convert<unsigned short>;
    case itk::IOComponentEnum::SHORT:
      return convert<short>;
    case itk::IOComponentEnum::UINT:
      return convert<unsigned int>;
    case itk::IOComponentEnum::INT:
      return convert<int>;
    case itk::IOComponentEnum::ULONG:
      return convert<unsigned long>;
    case itk::IOComponentEnum::LONG:
      return convert<long>;
    case itk::IOComponentEnum::ULONGLONG:
      return convert<unsigned long long>;
    case itk::IOComponentEnum::LONGLONG:
      return convert<long long>;
    case itk::IOComponentEnum::FLOAT:
      return convert<float>;
    case itk::IOComponentEnum::DOUBLE:
      return convert<double>;
    default:
      return nullptr;
  }
}

}  // namespace

void withItk(const std::string& path, const std::function<void()>& work) {
  try {
    const Silence silence;
    work();
  } catch (const InputError&) {
    throw;
  } catch (const itk::ExceptionObject& error) {
    throw InputError(path, "", "", "cannot be read: " + lastLine(error.GetDescription()));
  } catch (const std::bad_alloc&) {
    throw InputError(path, "", "", "cannot be read: it asks for more memory than there is");
  } catch (const std::exception& error) {
    throw InputError(path, "", "", "cannot be read: " + lastLine(error.what()));
  }
}

VoxelGrid gridOf(const std::string& path, itk::ImageIOBase& image) {
  const unsigned int dimensions = image.GetNumberOfDimensions();
  bool flat = dimensions < 3;
  for (unsigned int i = 3; i < dimensions; ++i) flat = flat || image.GetDimensions(i) != 1;
  if (flat) throw InputError(path, "dimensions", std::to_string(dimensions), "must be 3");
  if (image.GetNumberOfComponents() != 1 || image.GetPixelType() == itk::IOPixelEnum::COMPLEX) {
    throw InputError(path, "components", std::to_string(image.GetNumberOfComponents()), "must be one number a voxel");
  }
  if (!converterOf(image.GetComponentType())) throw InputError(path, "type", "", "must be integers or floats");

  VoxelGrid grid;
  static const char* const kSize[3] = {"size[0]", "size[1]", "size[2]"};
  static const char* const kSpacing[3] = {"spacing_mm[0]", "spacing_mm[1]", "spacing_mm[2]"};
  static const char* const kOrigin[3] = {"origin_mm[0]", "origin_mm[1]", "origin_mm[2]"};
  for (unsigned int i = 0; i < 3; ++i) {
    requireBetween(path, kSize[i], static_cast<double>(image.GetDimensions(i)), 1, 65535);
    requireBetween(path, kSpacing[i], image.GetSpacing(i), 1e-3, 1e3);
    requireBetween(path, kOrigin[i], image.GetOrigin(i), -1e4, 1e4);
    grid.size[i] = static_cast<int>(image.GetDimensions(i));
    grid.spacing_m[i] = image.GetSpacing(i) / 1e3;
    grid.origin_m[i] = image.GetOrigin(i) / 1e3;
    const std::vector<double> axis = image.GetDirection(i);
    for (unsigned int row = 0; row < 3; ++row) grid.direction(row, i) = row < axis.size() ? axis[row] : 0;
  }
  if (grid.count() > kMaxVoxels) {
    throw InputError(path, "voxels", std::to_string(grid.count()), "must not exceed " + std::to_string(kMaxVoxels));
  }
  // Not finite counts as not orthonormal: NaN is not less than anything.
  const double defect =
      (grid.direction.transpose() * grid.direction - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(defect < 1e-3)) {
    throw InputError(path, "direction", "",
                     "must have axes of length one at right angles (sheared volumes are not read)");
  }
  // Headers have few digits.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(grid.direction, Eigen::ComputeFullU | Eigen::ComputeFullV);
  grid.direction = svd.matrixU() * svd.matrixV().transpose();
  return grid;
}

void readValues(const std::string& path, itk::ImageIOBase& image, const VoxelGrid& grid, float* values) {
  itk::ImageIORegion region(image.GetNumberOfDimensions());
  for (unsigned int i = 0; i < image.GetNumberOfDimensions(); ++i) region.SetSize(i, image.GetDimensions(i));
  image.SetIORegion(region);
  std::vector<char> bytes(static_cast<std::size_t>(image.GetImageSizeInBytes()));
  if (bytes.size() != grid.count() * image.GetComponentSize()) {
    throw InputError(path, "bytes", std::to_string(bytes.size()),
                     "must be those of " + std::to_string(grid.count()) + " voxels");
  }
  image.Read(bytes.data());
  converterOf(image.GetComponentType())(bytes, grid.count(), values);
  for (std::size_t i = 0; i < grid.count(); ++i) {
    if (!std::isfinite(values[i]))
      throw InputError(path, "voxel " + std::to_string(i), formatValue(values[i]), "must be finite");
  }
}

}  // namespace angio::volume
