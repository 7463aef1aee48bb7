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

}  // namespace angio::geometry
