// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "angio/messaging/disturbed_bus.hpp"
#include "angio/simulation/lab_settings.hpp"
#include "angio/simulation/nodes.hpp"

namespace angio::lab {

/// A catheter in the patient's tree, and its drive.
struct LabCatheter {
  CatheterSettings settings;
  TreeLocation start;  ///< Of the tip.
};

/// Who stands in the lab, and how.
struct LabWorld {
  CArmGeometry carm;  ///< The real one.
  CArmLimits limits = CArmLimits::typical();
  Pose T_patient_model = Pose::Identity();  ///< How the patient really lies.
  CArmJoints start = CArmJoints::Zero();
  std::optional<XrayCamera> claimed_camera;  ///< What frames say of their camera; nothing: the true one.
  std::optional<LabCatheter> catheter;       ///< Nothing: no drive on the bus, no catheter in the images.
};

/// What the lab's omniscient observer keeps of one exposure.
struct Exposure {
  XrayFrame frame;
  CArmState state;                        ///< True joints.
  std::optional<CatheterTruth> catheter;  ///< Nothing in a lab without one.
};

/// A C-arm, its X-ray, a patient and, if the world has one, a catheter with its drive on one bus inside the process, in
/// simulated time. A loop joins by loopSide() and answers whenever advance() comes back; its commands are on their way
/// for as long as the latency says, and the machines move meanwhile. Each report of the C-arm's state has one of the
/// drive's beside it, of the same time. The same calls give the same messages, bit for bit.
class SimulatedLab {
 public:
  /// Throws InputError when a setting is out of its range or the catheter's start is none of the tree's places.
  SimulatedLab(const VesselTree& tree, const SimulatedPatientSettings& patient, const LabWorld& world,
               const LabSettings& settings);
  SimulatedLab(const SimulatedLab&) = delete;  // Its parties know its buses by address.
  SimulatedLab& operator=(const SimulatedLab&) = delete;

  /// The bus as a loop has it. Borrowed: ends with the lab.
  Bus& loopSide() { return from_loop_; }

  /// What happens to messages on their way to the loop, and from it. The latency is a delay of the loop's commands.
  DisturbedBus& fromMachines() { return from_machines_; }
  DisturbedBus& fromLoop() { return from_loop_; }

  /// Lets time run to the next event: a message arrives, the encoders report, or a frame is exposed. Comes back with
  /// the exposure, if it was one. Throws Interrupted when the user asked the program to end.
  std::optional<Exposure> advance();

  std::int64_t now_us() const { return now_us_; }
  double now_s() const { return 1e-6 * static_cast<double>(now_us_); }
  double period_s() const { return period_us_ * 1e-6; }

  /// Begin and end an injection of contrast agent now, as Bolus does.
  void beginInjection() { xray_.beginInjection(now_us_); }
  void endInjection() { xray_.endInjection(now_us_); }

  const SimulatedCArm& arm() const { return arm_.arm(); }

  /// The catheter at its last report. Throws std::bad_optional_access in a lab without one.
  const SimulatedCatheter& catheter() const { return catheter_.value().catheter(); }

  /// Where a point of the model really is in the camera now [m].
  Eigen::Vector3d inCamera(const Eigen::Vector3d& p_model) const {
    return xray_.inCamera(p_model, arm().state().joints, now_us_);
  }

  /// Changes each frame before it is sent: another patient's, a frozen one, a wrong clock.
  void tamperWithFrames(std::function<void(XrayFrame&)> tamper) { tamper_ = std::move(tamper); }

 private:
  void moveTo(std::int64_t time_us);
  void report();
  std::int64_t exposure_us(std::int64_t k) const;
  std::int64_t report_us(std::int64_t k) const;

  double period_us_, report_period_us_;
  bool images_;
  std::unique_ptr<Bus> bus_;
  DisturbedBus from_machines_, from_loop_;
  SimulatedCArmNode arm_;
  SimulatedXrayNode xray_;
  std::optional<SimulatedCatheterNode> catheter_;
  std::int64_t now_us_ = 0, exposures_ = 0, reports_ = 0;
  std::function<void(XrayFrame&)> tamper_;
};

}  // namespace angio::lab
