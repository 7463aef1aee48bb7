// SPDX-License-Identifier: GPL-2.0-or-later
#include "drawn_frames.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// How far the target really was from the image's middle, as a distance at the isocentre.
struct Kept {
  Eigen::Vector2d mean_mm = Eigen::Vector2d::Zero();
  double rms_mm = 0;
  int held = 0;
};

// How frames are made, and places as shares of the tree: those that were looked at when the weight of the local look
// was chosen, and others.
struct Case {
  std::string name;
  bool drawn;
  std::vector<double> places;
};

void PrintTo(const Case& c, std::ostream* os) { *os << c.name; }

const std::vector<double> kTunedPlaces = {0.1, 0.3, 0.5, 0.7, 0.9, 0.8},
                          kHeldOutPlaces = {0.15, 0.25, 0.35, 0.55, 0.75};

// The examples' liver, a point of which the loop keeps in the middle, from 20 and 10 mm beside it. The arm obeys at
// once, so that what is left is what the loop sees wrongly.
class CenteredLiver : public testing::TestWithParam<Case> {
 protected:
  CenteredLiver() {
    const double side_m = calibration_.carm.pixel_spacing_m * calibration_.carm.image_width_px;
    calibration_.carm.image_width_px = calibration_.carm.image_height_px = kSide_px;
    calibration_.carm.pixel_spacing_m = side_m / kSide_px;
  }

  Kept run(double share_of_tree, double breathing_mm, double duration_s, double from_s) {
    const Eigen::Vector3d target = tree_.points().col(static_cast<Eigen::Index>(share_of_tree * tree_.size()));
    ServoLoopSettings settings;
    settings.carm = calibration_.carm;
    settings.T_dsa_cb = calibration_.T_dsa_cb;
    settings.R_lps_model = calibration_.R_lps_model;
    settings.target_model = target;
    settings.task = CenterTaskSettings{};
    settings.latency_s = 0;
    ServoLoop loop(settings, tree_);
    SimulatedPatientSettings patient_settings;
    patient_settings.motion.breathing.amplitude_mm = breathing_mm;
    patient_settings.motion.breathing.diaphragm_mm = 0;
    SimulatedPatient patient(tree_, patient_settings, {calibration_.R_lps_model, {}});
    CArmState state;
    state.joints = settings.carm.jointsFor({degToRad(20), degToRad(10)}, calibration_.T_dsa_cb * target);
    state.joints[2] += 20e-3;
    state.joints[4] += 10e-3;
    Kept kept;
    double squares = 0;
    int counted = 0;
    for (std::int64_t k = 0; static_cast<double>(k) * kPeriod_s < duration_s; ++k) {
      const double time_s = static_cast<double>(k) * kPeriod_s;
      state.time_us = std::llround(1e6 * time_s);
      state.sequence = k;
      const Pose T = settings.carm.T_camera_patient(state.joints) * calibration_.T_dsa_cb;
      const Eigen::Vector3d there = T * patient.moved(target, time_s);
      XrayFrame frame{state.time_us, k, {}, settings.carm.camera()};
      const XrayScene scene = patient.scene(T, time_s);
      const auto seed = static_cast<std::uint64_t>(k);
      frame.image = GetParam().drawn
                        ? drawnFrame(tree_, (T * scene.pointsOf(tree_)).eval(), frame.camera, seed, kSide_px)
                        : patient.render(frame.camera, scene, seed);
      const ServoReport report = loop.step(frame, state);
      loop.learn();
      state.velocity = report.command.velocity;
      state.joints += kPeriod_s * state.velocity;
      if (time_s < from_s) continue;
      const Eigen::Vector2d off_mm = 1e3 * settings.carm.source_isocenter_distance_m / there.z() * there.head<2>();
      kept.mean_mm += off_mm;
      squares += off_mm.squaredNorm();
      kept.held += report.hold_reason.has_value();
      ++counted;
    }
    kept.mean_mm /= counted;
    kept.rms_mm = std::sqrt(squares / counted);
    return kept;
  }

  const VesselTree tree_ = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  CArmCalibration calibration_ = readCArmCalibration(exampleData("hepatic-tace/carm.yaml"));
};

// The look around the target must not override a fit that has converged: beside the target's vessels there are others
// that a shift of 2 px explains a little better.
TEST_P(CenteredLiver, StaysThereWithoutBias) {
  for (const double share : GetParam().places) {
    const Kept kept = run(share, 0, 4, 2.5);
    EXPECT_EQ(kept.held, 0);
    EXPECT_LE(kept.mean_mm.norm(), 0.1) << "at " << share << ": " << kept.mean_mm.transpose();
    EXPECT_LE(kept.rms_mm, 0.1) << "at " << share;
    std::printf("still, place %.2f: bias %.3f mm\n", share, kept.mean_mm.norm());
  }
}

TEST_P(CenteredLiver, IsFollowedWhileItBreathes) {
  for (const double share : GetParam().places) {
    const Kept kept = run(share, 15, 14, 9);
    EXPECT_EQ(kept.held, 0);
    // At 0.10, drawn, it depends on the processor: 0.34 mm with vectors of 512 and of 256 bits, 0.42 mm with 128.
    EXPECT_LE(kept.rms_mm, GetParam().drawn && share == 0.1 ? 0.5 : 0.3) << "at " << share;
    std::printf("breathing 15 mm, place %.2f: %.3f mm rms\n", share, kept.rms_mm);
  }
}

INSTANTIATE_TEST_SUITE_P(Frames, CenteredLiver,
                         testing::Values(Case{"drawn_tuned", true, kTunedPlaces},
                                         Case{"drawn_held_out", true, kHeldOutPlaces},
                                         Case{"rendered_tuned", false, kTunedPlaces},
                                         Case{"rendered_held_out", false, kHeldOutPlaces}),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace angio::test
