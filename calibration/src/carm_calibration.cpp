// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/carm_calibration.hpp"

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/io/settings_files.hpp"

namespace angio {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr double kUnread = 1e9;  // Outside every range below: a field that still has it was not in the file.

// The file's fields in the file's units.
struct CalibrationFile {
  double source_isocentre_distance_mm = kUnread, source_detector_distance_mm = kUnread, pixel_spacing_mm = kUnread;
  double image_size_px[2] = {kUnread, kUnread};
  RowMajor3d rotation = RowMajor3d::Constant(kUnread), R_lps_model = RowMajor3d::Identity();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Constant(kUnread);

  void visit(SettingsVisitor& v) {
    v.number("source_isocentre_distance_mm", source_isocentre_distance_mm, 1, 10000);
    v.number("source_detector_distance_mm", source_detector_distance_mm, 1, 10000);
    v.number("pixel_spacing_mm", pixel_spacing_mm, 1e-4, 100);
    v.numbers("image_size_px", image_size_px, 2, 1, 32768);
    v.section("T_dsa_cb", [&](SettingsVisitor& inner) {
      inner.numbers("rotation", rotation.data(), 9, -1.001, 1.001);
      inner.numbers("translation_mm", translation_mm.data(), 3, -1e5, 1e5);
    });
    v.numbers("R_lps_model", R_lps_model.data(), 9, -1.001, 1.001);
  }
};

// Refuses the first field that was not read.
class Completeness final : public SettingsVisitor {
 public:
  explicit Completeness(std::string place, std::string section = "")
      : place_(std::move(place)), section_(std::move(section)) {}

  void number(const char* key, double& value, double, double) override { require(key, value); }
  void numbers(const char* key, double* values, int, double, double) override { require(key, *values); }
  void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields) override {
    Completeness inner(place_, section_ + key + ".");
    visit_fields(inner);
  }
  void integer(const char*, int&, int, int) override {}
  void flag(const char*, bool&) override {}
  void choiceIndex(const char*, int&, const std::vector<std::string>&) override {}

 private:
  void require(const char* key, double value) const {
    if (value == kUnread) throw InputError(place_, section_ + key, "", "is missing");
  }

  std::string place_, section_;
};

Eigen::Matrix3d requireRotation(const std::string& place, const std::string& field, const Eigen::Matrix3d& M) {
  const double defect = rotationDefect(M);
  if (!(defect < 1e-3)) throw InputError(place, field, "R^T R - I up to " + shown(defect), "must be a rotation matrix");
  return nearestRotation(M);
}

}  // namespace

void CArmCalibration::check(const std::string& place) const {
  try {
    carm.check();
  } catch (const InputError& error) {
    throw error.within(place);
  }
  requireRotation(place, "T_dsa_cb.rotation", T_dsa_cb.linear());
  for (const double x : T_dsa_cb.translation()) requireFinite(place, "T_dsa_cb.translation_mm", 1e3 * x);
  requireRotation(place, "R_lps_model", R_lps_model);
}

CArmCalibration readCArmCalibration(const std::string& path) {
  CalibrationFile file = readSettings(path, CalibrationFile{});
  Completeness complete(path);
  file.visit(complete);
  for (const double size : file.image_size_px) {
    if (size != std::floor(size)) throw InputError(path, "image_size_px", shown(size), "must be a whole number");
  }
  CArmCalibration c;
  c.carm.source_isocentre_distance_m = file.source_isocentre_distance_mm * 1e-3;
  c.carm.source_detector_distance_m = file.source_detector_distance_mm * 1e-3;
  c.carm.pixel_spacing_m = file.pixel_spacing_mm * 1e-3;
  c.carm.image_width_px = static_cast<int>(file.image_size_px[0]);
  c.carm.image_height_px = static_cast<int>(file.image_size_px[1]);
  c.T_dsa_cb.linear() = requireRotation(path, "T_dsa_cb.rotation", file.rotation);
  c.T_dsa_cb.translation() = file.translation_mm * 1e-3;
  c.R_lps_model = requireRotation(path, "R_lps_model", file.R_lps_model);
  c.check(path);
  return c;
}

CArmCalibration miscalibrated(const CArmCalibration& truth, const Eigen::Vector3d& centre_model,
                              const Eigen::Vector3d& axis_patient, double angle_rad,
                              const Eigen::Vector3d& shift_patient_m) {
  CArmCalibration wrong = truth;
  const Eigen::Vector3d centre_patient = truth.T_dsa_cb * centre_model;
  wrong.T_dsa_cb.linear() = expSO3(axis_patient.normalized() * angle_rad) * truth.T_dsa_cb.linear();
  wrong.T_dsa_cb.translation() = centre_patient + shift_patient_m - wrong.T_dsa_cb.linear() * centre_model;
  return wrong;
}

}  // namespace angio
