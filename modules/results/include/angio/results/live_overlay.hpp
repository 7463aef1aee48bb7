// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/results/namespace.hpp"
#include "angio/results/text_band.hpp"
#include "angio/types/any_message.hpp"
#include "angio/types/carm_motion.hpp"
#include "angio/types/catheter.hpp"
#include "angio/types/registration_message.hpp"
#include "angio/types/servo_status.hpp"
#include "angio/types/xray_frame.hpp"
#include "angio/vessel/model_id.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::results {

/// One frame and what the bus says of it.
struct LiveScene {
  XrayFrame frame;
  std::optional<RegistrationMessage> registration;  ///< Of this frame.
  std::optional<ServoStatus> status;                ///< Of this frame.
  std::optional<CatheterTip> tip;                   ///< Of this frame.
  std::optional<CArmState> state;                   ///< The newest joints.
  std::optional<Eigen::Vector3d> target_model;      ///< A point of the model to mark [m].
  std::string title;                                ///< First line below the X-ray; may be empty.
  Eigen::Matrix2Xd device_px = {};                  ///< What is seen of a catheter [px], in order; may be empty.
};

/// Pictures of a running loop, for a window or a film: the X-ray with the tree where it was registered, target and
/// catheter tip, and below it the title, the loop's state, its errors, the residual, the joints, what the marks are,
/// and a bar of the last states. Texts wrap; where they still need more room than a picture has, their letters shrink.
class LiveOverlay {
 public:
  /// @param width_px      Of the pictures, >= 320; the X-ray is scaled to it. Borrows the tree.
  /// @param carm          What joints are read with, for the letters at the X-ray's edges.
  /// @param R_patient_lps Anatomical axes L, P, S in the patient frame; identity when the patient lies straight.
  explicit LiveOverlay(const VesselTree& tree, int width_px = 768, const CArmGeometry& carm = {},
                       const Eigen::Matrix3d& R_patient_lps = Eigen::Matrix3d::Identity());

  /// CV_8UC3; pictures of frames of one size have one size. The tree is green while the loop servoes by it or nobody
  /// says whether one does, amber while the loop holds, and is not drawn when the registration did not converge or is
  /// that of another tree. drawPatientLetters() where joints have been heard.
  cv::Mat draw(const LiveScene& scene);

 private:
  void drawXray(cv::Mat& canvas, const LiveScene& scene) const;
  void drawPanel(cv::Mat panel, const LiveScene& scene) const;
  std::vector<BandEntry> panelEntries(const LiveScene& scene) const;
  bool showsTree(const LiveScene& scene) const;
  bool showsTip(const LiveScene& scene) const;

  const VesselTree& tree_;
  ModelId model_id_;
  int width_px_;
  CArmGeometry carm_;
  Eigen::Matrix3d R_patient_lps_;
  std::deque<cv::Scalar> bar_;  // Colours of the last frames' states, oldest first.
};

/// The colour in which a state of the loop is shown, BGR: green where it moves, amber where it stands and waits, red
/// where it stands until somebody acts.
cv::Scalar stateColor(ServoState state);

/// Puts together what belongs to one frame from what comes on a bus. Knows no clock: arrivals are told by the caller.
class LiveFeed {
 public:
  /// Takes a message that came on a channel. When a frame is complete, its scene comes back: with the loop's status,
  /// while a loop reports, the C-arm's before the catheter's; else with its registration, while somebody registers;
  /// else as it is. Frames that nobody answered in time are left out while others are answered.
  std::optional<LiveScene> hear(const std::string& channel, AnyMessage message, std::int64_t arrival_us);

 private:
  LiveScene* sceneOf(std::int64_t frame_sequence, std::int64_t time_us);
  std::optional<LiveScene> take(LiveScene* scene);

  std::deque<LiveScene> waiting_;  // The newest frames, oldest first.
  std::optional<CArmState> state_;
  std::optional<std::int64_t> last_carm_status_us_, last_status_us_, last_registration_us_;
};

}  // namespace angio::results
