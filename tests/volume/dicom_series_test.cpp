// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/volume/volume_files.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

// A slice of computed tomography, explicit little endian: 4 x 3 pixels of 0.5 (down) by 0.8 mm.
struct SliceTags {
  int number = 0;
  double height_mm = 0;
  std::string series = "1.2.3.4";
  std::string orientation = "1\\0\\0\\0\\0\\-1";  // Coronal: x to the left, down to the feet, the normal is +y.
};

std::string element(std::uint16_t group, std::uint16_t tag, const char* type, std::string value) {
  if (value.size() % 2 != 0) value += std::string(type) == "UI" ? '\0' : ' ';
  std::string bytes(8, '\0');
  std::memcpy(&bytes[0], &group, 2);
  std::memcpy(&bytes[2], &tag, 2);
  std::memcpy(&bytes[4], type, 2);
  const auto size = static_cast<std::uint32_t>(value.size());
  if (std::string(type) == "OW" || std::string(type) == "OB") {
    bytes.resize(12);
    std::memcpy(&bytes[8], &size, 4);
  } else {
    const auto short_size = static_cast<std::uint16_t>(size);
    std::memcpy(&bytes[6], &short_size, 2);
  }
  return bytes + value;
}

std::string shortOf(int value) {
  const auto number = static_cast<std::uint16_t>(value);
  return {reinterpret_cast<const char*>(&number), 2};
}

std::string sliceFile(const SliceTags& tags) {
  const std::string uid = "1.2.3.4." + std::to_string(tags.number + 1);
  std::string meta = element(2, 1, "OB", std::string("\0\1", 2)) + element(2, 2, "UI", "1.2.840.10008.5.1.4.1.1.2") +
                     element(2, 3, "UI", uid) + element(2, 0x10, "UI", "1.2.840.10008.1.2.1");
  const auto length = static_cast<std::uint32_t>(meta.size());
  meta = element(2, 0, "UL", {reinterpret_cast<const char*>(&length), 4}) + meta;
  std::string pixels;
  for (int i = 0; i < 12; ++i) pixels += shortOf(100 * tags.number + i);
  return std::string(128, '\0') + "DICM" + meta + element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.2") +
         element(8, 0x18, "UI", uid) + element(8, 0x60, "CS", "CT") + element(0x20, 0xd, "UI", "1.2.3") +
         element(0x20, 0xe, "UI", tags.series) + element(0x20, 0x13, "IS", std::to_string(tags.number)) +
         element(0x20, 0x32, "DS", "10\\" + test::number(tags.height_mm) + "\\30") +
         element(0x20, 0x37, "DS", tags.orientation) + element(0x28, 2, "US", shortOf(1)) +
         element(0x28, 4, "CS", "MONOCHROME2") + element(0x28, 0x10, "US", shortOf(3)) +
         element(0x28, 0x11, "US", shortOf(4)) + element(0x28, 0x30, "DS", "0.5\\0.8") +
         element(0x28, 0x100, "US", shortOf(16)) + element(0x28, 0x101, "US", shortOf(16)) +
         element(0x28, 0x102, "US", shortOf(15)) + element(0x28, 0x103, "US", shortOf(0)) +
         element(0x28, 0x1052, "DS", "-1000") + element(0x28, 0x1053, "DS", "1") + element(0x7fe0, 0x10, "OW", pixels);
}

std::string seriesFolder(const test::TemporaryFolder& folder, const std::vector<SliceTags>& slices) {
  for (const SliceTags& slice : slices) folder.write("file" + std::to_string(slice.number) + ".dcm", sliceFile(slice));
  return folder.path();
}

TEST(DicomSeries, SlicesStandInTheirOrderInSpace) {
  const test::TemporaryFolder folder;
  // The file names and instance numbers run against the positions.
  const Volume volume = readVolume(seriesFolder(folder, {{0, 56}, {1, 54}, {2, 52}, {3, 50}}));
  EXPECT_EQ(volume.grid.size, Eigen::Vector3i(4, 3, 4));
  EXPECT_LT((volume.grid.spacing_m - Eigen::Vector3d(0.8e-3, 0.5e-3, 2e-3)).norm(), 1e-9);
  // Voxel (1, 2, 3) lies 0.8 mm left, 1 mm down and 6 mm behind the first pixel of the front slice.
  EXPECT_LT((volume.grid.pointAt({1, 2, 3}) - Eigen::Vector3d(10.8e-3, 56e-3, 29e-3)).norm(), 1e-9);
  EXPECT_EQ(volume.values[volume.grid.offset({1, 2, 3})], 0 * 100 + 2 * 4 + 1 - 1000);
  EXPECT_EQ(volume.values[volume.grid.offset({0, 0, 0})], 300 - 1000);
}

TEST(DicomSeries, MissingMixedAndTiltedSlicesAreRefused) {
  const auto refusal = [](const std::vector<SliceTags>& slices) {
    const test::TemporaryFolder folder;
    const std::string path = seriesFolder(folder, slices);
    return test::refusalOf([&] { readVolume(path); });
  };
  EXPECT_NE(refusal({{0, 50}, {1, 52}, {2, 56}, {3, 58}}).find("slices must be evenly spaced"), std::string::npos);
  EXPECT_NE(refusal({{0, 50}, {1, 50}, {2, 52}}).find("slices must be evenly spaced"), std::string::npos);
  EXPECT_NE(refusal({{0, 50}}).find("slices = 1: must be at least 2"), std::string::npos);
  EXPECT_NE(refusal({{0, 50}, {1, 52, "1.2.9"}}).find("DICOM series = 2: the folder must hold just one"),
            std::string::npos);
  EXPECT_NE(refusal({{0, 50}, {1, 52, "1.2.3.4", "1\\0\\0\\0\\1\\0"}}).find("orientation"), std::string::npos);
}

TEST(DicomSeries, CutFilesAreRefusedInSilence) {
  const std::string good = sliceFile({1, 52});
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  for (std::size_t length = 0; length < good.size(); length += 7) {
    const test::TemporaryFolder folder;
    seriesFolder(folder, {{0, 50}, {2, 54}});
    folder.write("file1.dcm", good.substr(0, length));
    // A file that is no longer DICOM is not part of the series: then there is a slice less, or nothing to tell.
    try {
      readVolume(folder.path());
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    }
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
}

}  // namespace
}  // namespace angio::test
