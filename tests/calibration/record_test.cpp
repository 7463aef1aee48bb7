// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/record.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"
#include "information.hpp"

namespace angio::test {
namespace {

using namespace std::chrono;

CalibrationRecord record() {
  CalibrationRecord r;
  r.kind = "camera";
  r.machine = "lab 1: \"east\"";
  r.date = "2026-01-31T12:00:00Z";
  r.inputs = {{"views/a b.yaml", std::string(64, 'a')}};
  r.parameters = {"fx_px", "z_mm"};
  r.values = Eigen::Vector2d(3880.123456789, 1e-17);
  r.covariance = (Eigen::Matrix2d() << 4, 1.9e-5, 1.9e-5, 1e-10).finished();
  r.condition = 39;
  r.weak_directions = {{"fx_px + 5e-06 z_mm", 2, "px"}};
  r.residual_unit = "px";
  r.residual_rms = 0.1;
  r.held_out_rms = 0.12;
  r.views = {{"0001", 100, 0.1, false}, {"0002", 99, 7, true}};
  return r;
}

std::vector<CalibrationRecord> readBack(const test::TemporaryFolder& folder, const std::string& yaml) {
  const std::string path = folder.write("r.yaml", yaml);
  const YamlNode root = readYaml(path);
  return readRecords({path, "calibration", &root});
}

std::string fileOf(const CalibrationRecord& r) { return asYaml({{r.kind, recordAsJson(r)}}); }

TEST(CalibrationRecord, ComesBackAsItWasWritten) {
  const test::TemporaryFolder folder;
  const CalibrationRecord r = record();
  const auto back = readBack(folder, fileOf(r));
  ASSERT_EQ(back.size(), 1U);
  EXPECT_EQ(recordAsJson(back[0]), recordAsJson(r));
  EXPECT_EQ(back[0].kind, "camera");
  EXPECT_DOUBLE_EQ(back[0].sigma("z_mm"), 1e-5);
}

TEST(CalibrationRecord, WrongOnesAreRefused) {
  const test::TemporaryFolder folder;
  const auto refusal = [&](const char* from, const char* to) {
    std::string yaml = fileOf(record());
    const auto at = yaml.find(from);
    EXPECT_NE(at, std::string::npos) << yaml;
    yaml.replace(at, std::string(from).size(), to);
    return test::refusalOf([&] { readBack(folder, yaml); });
  };
  EXPECT_NE(refusal("2026-01-31T", "2026-02-31T").find("must be a date"), std::string::npos);
  EXPECT_NE(refusal("2026-01-31T12:00:00Z", "yesterday").find("r.yaml:2: date"), std::string::npos);
  EXPECT_NE(refusal("[4, 1.9e-05]", "[4, 2.9e-05]").find("must be symmetric"), std::string::npos);
  EXPECT_NE(refusal("[1.9e-05, 1e-10]", "[1.9e-05, -1e-10]").find("positive semidefinite"), std::string::npos);
  EXPECT_NE(refusal("[4, 1.9e-05]", "[4]").find("list of 2 numbers"), std::string::npos);
  EXPECT_NE(refusal("aaaa", "xyzw").find("64 hexadecimal digits"), std::string::npos);
  EXPECT_NE(refusal("camera", "cameras").find("unknown key"), std::string::npos);
}

TEST(CalibrationRecord, AnotherMachinesIsRefusedAndAnOldOneIsWarnedOf) {
  const system_clock::time_point made(seconds(1769860800));  // date -u -d 2026-01-31T12:00:00Z +%s
  CalibrationRecord r = record();
  r.machine = "lab-1";
  const RecordGate gate{"lab-1", 30};
  EXPECT_TRUE(checkRecords("c.yaml", {r}, gate, made + hours(24 * 29)).empty());
  const auto old = checkRecords("c.yaml", {r}, gate, made + hours(24 * 31 + 11));
  ASSERT_EQ(old.size(), 1U);
  EXPECT_NE(old[0].find("c.yaml: calibration.camera: is 31 days old, more than 30"), std::string::npos) << old[0];
  EXPECT_EQ(checkRecords("c.yaml", {r}, gate, made - hours(72)).size(), 1U);
  EXPECT_NE(test::refusalOf([&] {
              checkRecords("c.yaml", {r}, {"lab-2", 30}, made);
            }).find("c.yaml: calibration.camera.machine = lab-1: must be of the machine that is used, lab-2"),
            std::string::npos);
  r.machine = "";
  EXPECT_EQ(checkRecords("c.yaml", {r}, gate, made).size(), 1U);
}

TEST(CalibrationRecord, AHashIsThatOfTheStandard) {
  const test::TemporaryFolder folder;  // FIPS 180-2, B.1.
  EXPECT_EQ(hashedInput(folder.write("abc", "abc")).sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

// Two parameters of which the data see only the sum well: the difference is weak, at any units.
TEST(Observability, NamesWhatCannotBeToldApart) {
  for (const double unit : {1.0, 1e-6}) {
    const Eigen::Vector3d sum(1, unit, 0), difference(1, -unit, 0);
    Eigen::Matrix3d information = 1e4 * sum * sum.transpose() + 1 * difference * difference.transpose();
    information(2, 2) = 25;
    const Observability o = observability({"f_px", "z_mm", "c_px"}, information.inverse());
    ASSERT_EQ(o.weak_directions.size(), 1U);
    const WeakDirection& weak = o.weak_directions[0];
    EXPECT_TRUE(weak.name == "f_px - 1 z_mm" || weak.name == "z_mm - 1 f_px" || weak.name == "f_px - 1e+06 z_mm" ||
                weak.name == "z_mm - 1e-06 f_px")
        << weak.name;
    const bool first_is_f = weak.name[0] == 'f';
    // The difference (1, -1) has information 4, so each of the two changes by 1/2.
    EXPECT_NEAR(weak.sigma, first_is_f ? 0.5 : 0.5 / unit, 1e-3 * weak.sigma);
    EXPECT_EQ(weak.unit, first_is_f ? "px" : "mm");
    EXPECT_NEAR(o.condition, 1e4, 100);
  }
}

TEST(Observability, FindsNothingInIndependentParameters) {
  const Eigen::Vector3d variances(1e-12, 1, 1e6);
  const Observability o = observability({"a_m", "b_px", "c_mm"}, variances.asDiagonal());
  EXPECT_TRUE(o.weak_directions.empty());
  EXPECT_NEAR(o.condition, 1, 1e-9);
}

}  // namespace
}  // namespace angio::test
