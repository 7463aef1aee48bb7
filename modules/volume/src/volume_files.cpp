// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/volume_files.hpp"

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkObject.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <iostream>
#include <map>
#include <set>
#include <sstream>

#include "angio/base/errors.hpp"
#include "angio/io/dicom_slices.hpp"
#include "angio/io/format_table.hpp"
#include "angio/io/xa_files.hpp"
#include "header_checks.hpp"

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
  using Type = itk::IOComponentEnum;
  static const std::map<Type, Converter*> kConverters = {{Type::UCHAR, convert<unsigned char>},
                                                         {Type::CHAR, convert<signed char>},
                                                         {Type::USHORT, convert<unsigned short>},
                                                         {Type::SHORT, convert<short>},
                                                         {Type::UINT, convert<unsigned int>},
                                                         {Type::INT, convert<int>},
                                                         {Type::ULONG, convert<unsigned long>},
                                                         {Type::LONG, convert<long>},
                                                         {Type::ULONGLONG, convert<unsigned long long>},
                                                         {Type::LONGLONG, convert<long long>},
                                                         {Type::FLOAT, convert<float>},
                                                         {Type::DOUBLE, convert<double>}};
  const auto found = kConverters.find(type);
  return found == kConverters.end() ? nullptr : found->second;
}

// Runs work of ITK on `path`. What it throws, running out of memory included, becomes an InputError; what it and the
// libraries below it would print is held back.
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

// The grid that an opened image claims, checked: three dimensions (`slices` as the last one's size), one real
// component, sizes, finite positive spacing, axes at right angles.
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
  for (unsigned int i = 0; i < 3; ++i) {
    const std::string at = "[" + std::to_string(i) + "]";
    requireBetween(path, "size" + at, static_cast<double>(image.GetDimensions(i)), 1, 65535);
    requireBetween(path, "spacing_mm" + at, image.GetSpacing(i), 1e-3, 1e3);
    requireBetween(path, "origin_mm" + at, image.GetOrigin(i), -1e4, 1e4);
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

// Reads the voxels of an opened image as floats and refuses those that are not finite. `values` has their number.
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

struct VolumeFormat {
  const char* extension;
  itk::ImageIOBase::Pointer (*open)();
  void (*check)(const std::string& path);  // The header, before a parser that trusts it.
};

template <typename Image>
itk::ImageIOBase::Pointer make() {
  return Image::New().GetPointer();
}

const VolumeFormat kVolumeFormats[] = {
    {".mha", make<itk::MetaImageIO>, checkMetaHeader},   {".mhd", make<itk::MetaImageIO>, checkMetaHeader},
    {".nii", make<itk::NiftiImageIO>, checkNiftiHeader}, {".nii.gz", make<itk::NiftiImageIO>, checkNiftiHeader},
    {".nrrd", make<itk::NrrdImageIO>, checkNrrdHeader},  {".nhdr", make<itk::NrrdImageIO>, checkNrrdHeader},
};

// A slice and how far along the normal of all slices it lies.
struct Placed {
  DicomSlice slice;
  double height_mm = 0;
};

std::vector<Placed> readSlices(const std::string& folder) {
  std::set<std::string> paths;  // In the order of their names: the same on every machine.
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) paths.insert(entry.path().string());
  if (error) throw InputError(folder, "", "", "must be a folder that can be read");
  std::vector<Placed> slices;
  std::set<std::string> series;
  std::size_t voxels = 0;
  for (const std::string& path : paths) {
    if (!isDicom(path)) continue;
    slices.push_back({readDicomSlice(path), 0});
    series.insert(slices.back().slice.series_uid);
    voxels += slices.back().slice.values.total();
    if (voxels > kMaxVoxels) {
      throw InputError(folder, "voxels", std::to_string(voxels), "must not exceed " + std::to_string(kMaxVoxels));
    }
  }
  if (series.size() != 1) {
    throw InputError(folder, "DICOM series", std::to_string(series.size()), "the folder must hold just one");
  }
  if (slices.size() < 2) throw InputError(folder, "slices", std::to_string(slices.size()), "must be at least 2");
  return slices;
}

// In their order along the normal of the image plane; the distance between them [mm].
double sortSlices(const std::string& folder, std::vector<Placed>& slices) {
  const DicomSlice first = slices.front().slice;
  const Eigen::Vector3d normal = first.right.cross(first.down);
  for (Placed& placed : slices) {
    const DicomSlice& slice = placed.slice;
    if (slice.values.size() != first.values.size() || !slice.spacing_mm.isApprox(first.spacing_mm, 1e-4) ||
        !slice.right.isApprox(first.right, 1e-3) || !slice.down.isApprox(first.down, 1e-3)) {
      throw InputError(slice.path, "slice", "", "must have the size, spacing and orientation of " + first.path);
    }
    placed.height_mm = normal.dot(slice.first_pixel_mm);
  }
  std::sort(slices.begin(), slices.end(), [](const Placed& a, const Placed& b) { return a.height_mm < b.height_mm; });
  const double step_mm = (slices.back().height_mm - slices.front().height_mm) / static_cast<double>(slices.size() - 1);
  requireBetween(folder, "slice distance_mm", step_mm, 1e-3, 1e3);
  for (std::size_t i = 1; i < slices.size(); ++i) {
    const Eigen::Vector3d expected_mm = slices.front().slice.first_pixel_mm + static_cast<double>(i) * step_mm * normal;
    // A hundredth of the distance. In the plane, slices of a tilted gantry are off: their volume is sheared.
    const double off_mm = (slices[i].slice.first_pixel_mm - expected_mm).norm();
    if (!(off_mm < 0.01 * step_mm + 1e-3)) {
      throw InputError(slices[i].slice.path, "off its place by_mm", formatValue(off_mm),
                       "slices must be evenly spaced along their normal: one is missing, doubled or sheared");
    }
  }
  return step_mm;
}

// The volume of the one DICOM series in a folder: slices of one size, in their order along the normal, evenly spaced
// to a hundredth of a slice's distance.
Volume readDicomSeries(const std::string& folder) {
  std::vector<Placed> slices = readSlices(folder);
  const double step_mm = sortSlices(folder, slices);
  const DicomSlice& first = slices.front().slice;
  Volume volume;
  volume.grid.size = {first.values.cols, first.values.rows, static_cast<int>(slices.size())};
  volume.grid.spacing_m = Eigen::Vector3d(first.spacing_mm.x(), first.spacing_mm.y(), step_mm) / 1e3;
  volume.grid.origin_m = first.first_pixel_mm / 1e3;
  volume.grid.direction.col(0) = first.right.normalized();
  volume.grid.direction.col(2) = first.right.cross(first.down).normalized();
  volume.grid.direction.col(1) = volume.grid.direction.col(2).cross(volume.grid.direction.col(0));
  volume.values.reserve(volume.grid.count());
  for (const Placed& placed : slices) {
    const cv::Mat& values = placed.slice.values;
    for (int row = 0; row < values.rows; ++row)
      volume.values.insert(volume.values.end(), values.ptr<float>(row), values.ptr<float>(row) + values.cols);
  }
  return volume;
}

}  // namespace

Volume readVolume(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return readDicomSeries(path);
  const VolumeFormat& format = formatOf(path, kVolumeFormats, ", or the folder of a DICOM series");
  format.check(path);
  Volume volume;
  withItk(path, [&] {
    const itk::ImageIOBase::Pointer image = format.open();
    image->SetFileName(path);
    image->ReadImageInformation();
    volume.grid = gridOf(path, *image);
    volume.values.resize(volume.grid.count());
    readValues(path, *image, volume.grid, volume.values.data());
  });
  return volume;
}

}  // namespace angio::volume
