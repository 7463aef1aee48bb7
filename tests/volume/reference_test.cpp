// SPDX-License-Identifier: GPL-2.0-or-later
// VMTK's own centreline of its test aorta, from VMTK's level set and surface. The centreline is in RAS, the volume's
// matrix says LPS with two axes turned: whoever ignores either misses the vessel by decimetres.
#include <gtest/gtest.h>

#include "angio/io/surface_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/volume/coverage.hpp"
#include "angio/volume/extract_tree.hpp"
#include "angio/volume/mesh_files.hpp"
#include "angio/volume/shape.hpp"
#include "angio/volume/volume_files.hpp"
#include "phantom.hpp"
#include "surfaces.hpp"

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
  expectReference(vesselShape(readMesh(path, kVoxel, PatientFrame::kRas).mask, {}, {}));
}

// The surface without what lies beyond a plane across each end of the line, 5 mm before it: open as a simulation's mesh
// is. Every second triangle is turned round.
std::vector<Triangle> cutOpen(const Surface& surface, const VesselTree& line, std::vector<Eigen::Vector3d>& places_mm) {
  std::vector<Eigen::Vector3d> along;
  for (int i = 0; i < line.size(); ++i) {
    const bool root = line.parents()[i] < 0;
    if (!root && !line.children()[i].empty()) continue;
    int inner = i;
    for (double way = 0; way < 5e-3;) {
      const int next = root ? line.children()[inner].front() : line.parents()[inner];
      way += (line.points().col(next) - line.points().col(inner)).norm();
      inner = next;
    }
    places_mm.emplace_back(1e3 * line.points().col(inner));
    along.emplace_back((line.points().col(i) - line.points().col(inner)).normalized());
  }
  std::vector<Triangle> triangles;
  for (const auto& polygon : surface.polygons) {
    Triangle triangle;
    bool keep = true;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d corner = surface.points_mm.col(polygon[static_cast<std::size_t>(k)]);
      triangle[static_cast<std::size_t>(k)] = corner.cast<float>();
      for (std::size_t e = 0; e < along.size(); ++e) {
        const Eigen::Vector3d from = corner - places_mm[e];
        keep = keep && !(from.norm() < 25 && along[e].dot(from) > 0);
      }
    }
    if (triangles.size() % 2 == 1) std::swap(triangle[1], triangle[2]);
    if (keep) triangles.push_back(triangle);
  }
  return triangles;
}

TEST(Reference, AortaCutOpenAndTurnedRoundIsTheSame) {
  NEED_SHARED_DATA("vmtk-aorta/aorta-surface.vtp");
  const VesselTree reference = readVesselTree(test::sharedData("vmtk-aorta/aorta-centerline.vtp"));
  std::vector<Eigen::Vector3d> places_mm;
  const test::TemporaryFolder folder;
  const std::string path = folder.write(
      "open.stl",
      binaryStl(cutOpen(readVtpSurface(test::sharedData("vmtk-aorta/aorta-surface.vtp")), reference, places_mm)));
  const FilledMesh mesh = readMesh(path, kVoxel, PatientFrame::kLps);
  EXPECT_FALSE(repairsOf(mesh.repairs, Flaw::kMixedNormals).empty());
  const auto ends = repairsOf(mesh.repairs, Flaw::kOpenEnd);
  std::vector<Opening> openings;
  for (const Repair& end : ends) openings.push_back({end.at_m, end.radius_m});
  const ExtractedTree found = extractTree(vesselShape(mesh.mask, {}, {}), {}, std::nullopt, {}, openings);
  EXPECT_EQ(found.tree.branches().size(), 3U);
  const Coverage near_reference = coverage(found.tree, reference, kVoxel);
  std::printf("cut open: %.1f %% within a voxel of VMTK's line, %.2f mm at most\n", 100 * near_reference.share,
              1e3 * near_reference.worst_m);
  EXPECT_GE(near_reference.share, 0.95);
  ASSERT_EQ(places_mm.size(), 3U);
  EXPECT_EQ(ends.size(), 3U);
  for (const Eigen::Vector3d& place_mm : places_mm) {
    const auto near = [&](const Eigen::Vector3d& at_m) { return (1e3 * at_m - place_mm).norm(); };
    double lid_mm = 1e3, end_mm = 1e3;
    for (const Repair& end : ends) lid_mm = std::min(lid_mm, near(end.at_m));
    for (int i = 0; i < found.tree.size(); ++i) {
      const bool end = found.tree.parents()[i] < 0 || found.tree.children()[i].empty();
      if (end) end_mm = std::min(end_mm, near(found.tree.points().col(i)));
    }
    // The edge of what is left is jagged by the side of a triangle, 1.5 mm, and the lid has its middle there.
    std::printf("opening: lid %.2f mm, the line's end %.2f mm from VMTK's line\n", lid_mm, end_mm);
    EXPECT_LT(lid_mm, 1.5) << place_mm.transpose();
    EXPECT_LT(end_mm, 1.5) << place_mm.transpose();
  }
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

// Places of voxels of label 1 that touch label 2 [m].
std::vector<Eigen::Vector3d> contactsOfLabels(const Volume& volume) {
  std::vector<Eigen::Vector3d> contacts_m;
  forEachVoxel(volume.grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    if (volume.values[at] != 1) return;
    for (int k = 0; k < 27; ++k) {
      const Eigen::Vector3i u = v + Eigen::Vector3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      if (!volume.grid.holds(u) || volume.values[volume.grid.offset(u)] != 2) continue;
      contacts_m.push_back(volume.grid.pointAt(v.cast<double>()));
      return;
    }
  });
  return contacts_m;
}

// Hepatic and portal veins taken for one label: where the loops of this mask are cut at a contact, the labels say
// whether it is one. The rule was tuned on 008.
TEST(Reference, LoopsOfTwoKindsOfVeinsAreCutWhereTheyTouch) {
  NEED_SHARED_DATA("msd-hepatic-masks/hepaticvessel_002_vsnet.nii.gz");
  int held_out = 0, held_out_right = 0;
  for (const char* const mask : {"008", "002", "010"}) {
    const Volume volume =
        readVolume(test::sharedData("msd-hepatic-masks/hepaticvessel_" + std::string(mask) + "_vsnet.nii.gz"));
    const auto contacts_m = contactsOfLabels(volume);
    const ExtractedTree found = extractTree(vesselShape(volume, LabelSettings{{1, 2}}, {}, {}), {});
    int right = 0, touches = 0;
    for (const Repair& repair : repairsOf(found.repairs, Flaw::kSelfTouch)) {
      ++touches;
      // A slice is up to 5 mm thick, and the mask between slices is interpolated.
      right += std::any_of(contacts_m.begin(), contacts_m.end(),
                           [&](const Eigen::Vector3d& contact_m) { return (contact_m - repair.at_m).norm() < 4e-3; });
    }
    std::printf(
        "%s: %d loops cut where they are thinnest, %d at contacts, %d of those within 4 mm of the other label\n", mask,
        found.count(Flaw::kCycle), touches, right);
    if (std::string(mask) == "008") continue;
    held_out += touches;
    held_out_right += right;
  }
  EXPECT_GE(held_out, 4);
  EXPECT_GT(2 * held_out_right, held_out);  // Of all points of these trees 3.3 and 2.1 % are as near.
}

}  // namespace
}  // namespace angio::test
