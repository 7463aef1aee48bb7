// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>
#include <visp3/core/vpXmlParserCamera.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "angio/io/camera_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

TEST(CameraFiles, RoundTripKeepsEveryNumber) {
  const TemporaryFolder folder;
  const XrayCamera camera = XrayCamera::centered(1024, 960, 0.308e-3, 1.195);
  writeCamera(folder.path("c.YAML"), camera);
  const auto& a = camera.parameters();
  const auto b = readCamera(folder.path("c.YAML")).parameters();
  EXPECT_EQ(a.width_px, b.width_px);
  EXPECT_EQ(a.height_px, b.height_px);
  EXPECT_EQ(a.fx_px, b.fx_px);
  EXPECT_EQ(a.cy_px, b.cy_px);
  EXPECT_EQ(*a.pixel_spacing_m, *b.pixel_spacing_m);
  EXPECT_EQ(*a.source_detector_distance_m, *b.source_detector_distance_m);
}

TEST(CameraFiles, ReadsWhatVispWrites) {
  const TemporaryFolder folder;
  const std::string path = folder.path("c.xml");
  vpCameraParameters parameters(4100.5, 4101.25, 511.5, 480);
  testing::internal::CaptureStdout();  // ViSP reports that it saves.
  vpXmlParserCamera().save(parameters, path, "xray", 1024, 960);
  testing::internal::GetCapturedStdout();
  const auto p = readCamera(path).parameters();
  EXPECT_EQ(p.width_px, 1024);
  EXPECT_EQ(p.height_px, 960);
  EXPECT_EQ(p.fx_px, 4100.5);
  EXPECT_EQ(p.fy_px, 4101.25);
  EXPECT_EQ(p.cx_px, 511.5);
  EXPECT_EQ(p.cy_px, 480);
}

PoseFile somePose() {
  test::Random random(4);
  PoseFile pose;
  pose.T_camera_model = expSE3(random.twist(0.5, 1));
  const Matrix6d A = Matrix6d::NullaryExpr([&] { return random.normal(); });
  pose.covariance = 1e-6 * A * A.transpose();
  return pose;
}

TEST(PoseFiles, RoundTripKeepsEveryNumber) {
  const TemporaryFolder folder;
  const PoseFile pose = somePose();
  writePose(folder.path("p.yaml"), pose);
  const PoseFile back = readPose(folder.path("p.yaml"));
  EXPECT_EQ(back.model_id, ModelId::kUnknown);
  // Making the rotation exact again costs some roundings.
  EXPECT_LT((back.T_camera_model.linear() - pose.T_camera_model.linear()).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_LT((back.T_camera_model.translation() - pose.T_camera_model.translation()).cwiseAbs().maxCoeff(), 1e-16);
  EXPECT_LT((*back.covariance - *pose.covariance).cwiseAbs().maxCoeff(), 1e-20);
}

// All 64 bits of it, which a double does not hold. A pose that names no tree is of any.
TEST(PoseFiles, APoseIsOfItsTree) {
  const test::TemporaryFolder folder;
  const VesselTree tree = test::branchingTree(4), other = test::branchingTree(5);
  const std::string path = folder.path("p.yaml");
  PoseFile pose = somePose();
  pose.model_id = modelId(tree);
  writePose(path, pose);
  EXPECT_EQ(readPose(path).model_id, pose.model_id);
  EXPECT_NO_THROW(requireTree(path, readPose(path).model_id, tree));
  EXPECT_NE(test::refusalOf([&] { requireTree(path, readPose(path).model_id, other); }).find("p.yaml: model_id = "),
            std::string::npos);
  EXPECT_NO_THROW(requireTree(path, ModelId::kUnknown, other));
  const auto refused = [&](const std::string& id) {
    return test::refusalOf([&] {
      readPose(
          folder.write("q.yaml", "{rotation: [1,0,0,0,1,0,0,0,1], translation_mm: [0,0,0], model_id: " + id + "}"));
    });
  };
  EXPECT_NE(refused("1.5").find("must be a whole number of 64 bits"), std::string::npos) << refused("1.5");
  EXPECT_NE(refused("99999999999999999999").find("64 bits"), std::string::npos);
}

TEST(PoseFiles, RoundedRotationIsMadeExact) {
  const TemporaryFolder folder;
  const PoseFile pose = readPose(folder.write(
      "p.yaml",
      "rotation: [0.866, -0.5, 0, 0.5, 0.866, 0, 0, 0, 1]\ntranslation_mm: [1, -2, 750]\n"
      "covariance: [[1,0,0,0,0,0],[0,1,0,0,0,0],[0,0,1,0,0,0],[0,0,0,1,0,0],[0,0,0,0,1,0],[0,0,0,0,0,2]]\n"));
  EXPECT_LT(rotationDefect(pose.T_camera_model.linear()), 1e-14);
  EXPECT_NEAR(rotationAngle(pose.T_camera_model.linear()), kPi / 6, 1e-4);  // Three digits were given.
  EXPECT_EQ(pose.T_camera_model.translation(), Eigen::Vector3d(0.001, -0.002, 0.75));
  EXPECT_EQ((*pose.covariance)(5, 5), 2);
  EXPECT_FALSE(readPose(folder.write("q.yaml", "{rotation: [1,0,0,0,1,0,0,0,1], translation_mm: [0,0,0]}")).covariance);
}

enum class Color { kRed, kGreen };

struct Inner {
  double spacing_mm = 2;
  void visit(SettingsVisitor& v) { v.number("spacing_mm", spacing_mm, 0, 10, "Distance between points"); }
};

struct Outer {
  int iterations = 20;
  bool nonrigid = false;
  Color color = Color::kRed;
  Inner inner;
  void visit(SettingsVisitor& v) {
    v.integer("iterations", iterations, 1, 100, "Most iterations");
    v.flag("nonrigid", nonrigid, "Whether the tree may deform");
    v.choice("colour", color, {"red", "green"}, "Its colour");
    v.section("inner", [&](SettingsVisitor& w) { inner.visit(w); });
  }
};

TEST(SettingsFiles, FileOverwritesOnlyWhatItNames) {
  const TemporaryFolder folder;
  const Outer s = readSettings(
      folder.write("s.yaml", "# mine\ncolour: green\ninner:\n  spacing_mm: 3.5\nnonrigid: true\n"), Outer{});
  EXPECT_EQ(settingsAsJson(s).dump(),
            R"({"iterations":20,"nonrigid":true,"colour":"green","inner":{"spacing_mm":3.5}})");
  const std::string defaults = settingsAsJson(Outer{}).dump();
  EXPECT_EQ(settingsAsJson(readSettings(folder.write("e.yaml", ""), Outer{})).dump(), defaults);
  EXPECT_EQ(settingsAsJson(readSettings(folder.write("e.yaml", "inner:\n"), Outer{})).dump(), defaults);
}

TEST(SettingsFiles, JsonOfSettingsReadsBackAsSettings) {
  const TemporaryFolder folder;
  Outer s;
  s.iterations = 7;
  s.inner.spacing_mm = 0.1;
  const auto json = settingsAsJson(s);
  EXPECT_EQ(settingsAsJson(readSettings(folder.write("s.yaml", json.dump(1)), Outer{})), json);
}

struct OfEachKind {
  double number = 1.0 / 3, large = 1e5;
  int integer = -7;
  bool flag = true;
  double numbers[3] = {0.1, -2, 1e-9};
  int word = 1, digits = 1, not_a_flag = 0;
  Inner inner;

  void visit(SettingsVisitor& v) {
    v.number("number", number, 1e-3, 1e6, "A number");
    v.number("large", large, 0, 1e6, "A large number");
    v.integer("integer", integer, -10, 2147483647, "An integer");
    v.flag("flag", flag, "A flag");
    v.numbers("numbers", numbers, 3, -2.5, 1, "Three numbers");
    v.choiceIndex("word", word, {"red", "dark_green"}, "A word");
    v.choiceIndex("digits", digits, {"8", "16"}, "A word of digits");
    v.choiceIndex("not_a_flag", not_a_flag, {"on", "it's \"off\": 2 # \\"}, "A word that YAML may take for a flag");
    v.section(
        "inner", [&](SettingsVisitor& w) { inner.visit(w); }, "What is inside");
  }
};

TEST(SettingsFiles, YamlOfSettingsHasMeaningsAndRanges) {
  EXPECT_EQ(settingsAsYaml(OfEachKind{}),
            "number: 0.3333333333333333  # A number; 0.001 to 1e+06\n"
            "large: 1e+05  # A large number; 0 to 1e+06\n"
            "integer: -7  # An integer; -10 to 2147483647\n"
            "flag: true  # A flag; true or false\n"
            "numbers: [0.1, -2, 1e-09]  # Three numbers; each -2.5 to 1\n"
            "word: dark_green  # A word; one of red, dark_green\n"
            "digits: \"16\"  # A word of digits; one of 8, 16\n"
            "not_a_flag: \"on\"  # A word that YAML may take for a flag; one of on, it's \"off\": 2 # \\\n"
            "inner:  # What is inside\n"
            "  spacing_mm: 2  # Distance between points; 0 to 10\n");
  EXPECT_NE(settingsAsYaml(Outer{}).find("\ninner:\n  spacing_mm: 2  # "), std::string::npos)
      << settingsAsYaml(Outer{});
}

TEST(SettingsFiles, YamlOfSettingsReadsBackTheSame) {
  const TemporaryFolder folder;
  OfEachKind s;
  s.number = 0.1 + 0.2;
  s.large = 123456.789;
  s.integer = 2147483647;
  s.flag = false;
  s.numbers[1] = -2.5000000000000004 + 1e-15;
  s.word = 0;
  s.digits = 0;
  s.not_a_flag = 1;
  s.inner.spacing_mm = std::nextafter(2.0, 3.0);
  const OfEachKind read = readSettings(folder.write("s.yaml", settingsAsYaml(s)), OfEachKind{});
  EXPECT_EQ(settingsAsJson(read), settingsAsJson(s));
  EXPECT_EQ(read.number, s.number);
  EXPECT_EQ(read.inner.spacing_mm, s.inner.spacing_mm);
  EXPECT_EQ(settingsAsYaml(read), settingsAsYaml(s));
}

TEST(SettingsFiles, ErrorsNameLineKeyValueAndRule) {
  const TemporaryFolder folder;
  const std::pair<const char*, const char*> cases[] = {
      {"\niterations: 0\n", "s.yaml:2: iterations = 0: must lie between 1 and 100"},
      {"iterations: 2.5", "s.yaml:1: iterations = 2.5: must be an integer"},
      {"iterations: \"2\"", "iterations = \"2\": must be an integer"},
      {"iterations: 99999999999", "iterations = 99999999999: must be an integer"},
      {"iterations:", "iterations = (nothing)"},
      {"iterations: [1]", "iterations = (list of 1)"},
      {"nonrigid: yes", "nonrigid = yes: must be true or false"},
      {"colour: blue", "colour = blue: must be one of red, green"},
      {"inner:\n  spacing_mm: .nan", "s.yaml:2: spacing_mm = .nan: must be a number"},
      {"inner:\n  spacing_mm: 11", "s.yaml:2: spacing_mm = 11: must lie between 0 and 10"},
      {"inner:\n  spacing: 1", "s.yaml:2: spacing = 1: unknown key; there are: spacing_mm"},
      {"inner: 3", "s.yaml:1: inner = 3: must be a map"},
      {"nonrigid: true\nIterations: 5", "s.yaml:2: Iterations = 5: unknown key"},
      {"iterations: 5\niterations: 6", "s.yaml:2: iterations: must not be given twice"},
      {"- 1", "s.yaml:1: settings = (list of 1): must be a map"},
      {"iterations: 5\n  nonrigid: true", "s.yaml:2: is not valid YAML"},
      {"iterations: 5\n---\niterations: 6", "document: there must be only one"},
  };
  for (const auto& [content, expected] : cases) {
    const std::string path = folder.write("s.yaml", content);
    const std::string message = refusalOf([&] { readSettings(path, Outer{}); });
    EXPECT_NE(message.find(expected), std::string::npos) << message << "\nexpected: " << expected;
  }
}

TEST(SettingsFiles, MaliciousYamlIsRefusedQuickly) {
  const TemporaryFolder folder;
  const auto repeated = [](const std::string& text, int count) {
    std::string all;
    for (int i = 0; i < count; ++i) all += text;
    return all;
  };
  const std::string contents[] = {
      repeated("[", 100000),
      repeated("{", 100000),
      repeated("{a: ", 100000),
      repeated("- ", 100000),
      repeated("? ", 100000),
      repeated("a: ", 100000),
      "[" + repeated("a,", 1200000) + "]",
      "a: &a [x, x]\nb: &b [*a, *a]\n",
      "a: !!binary aaaa",
      "a: *b",
      std::string("a: \0b", 5),
      "\xff\xfe" + repeated("a", 999),
      repeated("!", 100000),
      "\"" + repeated("\\u1", 1000),
      "%YAML 9.9\n---\n" + repeated("%", 1000),
      "[a]: b",
  };
  for (const std::string& content : contents) {
    const std::string path = folder.write("s.yaml", content);
    const std::string message = refusalOf([&] { readSettings(path, Outer{}); });
    EXPECT_EQ(message.find(path), 0U) << content.substr(0, 40);
  }
}

}  // namespace
}  // namespace angio::test
