// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm_deviations.hpp"

#include <cmath>

namespace angio::geometry {
namespace {

double phaseOf(const CArmFlexTerm& term, double primary_rad, double secondary_rad) {
  return term.frequency_primary * primary_rad + term.frequency_secondary * secondary_rad + term.phase_rad;
}

}  // namespace

double CArmFlexTerm::wave(double primary_rad, double secondary_rad) const {
  return std::sin(phaseOf(*this, primary_rad, secondary_rad)) - std::sin(phase_rad);
}

Twist CArmFlex::at(double primary_rad, double secondary_rad) const {
  Twist sum = Twist::Zero();
  for (int i = 0; i < count; ++i) {
    const CArmFlexTerm& term = terms[i];
    sum += term.wave(primary_rad, secondary_rad) * term.twist;
  }
  return sum;
}

Eigen::Matrix<double, 6, 2> CArmFlex::derivatives(double primary_rad, double secondary_rad) const {
  Eigen::Matrix<double, 6, 2> J = Eigen::Matrix<double, 6, 2>::Zero();
  for (int i = 0; i < count; ++i) {
    const CArmFlexTerm& term = terms[i];
    const Twist slope = std::cos(phaseOf(term, primary_rad, secondary_rad)) * term.twist;
    J.col(0) += term.frequency_primary * slope;
    J.col(1) += term.frequency_secondary * slope;
  }
  return J;
}

CArmFlex CArmFlex::lowOrder() {
  constexpr double kWaves[6][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}, {2, 0}, {0, 2}};
  CArmFlex flex;
  for (const auto& wave : kWaves) {
    for (const double phase_rad : {0.0, kPi / 2}) {
      flex.terms[flex.count++] = {Twist::Zero(), wave[0], wave[1], phase_rad};
    }
  }
  return flex;
}

bool CArmDeviations::movesCamera() const {
  return primary_offset_rad != 0 || secondary_offset_rad != 0 || axis_skew_rad != 0 || axis_gap_m != 0 ||
         source_right_m != 0 || source_down_m != 0 || detector_turn_rad != 0 || detector_roll_rad != 0 ||
         flex.count != 0 || !table.isIdentity(0);
}

const std::array<CArmParameter, kCArmPoseParameters> kCArmPoseParameterNames = {{
    {"primary_offset_deg", kPi / 180},
    {"secondary_offset_deg", kPi / 180},
    {"axis_skew_deg", kPi / 180},
    {"axis_gap_mm", 1e-3},
    {"source_right_mm", 1e-3},
    {"source_down_mm", 1e-3},
    {"source_isocentre_distance_mm", 1e-3},
    {"detector_turn_deg", kPi / 180},
    {"detector_roll_deg", kPi / 180},
    {"table_xx", 1},
    {"table_zx", 1},
    {"table_xy", 1},
    {"table_yy", 1},
    {"table_zy", 1},
    {"table_xz", 1},
    {"table_yz", 1},
    {"table_zz", 1},
}};

}  // namespace angio::geometry
