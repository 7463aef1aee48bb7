// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/mesh_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/volume/extract_tree.hpp"
#include "angio/volume/shape.hpp"
#include "phantom.hpp"
#include "surfaces.hpp"

namespace angio::test {
namespace {

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

std::string vtkPoints(const std::vector<Triangle>& triangles) {
  std::string text;
  for (const Triangle& triangle : triangles) {
    for (const auto& c : triangle) {
      text += test::number(c.x()) + " " + test::number(c.y()) + " " + test::number(c.z()) + "\n";
    }
  }
  return text;
}

// Triangles as cells of their own points, between lines and data that are no surface; from version 5 on as two arrays.
std::string legacyVtk(const std::vector<Triangle>& triangles, int version) {
  const std::size_t n = triangles.size();
  std::string corners, offsets, cells;
  for (std::size_t i = 0; i < 3 * n; ++i) corners += std::to_string(i) + " ";
  for (std::size_t i = 0; i <= n; ++i) offsets += std::to_string(3 * i) + " ";
  for (std::size_t i = 0; i < n; ++i) {
    cells += "3 " + std::to_string(3 * i) + " " + std::to_string(3 * i + 1) + " " + std::to_string(3 * i + 2) + "\n";
  }
  const std::string head = "# vtk DataFile Version " + std::to_string(version) +
                           ".0\ntitle\nASCII\nDATASET POLYDATA\n" + "POINTS " + std::to_string(3 * n) + " float\n" +
                           vtkPoints(triangles) + "METADATA\nINFORMATION 0\n\n";
  if (version < 5) {
    return head + "LINES 1 3\n2 0 1\nPOLYGONS " + std::to_string(n) + " " + std::to_string(4 * n) + "\n" + cells;
  }
  return head + "POLYGONS " + std::to_string(n + 1) + " " + std::to_string(3 * n) + "\nOFFSETS vtktypeint64\n" +
         offsets + "\nCONNECTIVITY vtktypeint64\n" + corners + "\nPOINT_DATA 1\n";
}

// The same in binary, as strips of one triangle each.
std::string binaryVtk(const std::vector<Triangle>& triangles) {
  std::string points, cells;
  const auto put = [](std::string& bytes, auto value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(std::make_reverse_iterator(raw + sizeof value), std::make_reverse_iterator(raw));
  };
  std::int32_t next = 0;
  for (const Triangle& triangle : triangles) {
    put(cells, std::int32_t{3});
    for (const auto& corner : triangle) {
      for (const float x : corner) put(points, x);
      put(cells, next++);
    }
  }
  const std::string n = std::to_string(triangles.size());
  return "# vtk DataFile Version 4.2\ntitle\nBINARY\nDATASET POLYDATA\nPOINTS " + std::to_string(next) + " float\n" +
         points + "\nTRIANGLE_STRIPS " + n + " " + std::to_string(4 * triangles.size()) + "\n" + cells + "\n";
}

// Corners with textures and normals, without, and counted from the last point back.
std::string waveObj(const std::vector<Triangle>& triangles) {
  std::string text = "# a pipe\nmtllib none.mtl\no pipe\nvn 0 0 1\nvt 0 0\n";
  std::size_t points = 0;
  for (const Triangle& triangle : triangles) {
    for (const auto& c : triangle) {
      text += "v " + test::number(c.x()) + " " + test::number(c.y()) + " " + test::number(c.z()) + "\n";
    }
    points += 3;
    const std::string a = std::to_string(points - 2), b = std::to_string(points - 1), c = std::to_string(points);
    const std::string forms[] = {"f " + a + "/1/1 " + b + "/1/1 " + c + "/1/1\n",
                                 "f " + a + "//1 " + b + "//1 " + c + "//1\n", "f -3 -2 -1\n"};
    text += forms[points / 3 % 3];
  }
  return text;
}

// The first half of the triangles as polygons of one piece, the others as strips of a second one.
std::string xmlVtp(const std::vector<Triangle>& triangles) {
  const auto array = [](const char* attributes, const std::string& numbers) {
    return "<DataArray " + std::string(attributes) + " format=\"ascii\">" + numbers + "</DataArray>\n";
  };
  const auto piece = [&](const std::vector<Triangle>& its, const std::string& kind) {
    std::string corners, offsets;
    for (std::size_t i = 0; i < 3 * its.size(); ++i) corners += std::to_string(i) + " ";
    for (std::size_t i = 1; i <= its.size(); ++i) offsets += std::to_string(3 * i) + " ";
    std::string counts;
    for (const char* const name : {"Verts", "Lines", "Polys", "Strips"}) {
      counts += " NumberOf" + std::string(name) + "=\"" + std::to_string(kind == name ? its.size() : 0) + "\"";
    }
    return "<Piece NumberOfPoints=\"" + std::to_string(3 * its.size()) + "\"" + counts + ">\n<Points>" +
           array("type=\"Float32\" NumberOfComponents=\"3\"", vtkPoints(its)) + "</Points>\n<" + kind + ">" +
           array("type=\"Int64\" Name=\"connectivity\"", corners) + array("type=\"Int64\" Name=\"offsets\"", offsets) +
           "</" + kind + ">\n</Piece>\n";
  };
  const auto middle = triangles.begin() + static_cast<long>(triangles.size() / 2);
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
         "byte_order=\"LittleEndian\">\n<PolyData>\n" +
         piece({triangles.begin(), middle}, "Polys") + piece({middle, triangles.end()}, "Strips") +
         "</PolyData>\n</VTKFile>\n";
}

TEST(MeshFiles, OneSurfaceFillsTheSameVoxelsWhateverItsFormat) {
  const test::TemporaryFolder folder;
  const auto read = [&](const std::string& name, const std::string& content) {
    return readMesh(folder.write(name, content), 0.7e-3, PatientFrame::kRas).mask;
  };
  // In all of them each triangle brings corners of its own: only where they are joined is there a wall to put lids on.
  const VoxelMask expected = read("a.stl", textStl(openPipe()));
  for (const auto& [name, content] : {std::pair<std::string, std::string>{"a.vtk", legacyVtk(openPipe(), 3)},
                                      {"b.vtk", legacyVtk(openPipe(), 5)},
                                      {"c.vtk", binaryVtk(openPipe())},
                                      {"d.vtp", xmlVtp(openPipe())},
                                      {"e.obj", waveObj(openPipe())}}) {
    const VoxelMask mask = read(name, content);
    EXPECT_EQ(mask.grid.size, expected.grid.size) << name;
    EXPECT_EQ(mask.inside, expected.inside) << name;
  }
}

TEST(MeshFiles, PipeBecomesItsAxisInBothForms) {
  const test::TemporaryFolder folder;
  for (const std::string& content : {binaryStl(openPipe()), textStl(openPipe())}) {
    const VoxelMask mask = readMesh(folder.write("pipe.stl", content), 0.5e-3, PatientFrame::kRas).mask;
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
  EXPECT_NE(
      refusal("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n", 1e-3).find(":3: corner = 3: must be a point above it, of 2"),
      std::string::npos);
  EXPECT_NE(refusal("a.obj", "v 0 0\n", 1e-3).find(":1: position_mm"), std::string::npos);
  EXPECT_NE(refusal("a.vtp", "<VTKFile", 1e-3).find("is not valid XML"), std::string::npos);
  EXPECT_NE(refusal("a.vtk", "# vtk", 1e-3).find(":1: first line: must begin"), std::string::npos);
  const std::string vtk = legacyVtk(openPipe(), 3);
  EXPECT_NE(refusal("a.vtk", vtk.substr(0, vtk.size() / 3), 1e-3).find("position_mm: must be a number"),
            std::string::npos);
  EXPECT_NE(refusal("a.vtk", vtk.substr(0, vtk.rfind(' ')), 1e-3).find("cells: must be a number"), std::string::npos);
  EXPECT_NE(refusal("a.vtk", "# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nPOINTS 9999999 float\n", 1e-3)
                .find(":6: position_mm = 29999997: the file ends within them"),
            std::string::npos);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace angio::test
