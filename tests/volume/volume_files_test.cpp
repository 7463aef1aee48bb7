// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/volume_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

Volume smallVolume() {
  Volume volume{test::obliqueGrid({5, 4, 3}, {0.7e-3, 0.9e-3, 2.5e-3}), {}};
  test::Random random(1);
  for (std::size_t i = 0; i < volume.grid.count(); ++i)
    volume.values.push_back(static_cast<float>(random.uniform(-10, 1000)));
  return volume;
}

std::string packed(const std::string& bytes, int window) {
  z_stream stream{};
  deflateInit2(&stream, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&stream, bytes.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(out.size() - stream.avail_out);
  deflateEnd(&stream);
  return out;
}

void expectSame(const Volume& back, const Volume& volume, const std::string& name) {
  EXPECT_EQ(back.grid.size, volume.grid.size) << name;
  EXPECT_EQ(back.values, volume.values) << name;
  // NIfTI keeps single precision: 1e-7 of some millimetres.
  EXPECT_LT((back.grid.spacing_m - volume.grid.spacing_m).cwiseAbs().maxCoeff(), 1e-9) << name;
  EXPECT_LT((back.grid.origin_m - volume.grid.origin_m).cwiseAbs().maxCoeff(), 1e-8) << name;
  EXPECT_LT((back.grid.direction - volume.grid.direction).cwiseAbs().maxCoeff(), 1e-6) << name;
}

TEST(VolumeFiles, EveryFormatGivesTheSameVoxelsInTheSamePlace) {
  const test::TemporaryFolder folder;
  const Volume volume = smallVolume();
  const std::string meta = test::metaImage(volume), nii = test::nifti(volume), nrrd = test::nrrd(volume);
  const std::string data = test::bytesOf(volume.values), small = packed(data, 15);
  const std::string header = meta.substr(0, meta.size() - data.size());
  folder.write("beside.raw", data);
  folder.write("beside.zraw", small);
  const std::pair<std::string, std::string> files[] = {
      {"v.mha", meta},
      {"w.MHA", with(with(header, "CompressedData = False",
                          "CompressedData = True\nCompressedDataSize = " + std::to_string(small.size())),
                     "= LOCAL", "= LOCAL") +
                    small},
      {"v.mhd", with(header, "LOCAL", "beside.raw")},
      {"v.nii", nii},
      {"v.nii.gz", packed(nii, 31)},
      {"v.nrrd", nrrd},
      {"w.nrrd", with(nrrd.substr(0, nrrd.size() - data.size()), "raw", "gzip") + packed(data, 31)},
      {"v.nhdr",
       with(nrrd.substr(0, nrrd.size() - data.size()), "encoding: raw", "encoding: raw\ndata file: beside.raw")}};
  for (const auto& [name, content] : files) expectSame(readVolume(folder.write(name, content)), volume, name);
}

TEST(VolumeFiles, AxesOfTheFileDecideWhereAVoxelIs) {
  // The trap of a direction matrix: the same bytes, turned by it, lie on the other side of the origin.
  const test::TemporaryFolder folder;
  Volume volume = smallVolume();
  volume.grid.direction.setIdentity();
  volume.grid.origin_m = {0.1, 0.2, 0.3};
  Volume turned = volume;
  turned.grid.direction.diagonal() = Eigen::Vector3d(-1, -1, 1);
  const Eigen::Vector3d index(4, 3, 2);
  const Eigen::Vector3d a = readVolume(folder.write("a.mha", test::metaImage(volume))).grid.pointAt(index);
  const Eigen::Vector3d b = readVolume(folder.write("b.mha", test::metaImage(turned))).grid.pointAt(index);
  EXPECT_LT((a - Eigen::Vector3d(0.1028, 0.2027, 0.305)).norm(), 1e-9);
  EXPECT_LT((b - Eigen::Vector3d(0.0972, 0.1973, 0.305)).norm(), 1e-9);
  // NIfTI's numbers for the same place have the other signs in x and y.
  const Volume n = readVolume(folder.write("b.nii", test::nifti(turned)));
  EXPECT_LT((n.grid.pointAt(index) - b).norm(), 1e-8);
}

TEST(VolumeFiles, IndexAndPointAreInverse) {
  const VoxelGrid grid = smallVolume().grid;
  const Eigen::Vector3d index(1.25, -3, 7.5);
  EXPECT_LT((grid.indexAt(grid.pointAt(index)) - index).norm(), 1e-12);
}

}  // namespace
}  // namespace angio::test
