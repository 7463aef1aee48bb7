// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>
#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataWriter.h>

#include <algorithm>
#include <cmath>

#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

struct Line {
  std::vector<Eigen::Vector3d> points_mm;
};

// Three outlets: the trunk runs along x for 50 mm and splits twice. `noise_mm` shifts each repetition of the trunk.
std::vector<Line> threeOutlets(double noise_mm) {
  std::vector<Line> lines(3);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d shift(0, 0, k * noise_mm / 2);
    for (int i = 0; i <= 50; ++i) lines[k].points_mm.emplace_back(Eigen::Vector3d(i, 0, 0) + shift);
  }
  for (int i = 1; i <= 30; ++i) lines[0].points_mm.emplace_back(50 + 0.7 * i, 0.7 * i, 0);
  for (int k = 1; k < 3; ++k) {
    for (int i = 1; i <= 20; ++i) lines[k].points_mm.emplace_back(50 + 0.7 * i, -0.7 * i, k * noise_mm / 2);
  }
  for (int i = 1; i <= 10; ++i) lines[1].points_mm.emplace_back(64 + i, -14, 0);
  for (int i = 1; i <= 10; ++i) lines[2].points_mm.emplace_back(64, -14 - i, 0);
  return lines;
}

vtkNew<vtkPolyData> polyData(const std::vector<Line>& lines) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> cells;
  vtkNew<vtkDoubleArray> radius;
  radius->SetName("MaximumInscribedSphereRadius");
  for (const Line& line : lines) {
    cells->InsertNextCell(static_cast<int>(line.points_mm.size()));
    for (const auto& p : line.points_mm) {
      cells->InsertCellPoint(points->InsertNextPoint(p.data()));
      radius->InsertNextValue(3.0);
    }
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetLines(cells);
  data->GetPointData()->AddArray(radius);
  return data;
}

struct Form {
  const char* name;
  void (*choose)(vtkXMLPolyDataWriter&);
};

const Form kForms[] = {
    {"ascii", [](vtkXMLPolyDataWriter& w) { w.SetDataModeToAscii(); }},
    {"binary, zlib", [](vtkXMLPolyDataWriter& w) { w.SetDataModeToBinary(); }},
    {"binary, zlib in many blocks",
     [](vtkXMLPolyDataWriter& w) { w.SetDataModeToBinary(), w.SetBlockSize(256), w.SetHeaderTypeToUInt64(); }},
    {"binary, as it is", [](vtkXMLPolyDataWriter& w) { w.SetDataModeToBinary(), w.SetCompressorTypeToNone(); }},
    {"binary, big endian", [](vtkXMLPolyDataWriter& w) { w.SetDataModeToBinary(), w.SetByteOrderToBigEndian(); }},
    {"appended, base64", [](vtkXMLPolyDataWriter& w) { w.SetDataModeToAppended(), w.EncodeAppendedDataOn(); }},
    {"appended, raw", [](vtkXMLPolyDataWriter& w) { w.SetDataModeToAppended(), w.EncodeAppendedDataOff(); }},
    {"appended, raw, as it is",
     [](vtkXMLPolyDataWriter& w) {
       w.SetDataModeToAppended(), w.EncodeAppendedDataOff(), w.SetCompressorTypeToNone(), w.SetHeaderTypeToUInt64();
     }},
};

std::string writeVtp(const TemporaryFolder& folder, const std::vector<Line>& lines, const Form& form) {
  const std::string path = folder.path("tree.vtp");
  const auto data = polyData(lines);
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetFileName(path.c_str());
  writer->SetInputData(data);
  form.choose(*writer);
  writer->Write();
  return path;
}

int count(const VesselTree& tree, std::size_t children) {
  return static_cast<int>(std::count_if(tree.children().begin(), tree.children().end(),
                                        [&](const auto& list) { return list.size() == children; }));
}

TEST(VtpFiles, RepeatedTrunkBecomesOneInEveryForm) {
  const TemporaryFolder folder;
  for (const Form& form : kForms) {
    SCOPED_TRACE(form.name);
    const VesselTree tree = readVesselTree(writeVtp(folder, threeOutlets(0), form));
    EXPECT_EQ(tree.size(), 51 + 30 + 20 + 10 + 10);
    EXPECT_EQ(std::count(tree.parents().begin(), tree.parents().end(), -1), 1);
    EXPECT_EQ(count(tree, 0), 3);
    EXPECT_EQ(count(tree, 2), 2);
    EXPECT_EQ(tree.branches().size(), 5U);
    const double expected_mm = 50 + 30 * 0.7 * std::sqrt(2) + 20 * 0.7 * std::sqrt(2) + 20;
    EXPECT_NEAR(tree.length() * 1e3, expected_mm, 1e-9);
    EXPECT_DOUBLE_EQ(*tree.radii()[7], 3e-3);
  }
}

TEST(VtpFiles, NearlyRepeatedTrunkBecomesOne) {
  const TemporaryFolder folder;
  const double noise_mm = 0.2;  // Under a tenth of the radius.
  const VesselTree tree = readVesselTree(writeVtp(folder, threeOutlets(noise_mm), kForms[0]));
  EXPECT_EQ(std::count(tree.parents().begin(), tree.parents().end(), -1), 1);
  EXPECT_EQ(count(tree, 0), 3);
  EXPECT_EQ(tree.branches().size(), 5U);
  const double expected_mm = 50 + 50 * 0.7 * std::sqrt(2) + 20;
  EXPECT_NEAR(tree.length() * 1e3, expected_mm, 0.5);  // Two branch roots that are off by the noise, and one step.
}

TEST(VtpFiles, ResampledTrunkBecomesOne) {
  const TemporaryFolder folder;
  std::vector<Line> lines(2);
  for (int i = 0; i <= 100; ++i) lines[0].points_mm.emplace_back(0.37 * i, 0, 0);
  for (int i = 0; i <= 200; ++i)
    lines[1].points_mm.emplace_back(std::min(0.11 * i, 15.0), 0, std::max(0.11 * i - 15, 0.0));
  const VesselTree tree = readVesselTree(writeVtp(folder, lines, kForms[1]));
  EXPECT_EQ(tree.branches().size(), 3U);
  EXPECT_NEAR(tree.length() * 1e3, 37 + 7, 0.37);  // To a step of the first line.
}

TEST(VtpFiles, LinesWithAnotherSourceAreAnotherTree) {
  const TemporaryFolder folder;
  std::vector<Line> lines = threeOutlets(0);
  for (auto& p : lines[2].points_mm) p.z() += 40;
  const VesselTree tree = readVesselTree(writeVtp(folder, lines, kForms[1]));
  EXPECT_EQ(std::count(tree.parents().begin(), tree.parents().end(), -1), 2);
}

TEST(VtpFiles, LinesCutAtBifurcationsAreOneTree) {
  const TemporaryFolder folder;
  const std::vector<Line> whole = threeOutlets(0);
  std::vector<Line> pieces(3);
  const auto piece = [](const Line& line, int from, int to) {
    return Line{{line.points_mm.begin() + from, line.points_mm.begin() + to + 1}};
  };
  pieces[0] = piece(whole[0], 0, 50);
  pieces[1] = piece(whole[0], 50, 80);
  pieces[2] = piece(whole[1], 50, 80);
  const VesselTree tree = readVesselTree(writeVtp(folder, pieces, kForms[1]));
  EXPECT_EQ(tree.size(), 51 + 30 + 30);
  EXPECT_EQ(tree.branches().size(), 3U);
}

TEST(VtpFiles, CutOrChangedFilesAreReadOrRefused) {
  const TemporaryFolder folder;
  std::vector<Line> lines(2);
  for (int i = 0; i < 4; ++i) {
    lines[0].points_mm.emplace_back(i, 0, 0);
    lines[1].points_mm.emplace_back(i, i > 1 ? i : 0, 0);
  }
  int refused = 0;
  const auto tryTo = [&](const std::string& content) {
    try {
      readVesselTree(folder.write("hostile.vtp", content));
    } catch (const InputError&) {
      ++refused;
    }
  };
  unsigned random = 1;
  for (const Form& form : kForms) {
    const std::string good = test::contentOf(writeVtp(folder, lines, form));
    for (std::size_t length = 0; length < good.size(); ++length) tryTo(good.substr(0, length));
    for (int trial = 0; trial < 1500; ++trial) {
      std::string bad = good;
      for (int flips = 0; flips < 1 + trial % 3; ++flips) {
        random = random * 1664525U + 1013904223U;
        bad[(random >> 8) % bad.size()] ^= static_cast<char>(1U << (random >> 5) % 8);
      }
      tryTo(bad);
    }
  }
  EXPECT_GT(refused, 10000);  // Cuts alone are that many.
}

std::string vtp(const std::string& piece_attributes, const std::string& inner,
                const std::string& file_attributes = "") {
  return "<VTKFile type=\"PolyData\" " + file_attributes + ">\n<PolyData>\n<Piece " + piece_attributes + ">\n" + inner +
         "</Piece>\n</PolyData>\n</VTKFile>\n";
}

TEST(VtpFiles, ErrorsNameLineFieldAndRule) {
  const TemporaryFolder folder;
  const std::string counts = "NumberOfPoints=\"2\" NumberOfLines=\"1\"";
  const std::string points = "<Points><DataArray type=\"Float32\" format=\"ascii\">0 0 0 1 0 0</DataArray></Points>\n";
  const auto lines = [](const std::string& connectivity, const std::string& offsets) {
    return "<Lines>\n<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">" + connectivity +
           "</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">" + offsets +
           "</DataArray></Lines>\n";
  };
  const std::string binary = "<Points><DataArray type=\"Float32\" format=\"binary\">";
  const std::pair<std::string, std::string> cases[] = {
      {vtp("NumberOfPoints=\"2000000000\" NumberOfLines=\"1\"", points),
       ":3: NumberOfPoints = 2e+09: must lie between"},
      {vtp("NumberOfPoints=\"3\" NumberOfLines=\"1\"", points), ":4: DataArray = 6: must have 9 numbers"},
      {vtp("NumberOfPoints=\"-1\" NumberOfLines=\"1\"", points), ":3: NumberOfPoints = -1"},
      {vtp("NumberOfLines=\"1\"", points), "Piece.NumberOfPoints: is missing"},
      {vtp(counts, points), "Lines: is missing"},
      {vtp(counts, points + lines("0 2", "2")), ":6: connectivity = 2: must be a point, 0 to 1"},
      {vtp(counts, points + lines("0 -1", "2")), "connectivity = -1"},
      {vtp(counts, points + lines("0 1", "-2")), ":7: offsets = -2"},
      {vtp(counts, points + lines("0 1", "1e9")), "offsets = 1e+09"},
      {vtp(counts, points + lines("0 0.5x", "2")), "connectivity = 0.5x: must be a number"},
      {vtp(counts, points + lines("0 0", "2")), "at least two different points"},
      {vtp(counts, "<Points><DataArray type=\"Float32\" format=\"ascii\">0 0 0 1 nan 0</DataArray></Points>\n"),
       "nan: must be a finite number"},
      {vtp(counts, binary + "/////w==</DataArray></Points>"), "must be 24 bytes in the data's header"},
      {vtp(counts, binary + "/////wABAAAAAQAA</DataArray></Points>", "compressor=\"vtkZLibDataCompressor\""),
       "the header claims more blocks than there are bytes"},
      {vtp(counts, binary + "AQAAAAAAAP8AAAAABAAAAAAAAAA=</DataArray></Points>",
           "compressor=\"vtkZLibDataCompressor\""),
       "a block is larger than the array"},
      {vtp(counts, points, "compressor=\"vtkLZ4DataCompressor\""), "compressor must be vtkZLibDataCompressor, or none"},
      {vtp(counts, "<Points><DataArray type=\"String\" format=\"ascii\"/></Points>"),
       "String: must be an array of numbers"},
      {vtp(counts, "<Points><DataArray type=\"Int8\" format=\"appended\" offset=\"0\"/></Points>"), "no appended data"},
      {"<VTKFile type=\"ImageData\"></VTKFile>", ":1: 'VTKFile': must be a VTKFile of type PolyData"},
      {"<VTKFile type=\"PolyData\">\n<PolyData>\n</VTKFile>", ":3: is not valid XML: mismatched tag"},
      {"<!DOCTYPE a [<!ENTITY b \"c\">]>\n<VTKFile/>", ":1: '<!DOCTYPE': must not be used here"},
      {"", "is not valid XML"},
  };
  for (const auto& [content, expected] : cases) {
    const std::string path = folder.write("bad.vtp", content);
    const std::string message = refusalOf([&] { readVesselTree(path); });
    EXPECT_NE(message.find(expected), std::string::npos) << message << "\nexpected: " << expected;
    EXPECT_EQ(message.compare(0, path.size(), path), 0) << message;
  }
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  EXPECT_NE(refusalOf([&] { readVesselTree(folder.write("deep.vtp", deep)); }).find("tags = 2001"), std::string::npos);
  const std::string endless = "<VTKFile a=\"" + std::string(1 << 20, '>') + "\"/>";
  EXPECT_NE(refusalOf([&] { readVesselTree(folder.write("a.vtp", endless)); }).find(":1: tag = "), std::string::npos);
}

}  // namespace
}  // namespace angio::test
