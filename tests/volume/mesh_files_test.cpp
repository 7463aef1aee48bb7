// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/mesh_files.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/volume/extract_tree.hpp"
#include "angio/volume/shape.hpp"
#include "phantom.hpp"

namespace angio {
namespace {

using Triangle = std::array<Eigen::Vector3f, 3>;

// A pipe of radius 3 mm along z from (20, 30, 0) to 40 mm, without lids.
std::vector<Triangle> openPipe() {
  constexpr int kSides = 48;
  std::vector<Triangle> triangles;
  const auto corner = [](int side, float z) {
    const double angle = 2 * kPi * (side % kSides) / kSides;
    return Eigen::Vector3f(static_cast<float>(20 + 3 * std::cos(angle)), static_cast<float>(30 + 3 * std::sin(angle)),
                           z);
  };
  for (int s = 0; s < kSides; ++s) {
    triangles.push_back({corner(s, 0), corner(s + 1, 0), corner(s, 40)});
    triangles.push_back({corner(s + 1, 0), corner(s + 1, 40), corner(s, 40)});
  }
  return triangles;
}

std::string binaryStl(const std::vector<Triangle>& triangles) {
  std::string bytes(84, '\0');
  const auto count = static_cast<std::uint32_t>(triangles.size());
  std::memcpy(&bytes[80], &count, 4);
  for (const Triangle& triangle : triangles) {
    bytes += std::string(12, '\0');
    for (const auto& corner : triangle) bytes.append(reinterpret_cast<const char*>(corner.data()), 12);
    bytes += std::string(2, '\0');
  }
  return bytes;
}

std::string textStl(const std::vector<Triangle>& triangles) {
  std::string text = "solid pipe\n";
  for (const Triangle& triangle : triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const auto& c : triangle) {
      text += "vertex " + test::number(c.x()) + " " + test::number(c.y()) + " " + test::number(c.z()) + "\n";
    }
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid pipe\n";
}

TEST(MeshFiles, PipeBecomesItsAxisInBothForms) {
  const test::TemporaryFolder folder;
  for (const std::string& content : {binaryStl(openPipe()), textStl(openPipe())}) {
    const VoxelMask mask = readMesh(folder.write("pipe.stl", content), 0.5e-3, PatientFrame::kRas);
    const VesselTree tree = extractTree(vesselShape(mask, {}, {}), {}).tree;
    EXPECT_EQ(tree.branches().size(), 1U);
    EXPECT_NEAR(tree.length(), 40e-3, 1e-3);  // A voxel at each lid.
    for (int i = 0; i < tree.size(); ++i) {
      // RAS in the file, LPS here.
      EXPECT_LT((tree.points().col(i).head<2>() - Eigen::Vector2d(-20e-3, -30e-3)).norm(), 0.25e-3);
      EXPECT_NEAR(*tree.radii()[static_cast<std::size_t>(i)], 3e-3, 0.25e-3);
    }
  }
}

TEST(MeshFiles, BrokenOnesAreRefusedInSilence) {
  const test::TemporaryFolder folder;
  const std::string good = binaryStl(openPipe()), text = textStl(openPipe());
  testing::internal::CaptureStderr();
  const auto refusal = [&](const std::string& name, const std::string& content, double voxel_m) {
    const std::string path = folder.write(name, content);
    const std::string message = test::refusalOf([&] { readMesh(path, voxel_m, PatientFrame::kLps); });
    EXPECT_EQ(message.find('\n'), std::string::npos);
    return message;
  };
  EXPECT_NE(refusal("a.stl", good.substr(0, good.size() - 1), 1e-3).find("must be those of the triangles"),
            std::string::npos);
  EXPECT_NE(refusal("a.stl", "", 1e-3).find("must be those of the triangles"), std::string::npos);
  EXPECT_NE(refusal("a.stl", text.substr(0, text.size() / 2), 1e-3).find("the file ends within them"),
            std::string::npos);
  EXPECT_NE(refusal("a.stl", "solid\nvertex 1 2 x\n", 1e-3).find("vertex = x: must be a number"), std::string::npos);
  EXPECT_NE(refusal("a.stl", "solid\nendsolid\n", 1e-3).find("triangles = 0: must hold a surface"), std::string::npos);
  EXPECT_NE(refusal("a.stl", good, 1e-6).find("would make more than"), std::string::npos);
  EXPECT_NE(refusal("a.vtp", "<VTKFile", 1e-3).find("must hold a surface"), std::string::npos);
  EXPECT_NE(refusal("a.vtk", "# vtk", 1e-3).find("surface"), std::string::npos);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace angio
