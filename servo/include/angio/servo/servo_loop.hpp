// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "angio/imaging/extractor.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/registration/starts.hpp"
#include "angio/servo/desired_view.hpp"
#include "angio/servo/patient_tracker.hpp"
#include "angio/servo/servo_law.hpp"
#include "angio/servo/supervisor.hpp"

namespace angio {

/// Everything one loop needs to know. The parts are chosen by the type of their settings.
struct ServoLoopSettings {
  CArmGeometry carm;
  CArmLimits limits = CArmLimits::typical();
  Pose T_dsa_cb = Pose::Identity();  ///< Calibrated: model frame in the patient frame.
  DesiredView view;

  ExtractorSettings extractor = RidgeSettings{};
  RegistrationSettings search = OrientedKernelSettings{};  ///< While nothing is tracked ...
  StartSettings search_starts;
  RegistrationSettings tracking = OrientedKernelSettings{};  ///< ... and from frame to frame.
  PatientTrackerSettings tracker;
  ServoLawSettings law = PositionBasedSettings{};
  SupervisorSettings supervisor;

  /// With the paper's method in place of the default: iterative_pnp with the prior that calibration gives, from a dozen
  /// starts; and from a start that is a few pixels off small scales only, and an end to its iterations that fits the
  /// frame rate.
  void useIterativePnp();
  static IterativePnpSettings iterativePnpForSearch();
  static IterativePnpSettings iterativePnpForTracking();
};

/// What the loop made of one frame.
struct ServoReport {
  CArmCommand command;              ///< Stands still unless the frame was trusted.
  std::optional<std::string> held;  ///< Why it holds; nothing while it servoes.
  Centerline2d centerline;
  RegistrationResult registration;
  std::optional<ViewError> view_error;                    ///< As the loop sees it; nothing while it holds.
  double image_s = 0, registration_s = 0, control_s = 0;  ///< Wall time of the stages [s].
};

/// One X-ray frame becomes one robot command. Knows neither clock nor bus: the same frames and joints give the same
/// commands, bit for bit.
class ServoLoop {
 public:
  /// Throws InputError when a setting is out of its range, not finite, or no rotation.
  ServoLoop(const ServoLoopSettings& settings, const VesselTree& tree);

  /// Answers one frame that was exposed while the joints were as in `state`.
  ServoReport step(const XrayFrame& frame, const CArmState& state);

  const Pose& desired_T_camera_model() const { return desired_; }

 private:
  ServoReport answer(const XrayFrame& frame, const CArmState& state, double period_s);

  ServoLoopSettings settings_;
  std::unique_ptr<CenterlineExtractor> extractor_;
  std::unique_ptr<Registration> search_, tracking_;
  PatientTracker tracker_;
  std::unique_ptr<ServoLaw> law_;
  Supervisor supervisor_;
  Pose desired_;
  CArmCommand last_command_;
  std::optional<std::int64_t> last_frame_us_;
};

/// The same law without eyes: the camera is where joints and calibration say. What the loop is compared with.
class OpenLoop {
 public:
  /// Throws InputError as ServoLoop does.
  explicit OpenLoop(const ServoLoopSettings& settings);

  CArmCommand step(const CArmState& state, double period_s);

 private:
  ServoLoopSettings settings_;
  std::unique_ptr<ServoLaw> law_;
  Supervisor supervisor_;
  CArmCommand last_command_;
};

}  // namespace angio
