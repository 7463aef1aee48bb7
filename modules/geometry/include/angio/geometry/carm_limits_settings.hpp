// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/geometry/carm_limits.hpp"

namespace angio::geometry {

/// The limits of a machine as its data sheet gives them.
struct CArmLimitsSettings {
  double primary_deg[2] = {-120, 120}, secondary_deg[2] = {-60, 60};
  double table_x_mm[2] = {-300, 300}, table_y_mm[2] = {-300, 300}, table_z_mm[2] = {-300, 300};
  double angle_speeds_deg_per_s[2] = {25, 25};
  double angle_accelerations_deg_per_s2[2] = {40, 40};
  double angle_jerks_deg_s3[2] = {160, 160};
  double table_speeds_mm_per_s[3] = {100, 100, 100};
  double table_accelerations_mm_per_s2[3] = {200, 200, 200};
  double table_jerks_mm_s3[3] = {800, 800, 800};
  enum class Envelope { kNone, kTypical } envelope = Envelope::kTypical;

  void visit(SettingsVisitor& v);

  /// Throws InputError when a range is empty: what no field shows by itself.
  void check() const;

  /// In rad and m. @param isocenter_detector_m  Of the C-arm: where its detector's front is. Throws InputError as
  /// check() does, and when the distance is not positive and the envelope asks for it.
  CArmLimits limits(double isocenter_detector_m) const;
};

}  // namespace angio::geometry
