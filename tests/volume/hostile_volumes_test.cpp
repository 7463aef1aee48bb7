// SPDX-License-Identifier: GPL-2.0-or-later
// Broken and lying volumes: one InputError in one line, and nothing printed.
#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"
#include "angio/volume/volume_files.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

Volume plainVolume() {
  Volume volume;
  volume.grid.size = {4, 3, 3};
  volume.grid.spacing_m.setConstant(1e-3);
  volume.values.assign(36, 7);
  return volume;
}

template <typename T>
std::string patched(std::string bytes, std::size_t at, T value) {
  std::memcpy(&bytes[at], &value, sizeof value);
  return bytes;
}

struct Hostile {
  std::string file, content, expected;
};

std::vector<Hostile> hostileVolumes() {
  const Volume volume = plainVolume();
  const std::string meta = test::metaImage(volume), nii = test::nifti(volume), nrrd = test::nrrd(volume);
  Volume with_nan = volume;
  with_nan.values[5] = std::nanf("");
  return {
      {"v.mha", "", "ElementDataFile: is missing"},
      {"v.mha", meta.substr(0, meta.size() - 1), "data = 143: must be 144 bytes"},
      {"v.mha", with(meta, "DimSize = 4 3 3", "DimSize = 60000 60000 60000"),
       "DimSize = 2.16e+14: the voxels must not exceed"},
      {"v.mha", with(meta, "DimSize = 4 3 3", "DimSize = 65535 3 3"), "must be 2359260 bytes"},
      {"v.mha", with(meta, "DimSize = 4 3 3", "DimSize = 4 -3 3"), "DimSize = -3: must lie between"},
      {"v.mha", with(meta, "DimSize = 4 3 3", "DimSize = 4 9"), "DimSize = 2: must be 3 numbers"},
      {"v.mha", with(meta, "NDims = 3", "NDims = 4"), "NDims = 4: must be 3"},
      {"v.mha", with(meta, "NDims = 3", "NDims = 2"), "NDims = 2: must be 3"},
      {"v.mha", with(meta, "ElementSpacing = 1 1 1", "ElementSpacing = 1 nan 1"),
       "ElementSpacing = nan: must be a finite number"},
      {"v.mha", with(meta, "ElementSpacing = 1 1 1", "ElementSpacing = 1 0 1"), "ElementSpacing = 0: must lie between"},
      {"v.mha", with(meta, "Matrix = 1 0 0", "Matrix = 1 0.1 0"),
       "direction: must have axes of length one at right angles"},
      {"v.mha", with(meta, "Offset = ", "Offset = 1e9 "), "Offset = 4: must be 3 numbers"},
      {"v.mha", with(meta, "MET_FLOAT", "MET_FLOAT_ARRAY"),
       "ElementType = MET_FLOAT_ARRAY: must be one number a voxel"},
      {"v.mha", with(meta, "ElementType", "ElementNumberOfChannels = 3\nElementType"),
       "ElementNumberOfChannels = 3: must be 1"},
      {"v.mha", with(meta, "LOCAL", "../../etc/passwd"), "ElementDataFile = ../../etc/passwd: must be the plain name"},
      {"v.mha", with(meta, "LOCAL", "LIST"), "ElementDataFile = LIST"},
      {"v.mha", with(meta, "LOCAL", "nowhere.raw"), "ElementDataFile = nowhere.raw: must be a file in the same folder"},
      {"v.mha", with(meta, "CompressedData = False", "CompressedData = True"), "packed data are cut or broken"},
      {"v.mha", with(meta, "NDims = 3", "Comment = " + std::string(300, 'a') + "\nNDims = 3"),
       "header's line is cut or too long"},
      {"v.mha", test::metaImage(with_nan), "voxel 5 = nan: must be finite"},
      {"v.nii", nii.substr(0, 100), "header: is cut or broken"},
      {"v.nii", nii.substr(0, nii.size() - 1), "data = 495: must be 496 bytes"},
      {"v.nii", patched(nii, 40, std::int16_t{4}), "dim"},  // With a fourth size of one it is three; made two below.
      {"v.nii", patched(patched(nii, 40, std::int16_t{4}), 48, std::int16_t{2}), "dim = 4: must be 3"},
      {"v.nii", patched(nii, 40, std::int16_t{2}), "dim = 2: must be 3"},
      {"v.nii", patched(nii, 42, std::int16_t{-4}), "dim = -4: must lie between"},
      {"v.nii", patched(nii, 70, std::int16_t{32}), "datatype = 32: must be one number a voxel"},    // Complex.
      {"v.nii", patched(nii, 70, std::int16_t{128}), "datatype = 128: must be one number a voxel"},  // Colour.
      {"v.nii", patched(nii, 80, std::nanf("")), "pixdim = nan: must be a finite number"},
      {"v.nii", patched(nii, 284, 0.2F), "srow: must have axes at right angles"},
      {"v.nii", patched(nii, 108, 1e30F), "vox_offset = 1.00000002e+30: must lie between"},
      {"v.nii", patched(nii, 292, -1.7e38F),
       "srow = -1.69999998e+38: must lie between"},  // The reader's decomposition would never end.
      {"v.nii", patched(nii, 344, 'x'), "header: must be that of a NIfTI-1 file"},
      {"v.nii.gz", "\x1f\x8b" + nii, "header: is cut or broken"},
      {"v.nrrd", nrrd.substr(0, nrrd.size() - 1), "data = 143: must be 144 bytes"},
      {"v.nrrd", with(nrrd, "dimension: 3", "dimension: 4"), "dimension = 4: must be 3"},
      {"v.nrrd", with(nrrd, "sizes: 4 3 3", "sizes: 4 3 1e9"), "sizes = 1e+09: must lie between"},
      {"v.nrrd", with(nrrd, "(1,0,0)", "(1,0.2,0)"), "direction: must have axes"},
      {"v.nrrd", with(nrrd, "(1,0,0)", "(nan,0,0)"), "space directions = nan: must be a finite number"},
      {"v.nrrd", with(nrrd, "type: float", "type: block"), "type = block: must be one number a voxel"},
      {"v.nrrd", with(nrrd, "encoding: raw", "encoding: bzip2"), "encoding = bzip2: must be raw or gzip"},
      {"v.nrrd", with(nrrd, "encoding: raw", "encoding: raw\ndata file: /etc/passwd"), "data file = /etc/passwd"},
      {"v.vol", "x", "extension = .vol: must be one of .mha"},
  };
}

TEST(HostileVolumes, AreRefusedByNameInOneLine) {
  const test::TemporaryFolder folder;
  for (const Hostile& hostile : hostileVolumes()) {
    if (hostile.expected == "dim") {
      EXPECT_NO_THROW(readVolume(folder.write(hostile.file, hostile.content)));
      continue;
    }
    const std::string path = folder.write(hostile.file, hostile.content);
    const std::string message = test::refusalOf([&] { readVolume(path); });
    EXPECT_NE(message.find(hostile.expected), std::string::npos) << message << "\nexpected: " << hostile.expected;
    EXPECT_EQ(message.find(path), 0U) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
  EXPECT_NE(test::refusalOf([&] { readVolume(folder.path("none.mha")); }).find("must be a file that can be read"),
            std::string::npos);
  std::filesystem::create_directory(folder.path("empty"));
  EXPECT_NE(test::refusalOf([&] {
              readVolume(folder.path("empty"));
            }).find("DICOM series = 0: the folder must hold just one"),
            std::string::npos);
}

TEST(HostileVolumes, CutOrChangedFilesAreReadOrRefusedInSilence) {
  const test::TemporaryFolder folder;
  const Volume volume = plainVolume();
  std::mt19937 random(7);
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  for (const auto& [file, good] : {std::pair<std::string, std::string>{"v.mha", test::metaImage(volume)},
                                   {"v.nii", test::nifti(volume)},
                                   {"v.nrrd", test::nrrd(volume)}}) {
    int refused = 0;
    const auto tryTo = [&, name = file](const std::string& content) {
      try {
        readVolume(folder.write(name, content));
      } catch (const InputError& error) {
        ++refused;
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      }
    };
    for (std::size_t length = 0; length < good.size(); length += 3) tryTo(good.substr(0, length));
    const std::size_t header = good.size() - 144;
    for (int trial = 0; trial < 1500; ++trial) {
      std::string bad = good;
      for (int change = 0; change <= trial % 3; ++change) bad[random() % header] = static_cast<char>(random());
      tryTo(bad);
    }
    EXPECT_GT(refused, 300) << file;
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
}

}  // namespace
}  // namespace angio::test
