// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm_limits.hpp"

#include "angio/base/errors.hpp"
#include "angio/geometry/carm_limits_settings.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::geometry {

CArmLimits CArmLimits::typical() {
  CArmLimitsSettings settings;
  settings.envelope = CArmLimitsSettings::Envelope::kNone;
  return settings.limits(0);
}

CArmLimits CArmLimits::typical(double isocenter_detector_m) {
  return CArmLimitsSettings().limits(isocenter_detector_m);
}

const CArmEnvelope::Face* CArmEnvelope::violated(const CArmJoints& joints) const {
  const Face* worst = nullptr;
  for (const Face& face : faces) {
    const double room = face.room(joints);
    if (!(room >= 0) && (!worst || room < worst->room(joints))) worst = &face;
  }
  return worst;
}

CArmEnvelope CArmEnvelope::typical(double isocenter_detector_m) {
  constexpr double kKept_m = 0.02, kHalfTable_m = 0.23, kTableBelow_m = 0.15, kPatientAbove_m = 0.10,
                   kDetectorHalf_m = 0.10;
  requirePositive("c-arm envelope", "isocentre_detector_mm", 1e3 * isocenter_detector_m);
  const auto joints = [](double p, double s, double x, double y, double z) {
    return CArmJoints((CArmJoints() << p, s, x, y, z).finished());
  };
  const double beside_m = isocenter_detector_m - kHalfTable_m - kKept_m + kTableBelow_m * kPi / 2;
  const double above_m = isocenter_detector_m - kPatientAbove_m - kKept_m;
  CArmEnvelope envelope;
  envelope.faces = {{"detector and the table's left side", joints(kTableBelow_m, 0, 1, 0, 0), beside_m},
                    {"detector and the table's right side", joints(-kTableBelow_m, 0, -1, 0, 0), beside_m},
                    {"detector and a raised patient, cranial", joints(0, kDetectorHalf_m, 0, -1, 0), above_m},
                    {"detector and a raised patient, caudal", joints(0, -kDetectorHalf_m, 0, -1, 0), above_m}};
  for (const double p : {1.0, -1.0}) {
    for (const double s : {2.0, -2.0}) envelope.faces.push_back({"arm and patient", joints(p, s, 0, 0, 0), kPi});
  }
  return envelope;
}

void CArmLimitsSettings::visit(SettingsVisitor& v) {
  v.numbers("primary_deg", primary_deg, 2, -360, 360, "Range of the primary angle: least and most");
  v.numbers("secondary_deg", secondary_deg, 2, -360, 360, "Range of the secondary angle: least and most");
  v.numbers("table_x_mm", table_x_mm, 2, -3000, 3000, "Range of the table along x: least and most");
  v.numbers("table_y_mm", table_y_mm, 2, -3000, 3000, "Range of the table along y: least and most");
  v.numbers("table_z_mm", table_z_mm, 2, -3000, 3000, "Range of the table along z: least and most");
  v.numbers("angle_speeds_deg_per_s", angle_speeds_deg_per_s, 2, 1e-3, 1e3,
            "Largest speeds of the primary and the secondary angle");
  v.numbers("angle_accelerations_deg_per_s2", angle_accelerations_deg_per_s2, 2, 1e-3, 1e4,
            "Largest accelerations of the primary and the secondary angle");
  v.numbers("angle_jerks_deg_s3", angle_jerks_deg_s3, 2, 1e-3, 1e6,
            "Largest jerks of the primary and the secondary angle");
  v.numbers("table_speeds_mm_per_s", table_speeds_mm_per_s, 3, 1e-3, 1e4, "Largest speeds of the table along x, y, z");
  v.numbers("table_accelerations_mm_per_s2", table_accelerations_mm_per_s2, 3, 1e-3, 1e5,
            "Largest accelerations of the table along x, y, z");
  v.numbers("table_jerks_mm_s3", table_jerks_mm_s3, 3, 1e-3, 1e7, "Largest jerks of the table along x, y, z");
  v.choice("envelope", envelope, {"none", "typical"},
           "Where detector, table and patient would touch: nowhere, or as of a typical machine");
}

void CArmLimitsSettings::check() const {
  const auto range = [](const char* key, const double(&ends)[2]) {
    if (!(ends[0] < ends[1])) {
      throw InputError("limits", key, formatValue(ends[0]) + ", " + formatValue(ends[1]),
                       "must go up from the least to the most");
    }
  };
  range("primary_deg", primary_deg);
  range("secondary_deg", secondary_deg);
  range("table_x_mm", table_x_mm);
  range("table_y_mm", table_y_mm);
  range("table_z_mm", table_z_mm);
}

CArmLimits CArmLimitsSettings::limits(double isocenter_detector_m) const {
  check();
  CArmLimits result;
  const auto joints = [](const double(&angles_deg)[2], const double(&table_mm)[3]) {
    CArmJoints values;
    values << degToRad(angles_deg[0]), degToRad(angles_deg[1]), 1e-3 * table_mm[0], 1e-3 * table_mm[1],
        1e-3 * table_mm[2];
    return values;
  };
  const auto ends = [&](int which) {
    return joints({primary_deg[which], secondary_deg[which]},
                  {table_x_mm[which], table_y_mm[which], table_z_mm[which]});
  };
  result.lower = ends(0);
  result.upper = ends(1);
  result.velocity = joints(angle_speeds_deg_per_s, table_speeds_mm_per_s);
  result.acceleration = joints(angle_accelerations_deg_per_s2, table_accelerations_mm_per_s2);
  result.jerk = joints(angle_jerks_deg_s3, table_jerks_mm_s3);
  if (envelope == Envelope::kTypical) result.envelope = CArmEnvelope::typical(isocenter_detector_m);
  return result;
}

}  // namespace angio::geometry
