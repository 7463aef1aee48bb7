// SPDX-License-Identifier: GPL-2.0-or-later
// Every reader of text against broken files: one InputError that names file, line and field, or a result; never
// anything else. The binary formats have their own sweeps next to their tests.
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "angio/io/camera_files.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

struct Broken {
  std::string content;
  std::string expected;
};

struct Reader {
  std::string file;
  std::function<void(const std::string&)> read;
  std::string good;
  std::vector<Broken> broken;
};

const std::string kHeader = "id,x_mm,y_mm,z_mm,radius_mm,parent\n";
const std::string kHmmRest = ";0;0;0;2.5;0;0;0;0;0;0;0;0;0;\n";
const std::string kHmmGood = "3\n0\n1;0;0" + kHmmRest + "1;\n2;0;0" + kHmmRest + "0;2;\n3;0;0" + kHmmRest + "1;\n";
const std::string kHmmLoop = "3\n0\n1;0;0" + kHmmRest + "1;2;\n2;0;0" + kHmmRest + "0;2;\n3;0;0" + kHmmRest + "0;1;\n";
const std::string kVtk =
    "# vtk DataFile Version 2.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n0 0 0 1 0 0\n2 0 0\n"
    "2 1 0\n2 0 1\nCELLS 3 10\n3 0 1 2\n2 2 3\n2 2 4\nCELL_TYPES 3\n4\n4\n3\n";
const std::string kCameraText =
    "image_size_px: [64, 48]\nfx_px: 1000\nfy_px: 1000\ncx_px: 32\ncy_px: 24\npixel_spacing_mm: 0.3\n"
    "source_detector_distance_mm: 1200\ndistortion: [0, 0]\n";
const std::string kVispCamera =
    "<?xml version=\"1.0\"?>\n<root>\n<camera>\n<name>c</name>\n<image_width>64</image_width>\n"
    "<image_height>48</image_height>\n<model>\n<type>perspectiveProjWithoutDistortion</type>\n<px>1000</px>\n<py>1001</"
    "py>\n"
    "<u0>32</u0>\n<v0>24</v0>\n</model>\n</camera>\n</root>\n";
const std::string kPose =
    "rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1]\ntranslation_mm: [1, 2, 700]\nparent: camera\nchild: model\ncovariance: "
    "[1,0,0,0,0,0,0,1,0,0,0,0,0,0,1,0,0,0,0,0,0,1,0,0,0,0,0,0,1,0,0,0,0,0,0,1]\n";

std::vector<Reader> allReaders() {
  const auto tree = [](const std::string& path) { readVesselTree(path); };
  const auto line = [](const std::string& path) { readCenterline(path); };
  const auto camera = [](const std::string& path) { readCamera(path); };
  const auto pose = [](const std::string& path) { readPose(path); };
  const std::string csv = kHeader + "0,1,2,3,,-1\n1,4,5,6,0.5,0\n2,4,5,7,0.5,1\n";
  const std::string swc = "# c\n1 0 1 2 3 0.5 -1\n2 0 4 5 6 0.5 1\n3 0 7 8 9 0.5 2\n";
  return {
      {"t.csv",
       tree,
       csv,
       {{"", ":1: header: the file is empty"},
        {kHeader, ":2: rows = 0: must have at least one row"},
        {with(csv, "id,x_mm", "id;x_mm"), ":1: header = id;x_mm: must be the columns id,x_mm"},
        {"id\tx_mm\n", ":1: header = id?x_mm"},
        {with(csv, "radius_mm", "radius"), ":1: header = radius:"},
        {with(csv, "radius_mm", "x_mm"), ":1: header = x_mm: must not name a column twice"},
        {with(csv, ",parent", ""), ":1: header: parent is missing"},
        {with(csv, "1,4,5,6,0.5,0", "1,4,5,6,0"), ":3: columns = 5: must be 6"},
        {with(csv, "1,4,5,6,0.5,0", "1;4;5;6;0.5;0"), ":3: columns = 1: must be 6"},
        {with(csv, "1,4,5,6,0.5,0", ""), ":3: columns = 1"},
        {with(csv, "4,5,6", "4,5 6,6"), ":3: y_mm = 5 6: must be a number"},
        {with(csv, "4,5,6", "nan,5,6"), ":3: x_mm = nan: must be a finite number"},
        {with(csv, "4,5,6", "4,5,-inf"), ":3: z_mm = -inf: must be a finite number"},
        {with(csv, "4,5,6", "4,5,0x10"), ":3: z_mm = 0x10: must be a number"},
        {with(csv, "4,5,6", "4,5,1e999"), ":3: z_mm = 1e999: must be a number"},
        {with(csv, "4,5,6", "\"4\",5,6"), ":3: x_mm = \"4\": must be a number"},
        {with(csv, "4,5,6", "4,5,10001"), ":3: z_mm = 10001: must lie within 10,000 mm"},
        {with(csv, "6,0.5,0", "6,-1,0"), ":3: radius_mm = -1: must be positive"},
        {with(csv, "6,0.5,0", "6,0.5,99"), ":3: parent = 99: must be the id of a point"},
        {with(csv, "6,0.5,0", "6,0.5,1"), ":3: parent = 1: a point must not be its own parent"},
        {with(csv, "6,0.5,0", "6,0.5,2"), "parent = 2: the tree must not have a loop"},
        {with(csv, "6,0.5,0", "6,0.5,"), ":3: parent: must be an integer, found nothing"},
        {with(csv, "\n1,", "\n0,"), ":3: id = 0: must be unique, stands on line 2 too"},
        {with(csv, "\n1,", "\n-1,"), ":3: id = -1:"},
        {with(csv, "\n1,", "\n1.0,"), ":3: id = 1.0: must be an integer"},
        {with(csv, "\n1,", "\n99999999999999999999,"), ":3: id = 99999999999999999999: must be an integer"},
        {with(csv, "\n1,", std::string("\n\0,", 3)), ":3: byte = 0: must be text"},
        {kHeader + "0,1,2,3,,-1\n", ":2: points = 1: a tree needs at least two points"},
        {kHeader + "0,1,2,3,,-1\n1,1,2,3,,-1\n", "at least one point must have a parent"},
        {std::string("\x7f"
                     "ELF\2\1\1\0\0",
                     9),
         ":1: byte = 127"},
        {kHeader + std::string(2 << 20, ','), ":2: length = 2097152: a line must not exceed 1 MiB"}}},
      {"t.swc",
       tree,
       swc,
       {{"", ":1: points = 0"},
        {"# nothing\n", "points = 0"},
        {with(swc, " 1\n3", "\n3"), ":3: columns = 6: must be 7"},
        {with(swc, "4 5 6", "4,5,6"), ":3: columns = 5"},
        {with(swc, "4 5 6", "4 x 6"), ":3: y_mm = x: must be a number"},
        {with(swc, "9 0.5", "9 nan"), ":4: radius_mm = nan: must be a finite number"},
        {with(swc, "9 0.5 2", "9 0.5 3"), ":4: parent = 3: a point must not be its own parent"},
        {with(swc, "9 0.5 2", "9 0.5 0"), ":4: parent = 0: must be the id of a point"},
        {with(swc, "\n3 0", "\n2 0"), ":4: id = 2: must be unique, stands on line 3 too"},
        {with(swc, "\n3 0", "\n3 axon"), ":4: type = axon: must be an integer"},
        {with(swc, "3 0.5 -1", "3 0.5 2"), "the tree must not have a loop"}}},
      {"t.txt",
       tree,
       kHmmGood,
       {{"", ":1: points: is missing"},
        {"3\n", ":2: root: is missing"},
        {with(kHmmGood, "3\n0", "2000000\n0"), ":9: point 3: is missing"},
        {with(kHmmGood, "3\n0", "2147483648\n0"), ":1: points = 2147483648"},
        {with(kHmmGood, "3\n0", "1\n0"), ":1: points = 1: must lie between 2"},
        {with(kHmmGood, "3\n0", "2\n0"), "neighbour = 2: must be a point, 0 to 1"},
        {with(kHmmGood, "3\n0", "3\n3"), ":2: root = 3: must lie between 0 and 2"},
        {with(kHmmGood, "1;0;0;", "1;0;"), ":3: columns = 15: must be 16"},
        {with(kHmmGood, "1;0;0;", "1;;0;"), ":3: y_mm: must be a number, found nothing"},
        {with(kHmmGood, "0;0;\n1;\n", "0;0\n1;\n"), ":3: end of line = 0: each value must end with ';'"},
        {with(kHmmGood, "0;2;\n", "0;5;\n"), ":6: neighbour = 5: must be a point, 0 to 2"},
        {with(kHmmGood, "0;2;\n", "0;1;\n"), ":6: neighbour = 1: a point must not be its own"},
        {with(kHmmGood, "0;2;\n", "0;0;\n"), ":6: neighbour = 0: must not be named twice"},
        {with(kHmmGood, "0;2;\n", "0;\n"), ":8: neighbour = 1: must name point 2 as its neighbour too"},
        {with(kHmmGood, "0;2;\n", "\n"), ":6: end of line"},
        {kHmmGood + "1;\n", ":9: points = 3: the file has more than it says"},
        {kHmmLoop, "the tree must not have a loop"},
        {"4\n0\n1;0;0" + kHmmRest + "1;\n2;0;0" + kHmmRest + "0;\n3;0;0" + kHmmRest + "3;\n4;0;0" + kHmmRest + "2;\n",
         ":8: neighbours of point = 2: no way leads here from the root"}}},
      {"t.vtk",
       tree,
       kVtk,
       {{"", ":1: version: is missing"},
        {with(kVtk, "# vtk DataFile", "# VTK file"),
         ":1: first line = # VTK file Version 2.0: must begin # vtk DataFile Version"},
        {with(kVtk, "2.0", "5.1"), ":1: version = 5.1: must lie between 1 and 4.99"},
        {with(kVtk, "ASCII", "BINARY"), ":3: coding = BINARY: must be ASCII"},
        {with(kVtk, "UNSTRUCTURED_GRID", "STRUCTURED_POINTS"),
         ":4: dataset = DATASET STRUCTURED_POINTS: must be DATASET"},
        {with(kVtk, "UNSTRUCTURED_GRID", "POLYDATA"), ":10: keyword = CELLS: must be LINES"},
        {with(kVtk, "POINTS", "POINT"), ":5: keyword = POINT: must be POINTS"},
        {with(kVtk, "POINTS 5", "POINTS 2000000"), ":10: x_mm = CELLS: must be a number"},
        {with(kVtk, "POINTS 5", "POINTS 2000001"), ":5: points = 2000001: must lie between"},
        {with(kVtk, "2 1 0\n", "2 nan 0\n"), ":8: y_mm = nan: must be a finite number"},
        {with(kVtk, "2 1 0\n", "2 1e5 0\n"), ":8: y_mm = 100000: must lie between"},
        {with(kVtk, "CELLS 3", "CELLS 99999"), ":10: lines = 99999: must lie between"},
        {with(kVtk, "CELLS 3 10", "CELLS 3 9"), ":13: size: the lines hold more than it says"},
        {with(kVtk, "CELLS 3 10", "CELLS 3 11"), ":13: size: the lines hold less than it says"},
        {with(kVtk, "2 2 4\n", "1 4\n"), ":13: points of a line = 1: must lie between"},
        {with(kVtk, "2 2 4\n", "2 2 5\n"), ":13: point = 5: must lie between 0 and 4"},
        {with(kVtk, "2 2 4\n", "2 4 4\n"), ":13: point = 4: must not be named twice by one line"},
        {with(kVtk, "2 2 4\n", "2 3 0\n"), ":13: line: the tree must not have a loop"},
        {with(kVtk, "2 2 4\n", "2 0 1\n"), ":13: line: the tree must not have a loop"},
        {with(with(kVtk, "POINTS 5", "POINTS 6"), "2 0 1\n", "2 0 1\n9 9 9\n"), "point = 5: is on no line"},
        {with(kVtk, "4\n4\n3\n", "4\n4\n5\n"), ":17: type: 3 is a line, 4 a polyline = 5"},
        {with(kVtk, "4\n4\n3\n", "4\n4\n"), ":17: type: 3 is a line, 4 a polyline: is missing"},
        {kVtk + "CELLS\n", ":18: keyword = CELLS: must be POINT_DATA"}}},
      {"c.csv",
       line,
       "x_px,y_px,branch,tangent_rad,radius_px\n1,2,0,0.5,3\n2,3,0,0.5,3\n3,3,1,0.5,3\n",
       {{"x_px,y_px\n", ":2: rows = 0"},
        {"x_px,y_px,z_px\n1,2,3\n", ":1: header = z_px: must be the columns x_px,y_px"},
        {"x_px\n1\n", ":1: header: y_px is missing"},
        {"x_px,y_px\n1,\n", ":2: y_px: must be a number, found nothing"},
        {"x_px,y_px\n1,2e9\n", ":2: y_px = 2e+09: must lie between"},
        {"x_px,y_px,branch\n1,2,a\n", ":2: branch = a: must be an integer"},
        {"x_px,y_px,radius_px\n1,2,0\n", ":2: radius_px = 0: must be a positive number"},
        {"x_px,y_px,kind\n1,2,wire\n", ":2: kind = wire: must be vessel or device"},
        {"x_px,y_px,sigma_px\n1,2,-1\n", ":2: sigma_px = -1: must be a positive number"},
        {"x_px,y_px,tangent_rad\n1,2,nan\n", ":2: tangent_rad = nan"}}},
      {"c.yaml",
       camera,
       kCameraText,
       {{"", ":1: image_size_px: is missing"},
        {with(kCameraText, "fx_px: 1000", "fx_px: -5"), ":2: fx_px = -5: must be a positive number"},
        {with(kCameraText, "fx_px: 1000", "fx_px: ~"), ":2: fx_px = "},
        {with(kCameraText, "fx_px: 1000\n", ""), ":1: fx_px: is missing"},
        {with(kCameraText, "[64, 48]", "[64]"), ":1: image_size_px = (list of 1)"},
        {with(kCameraText, "[64, 48]", "[64, 0]"), ":1: image_size_px[1] = 0"},
        {with(kCameraText, "[64, 48]", "[64.5, 48]"), ":1: image_size_px[0] = 64.5: must be an integer"},
        {with(kCameraText, "[64, 48]", "[99999, 48]"), ":1: image_size_px[0] = 99999"},
        {with(kCameraText, "[0, 0]", "[0, 0.1]"), ":8: distortion[1] = 0.1: must be zero"},
        {with(kCameraText, "[0, 0]", "0.2"), ":8: distortion = 0.2: must be zero"},
        {with(kCameraText, "[0, 0]", "{k: 1}"), ":8: model: is missing"},
        {kCameraText + "skew: 0\n", ":9: skew = 0: unknown key"}}},
      {"c.xml",
       camera,
       kVispCamera,
       {{"", "is not valid XML"},
        {"<root>\n</root>", ":1: camera = 0: there must be just one"},
        {with(kVispCamera, "<px>1000", "<px>abc"), ":9: px = abc: must be a number"},
        {with(kVispCamera, "<px>1000", "<px>0"), ":9: px = 0: must be a positive number"},
        {with(kVispCamera, "<px>1000</px>", ""), ":7: px: is missing"},
        {with(kVispCamera, "<py>1001</py>", "<px>1</px>"), ":7: px = 2: must not be given twice"},
        {with(kVispCamera, ">64<", ">0<"), ":5: image_width = 0"},
        {with(kVispCamera, "WithoutDistortion", "WithDistortion"),
         ":3: model = perspectiveProjWithDistortion: must hold"},
        {with(kVispCamera, "</model>", ""), "is not valid XML: mismatched tag"}}},
      {"p.yaml",
       pose,
       kPose,
       {{"", ":1: rotation: is missing"},
        {with(kPose, "[1, 0, 0, 0, 1", "[1, 0, 0, 0, -1"), ":1: rotation = (list of 9): must be a rotation matrix"},
        {with(kPose, "[1, 0, 0, 0, 1", "[1.01, 0, 0, 0, 1"), ":1: rotation = (list of 9): must be a rotation matrix"},
        {with(kPose, "[1, 0, 0, 0, 1", "[1, 0, 0, 1"), ":1: rotation = (list of 8)"},
        {with(kPose, "[1, 0, 0, 0, 1", "[1, 0, 0, a, 1"), ":1: rotation[3] = a: must be a number"},
        {with(kPose, "700", "1e6"), ":2: translation_mm[2] = 1000000: must lie between"},
        {with(kPose, "700", "inf"), ":2: translation_mm[2] = inf"},
        {with(kPose, "camera", "world"), ":3: parent = world: must be camera"},
        {with(kPose, "model", "[model]"), ":4: child = (list of 1): must be a text"},
        {with(kPose, "[1,0,0,0,0,0", "[1,0,0,0,0,9"), ":5: covariance = (list of 36): must be symmetric"},
        {with(kPose, "[1,0,0,0,0,0", "[-1,0,0,0,0,0"), ":5: covariance = (list of 36): must be positive semidefinite"},
        {with(kPose, "[1,0,0,0,0,0", "[1,0,0,0,0"), ":5: covariance = (list of 35): must be a list of 36"},
        {kPose + "scale: 2\n", ":6: scale = 2: unknown key"}}},
  };
}

TEST(HostileFiles, ErrorsNameFileLineFieldAndRule) {
  const TemporaryFolder folder;
  for (const Reader& reader : allReaders()) {
    EXPECT_NO_THROW(reader.read(folder.write(reader.file, reader.good))) << reader.file;
    for (const Broken& broken : reader.broken) {
      const std::string path = folder.write(reader.file, broken.content);
      const std::string message = refusalOf([&] { reader.read(path); });
      EXPECT_NE(message.find(broken.expected), std::string::npos) << message << "\nexpected: " << broken.expected;
      EXPECT_EQ(message.find(path), 0U) << message;
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
  }
}

TEST(HostileFiles, CutOrChangedFilesAreReadOrRefusedInSilence) {
  const TemporaryFolder folder;
  std::mt19937 random(7);
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  for (const Reader& reader : allReaders()) {
    const auto tryTo = [&](const std::string& content) {
      try {
        reader.read(folder.write(reader.file, content));
        return 0;
      } catch (const InputError&) {
        return 1;
      }
    };
    int refused = 0;
    for (std::size_t length = 0; length < reader.good.size(); ++length) refused += tryTo(reader.good.substr(0, length));
    for (int trial = 0; trial < 3000; ++trial) {
      std::string bad = reader.good;
      for (int change = 0; change <= trial % 3; ++change) {
        const std::size_t at = random() % bad.size();
        switch (random() % 4) {
          case 0:
            bad[at] = static_cast<char>(bad[at] ^ (1U << random() % 8));
            break;
          case 1:
            bad[at] = static_cast<char>(random());
            break;
          case 2:
            bad.erase(at, 1 + random() % 5);
            break;
          default:
            bad.insert(at, bad.substr(random() % bad.size(), random() % 20));
        }
        if (bad.empty()) bad = "x";
      }
      refused += tryTo(bad);
    }
    EXPECT_GT(refused, 100) << reader.file;
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
}

TEST(HostileFiles, WrongPathsAreRefusedByEveryReader) {
  const TemporaryFolder folder;
  for (const Reader& reader : allReaders()) {
    const std::string path = folder.path(reader.file);
    EXPECT_EQ(refusalOf([&] { reader.read(path); }).find(path), 0U);
    std::filesystem::create_directory(path);
    EXPECT_EQ(refusalOf([&] { reader.read(path); }).find(path), 0U);
    std::filesystem::remove(path);
  }
  EXPECT_NE(refusalOf([&] {
              readVesselTree("tree.stl");
            }).find("extension = .stl: must be one of .csv, .swc, .vtp, .vtk, .txt"),
            std::string::npos);
  EXPECT_NE(refusalOf([&] { readVesselTree(""); }).find("must be one of"), std::string::npos);
  EXPECT_NE(refusalOf([&] { readCamera("camera"); }).find("must be one of .yaml, .yml, .xml"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
