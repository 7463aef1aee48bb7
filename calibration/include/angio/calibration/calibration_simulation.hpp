// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/geometry/distortion.hpp"

namespace angio::calibration {

/// What a simulated detector does to its image.
enum class SimulatedDistortion { kNone, kRadial, kIntensifier };

/// Data that a tool must refuse, each by its name.
enum class HostileData { kNone, kDuplicatePoses, kSwappedBeads, kWrongUnits, kMirroredPhantom, kOtherMachine };

/// How a set of calibration data is simulated. Standard deviations are of normal draws.
struct CalibrationSimulationSettings {
  int seed = 1;
  int camera_views = 20;
  int geometry_views = 48;
  int hand_eye_poses = 15;
  int held_out_every = 7;  ///< Of camera and geometry views; 0: none. Not by 2 or 3, which place the angles.
  double bead_noise_px = 0.1;
  double missing_beads = 0.03;
  double encoder_noise_deg = 0.005;
  double encoder_noise_mm = 0.05;
  double pose_noise_deg = 0.1;
  double pose_noise_mm = 0.3;
  double offset_deg = 0.4;
  double offset_mm = 3;
  double table_scale = 0.004;
  double principal_point_px = 8;
  double flex_mm = 0.12;
  double flex_deg = 0.012;
  double patient_turn_deg = 4;
  double patient_shift_mm = 15;
  SimulatedDistortion distortion = SimulatedDistortion::kNone;
  HostileData hostile = HostileData::kNone;

  void visit(SettingsVisitor& v) {
    v.integer("seed", seed, 0, 2147483647, "Seed of all draws");
    v.integer("camera_views", camera_views, 1, 1000, "Views that the camera is calibrated by");
    v.integer("geometry_views", geometry_views, 1, 1000, "Views that the C-arm's geometry is calibrated by");
    v.integer("hand_eye_poses", hand_eye_poses, 1, 1000, "Registered poses of the anatomy");
    v.number("bead_noise_px", bead_noise_px, 0, 10, "Standard deviation of a bead's place in a table, each axis");
    v.number("missing_beads", missing_beads, 0, 0.8, "Share of the beads that is not in an image or table");
    v.number("encoder_noise_deg", encoder_noise_deg, 0, 5, "Standard deviation of the angles that a view's file says");
    v.number("encoder_noise_mm", encoder_noise_mm, 0, 20,
             "Standard deviation of the table positions that a view's file says");
    v.number("pose_noise_deg", pose_noise_deg, 0, 10,
             "Standard deviation of the rotation of the anatomy's registered poses, each axis");
    v.number("pose_noise_mm", pose_noise_mm, 0, 50,
             "Standard deviation of the translation of the anatomy's registered poses, each axis");
    v.number("offset_deg", offset_deg, 0, 5, "How far each angle of the machine is from ideal, a standard deviation");
    v.number("offset_mm", offset_mm, 0, 30, "How far each length of the machine is from ideal, a standard deviation");
    v.number("table_scale", table_scale, 0, 0.1,
             "How far each entry of the table's axes is from ideal, a standard deviation");
    v.number("principal_point_px", principal_point_px, 0, 100,
             "How far each coordinate of the principal point is from the image's centre, a standard deviation");
    v.number("flex_mm", flex_mm, 0, 5, "How far the machine bends, each of 6 terms whose waves no model has");
    v.number("flex_deg", flex_deg, 0, 0.5,
             "How far the machine bends in each angle, each of 6 terms whose waves no model has");
    v.number("patient_turn_deg", patient_turn_deg, 0, 45, "How far the patient lies from straight");
    v.number("patient_shift_mm", patient_shift_mm, 0, 200, "How far the patient lies from the middle");
    v.choice("distortion", distortion, {"none", "radial", "intensifier"}, "Distortion of the simulated detector");
    v.choice("hostile", hostile,
             {"none", "duplicate-poses", "swapped-beads", "wrong-units", "mirrored-phantom", "other-machine"},
             "What is wrong with the data on purpose");
    v.fixed("held_out_every", held_out_every, 0, 1000);
  }
};

/// Draws that are the same on every machine for one seed: the standard's distributions are not.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  double normal() {
    const double u = 1 - uniform(0, 1), v = uniform(0, 1);
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
  }
  Eigen::Vector3d vector(double std) {
    const double x = normal(), y = normal(), z = normal();  // Named: the compiler may take arguments in any order.
    return std * Eigen::Vector3d(x, y, z);
  }
  Twist twist(double translation_std_m, double rotation_std_rad) {
    Twist xi;
    xi.head<3>() = vector(translation_std_m);
    xi.tail<3>() = vector(rotation_std_rad);
    return xi;
  }
  int below(int count) { return static_cast<int>(uniform(0, count)); }

 private:
  std::mt19937_64 engine_;
};

/// A machine that was never ideal, and where a patient lies under it.
struct SimulatedDevice {
  CArmCalibration truth;
  std::optional<DetectorDistortion> distortion;  ///< Of its images.
  Pose T_patient_phantom = Pose::Identity();     ///< Where a phantom is put on its table.
};

/// Draws a machine around `nominal`, named "simulated-<seed>". The patient of `nominal` is turned and shifted about
/// `centre_model`.
SimulatedDevice simulatedMachine(const CArmCalibration& nominal, const Eigen::Vector3d& center_model,
                                 const CalibrationSimulationSettings& settings);

/// Another machine of another make with the same patient and phantom: what must not be mixed with the first.
SimulatedDevice otherMachine(const SimulatedDevice& machine, const CalibrationSimulationSettings& settings);

/// One view: what the machine did, what its encoders said, and where beads are in the image.
struct SimulatedBeadView {
  CArmJoints joints = CArmJoints::Zero();    ///< True: where it stands.
  CArmJoints said = CArmJoints::Zero();      ///< By the encoders.
  double source_detector_distance_m = 0;     ///< By the encoder.
  Pose T_camera_phantom = Pose::Identity();  ///< True.
  std::vector<int> shown;                    ///< Beads that are not missing and lie on the detector.
  Eigen::Matrix2Xd pixels_px;                ///< True pinhole pixels of those.
  bool held_out = false;
};

/// Views for the camera: the phantom near the isocentre, shifted over the detector, from many sides.
std::vector<SimulatedBeadView> simulatedCameraViews(const SimulatedDevice& machine, const BeadPhantom& phantom,
                                                    const CalibrationSimulationSettings& settings);

/// Views for the geometry: over the whole range of both angles, a third of them with the table moved.
std::vector<SimulatedBeadView> simulatedGeometryViews(const SimulatedDevice& machine, const BeadPhantom& phantom,
                                                      const CalibrationSimulationSettings& settings);

/// Which of the views are X-ray images; the others are tables of beads.
enum class SimulatedImages { kNone, kCamera, kAll };

/// Writes truth/carm.yaml, truth.json, phantom.yaml (a helix), camera/views.yaml, geometry/views.yaml and
/// hand-eye/poses.yaml with all that they name into a folder, which is made when it is missing. Images are rendered
/// with scatter, noise and beads that overlap. `tell` is called after each view with how many of how many are done.
/// Throws InputError when a setting is out of its range or a file cannot be written.
void writeCalibrationData(const std::string& folder, const CArmCalibration& nominal,
                          const Eigen::Vector3d& center_model, const CalibrationSimulationSettings& settings,
                          SimulatedImages images, const std::function<void(int done, int total)>& tell = {});

}  // namespace angio::calibration
