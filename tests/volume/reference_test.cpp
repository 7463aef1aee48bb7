// SPDX-License-Identifier: GPL-2.0-or-later
// VMTK's own centreline of its test aorta, from VMTK's level set and surface. The centreline is in RAS, the volume's
// matrix says LPS with two axes turned: whoever ignores either misses the vessel by decimetres.
#include <gtest/gtest.h>

#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/volume/coverage.hpp"
#include "angio/volume/extract_tree.hpp"
#include "angio/volume/mesh_files.hpp"
#include "angio/volume/shape.hpp"
#include "angio/volume/volume_files.hpp"

namespace angio::test {
namespace {

constexpr double kVoxel = 0.878906e-3;  // The volume's smallest spacing.

void expectReference(const Volume& shape) {
  CentrelineSettings settings;
  settings.ends = CentrelineEnd::kSphere;  // As VMTK's lines end.
  const VesselTree tree = extractTree(shape, settings).tree;
  const VesselTree reference = withOtherFrame(readVesselTree(test::sharedData("vmtk-aorta/aorta-centerline.vtp")));
  EXPECT_GE(coverage(reference, tree, kVoxel).share, 0.95);
  EXPECT_GE(coverage(tree, reference, kVoxel).share, 0.95);
  EXPECT_EQ(tree.branches().size(), 3U);
}

TEST(Reference, AortaFromVmtksLevelSet) {
  NEED_SHARED_DATA("vmtk-aorta/aorta-final-levelset.mha");
  const std::string path = test::sharedData("vmtk-aorta/aorta-final-levelset.mha");
  expectReference(vesselShape(readVolume(path), ThresholdSettings{0, Inside::kBelow}, {}, {}));
}

TEST(Reference, AortaFromVmtksSurface) {
  NEED_SHARED_DATA("vmtk-aorta/aorta-surface.vtp");
  const std::string path = test::sharedData("vmtk-aorta/aorta-surface.vtp");
  expectReference(vesselShape(readMesh(path, kVoxel, PatientFrame::kRas), {}, {}));
}

TEST(Reference, HepaticMaskBecomesATree) {
  NEED_SHARED_DATA("msd-hepatic-masks/hepaticvessel_002_vsnet.nii.gz");
  const std::string path = test::sharedData("msd-hepatic-masks/hepaticvessel_002_vsnet.nii.gz");
  const Volume volume = readVolume(path);
  EXPECT_EQ(volume.grid.size, Eigen::Vector3i(512, 512, 66));
  const ExtractedTree found = extractTree(vesselShape(volume, LabelSettings{{1}}, {}, {}), {});
  EXPECT_GT(found.tree.length(), 0.5);
  // All of it lies in the mask, or within the thickness of a slice of it.
  for (int i = 0; i < found.tree.size(); ++i) {
    const Eigen::Vector3d index = volume.grid.indexAt(found.tree.points().col(i));
    bool near = false;
    for (int k = 0; k < 27; ++k) {
      const Eigen::Vector3i v =
          index.array().round().cast<int>().matrix() + Eigen::Vector3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      near = near || (volume.grid.holds(v) && volume.values[volume.grid.offset(v)] == 1);
    }
    EXPECT_TRUE(near) << i;
  }
}

}  // namespace
}  // namespace angio::test
