// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/volume_files.hpp"

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include <filesystem>

#include "angio/base/errors.hpp"
#include "dicom_series.hpp"
#include "itk_image.hpp"
#include "volume_header.hpp"

namespace angio::volume {
namespace {

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

std::string inSmallLetters(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
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

const VolumeFormat kFormats[] = {
    {".mha", make<itk::MetaImageIO>, checkMetaHeader},   {".mhd", make<itk::MetaImageIO>, checkMetaHeader},
    {".nii", make<itk::NiftiImageIO>, checkNiftiHeader}, {".nii.gz", make<itk::NiftiImageIO>, checkNiftiHeader},
    {".nrrd", make<itk::NrrdImageIO>, checkNrrdHeader},  {".nhdr", make<itk::NrrdImageIO>, checkNrrdHeader},
};

}  // namespace

Volume readVolume(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return readDicomSeries(path);
  const std::string name = inSmallLetters(path);
  std::string known;
  for (const VolumeFormat& format : kFormats) {
    known += std::string(known.empty() ? "" : ", ") + format.extension;
    if (!endsWith(name, format.extension)) continue;
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
  throw InputError(path, "extension", std::filesystem::path(path).extension().string(),
                   "must be one of " + known + ", or the folder of a DICOM series");
}

}  // namespace angio::volume
