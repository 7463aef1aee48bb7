// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "angio/geometry/carm.hpp"
#include "angio/igtl/igtl_server.hpp"
#include "angio/messaging/bus.hpp"
#include "angio/messaging/logged_frames.hpp"
#include "angio/slicer/namespace.hpp"
#include "angio/slicer/view_target.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::slicer {

/// What a bridge goes by.
struct SlicerScene {
  VesselTree tree;
  Eigen::Matrix3Xd displacements_m;  ///< Of the deformed tree; empty: there is none.
  CArmGeometry carm;
  Pose T_dsa_cb = Pose::Identity();
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();
  double within_deg = 0.5, within_mm = 2;  ///< When a view that was asked for is reached.
};

/// Shows a run of the bus to OpenIGTLink's clients, in the frame of the tree as L, P, S (for them R, A, S), which is
/// that of the volume that the tree was taken from:
///
/// - IMAGE `XrayFrame`: each frame on its detector, where the joints and the last registration that converged, or
///   without one the calibration, put it;
/// - TRANSFORM `CameraToTree`, `TreeToPatient`, `TableToPatient`, `TipToTree`;
/// - POLYDATA `Tree`, `DeformedTree`; STATUS `Servo`, `Catheter`, whenever they change.
///
/// And publishes a view that a client asks for as VIEW_REQUEST, again and again until a loop has reached it, as a
/// catheter's controller does: whether it is obeyed is the loop's own matter. A client asks by TRANSFORM `Target`,
/// whose origin is the point for the isocentre and whose z axis is the beam from source to detector (without a
/// rotation: as now), or by STRING `Target`, as readViewTarget() reads it. Nothing is asked for before the first frame.
class SlicerBridge {
 public:
  using Problem = igtl::IgtlServer::Problem;

  /// Borrows bus and server; `problem` hears what is refused, a line each.
  SlicerBridge(Bus& bus, igtl::IgtlServer& server, SlicerScene scene, Problem problem);
  SlicerBridge(const SlicerBridge&) = delete;
  SlicerBridge& operator=(const SlicerBridge&) = delete;

  /// Serves the clients, after the bus has been handled. @param now_us  Monotonic clock.
  void serve(std::int64_t now_us, std::chrono::milliseconds timeout);

  std::int64_t frames() const { return frames_; }      ///< Shown so far.
  std::int64_t requests() const { return requests_; }  ///< Views asked for so far.
  std::int64_t refused() const { return refused_; }    ///< Messages of the bus that were none, and targets.

 private:
  template <typename Message>
  void listen(const char* channel, void (SlicerBridge::*hear)(const Message&));
  void hearFrame(const XrayFrame& frame);
  void hearState(const CArmState& state);
  void hearRegistration(const RegistrationMessage& seen);
  void hearTip(const CatheterTip& tip);
  void hearServo(const ServoStatus& status);
  void hearCatheter(const ServoStatus& status);
  void showStatus(const std::string& device, const ServoStatus& status);
  void receive(const igtl::Received& received);
  void ask(const ViewTarget& target, const std::optional<Eigen::Vector3d>& beam);
  void refuse(const std::string& why);
  Pose T_camera_model() const;

  Bus& bus_;
  igtl::IgtlServer& server_;
  SlicerScene scene_;
  Problem problem_;
  std::optional<CArmState> state_;
  std::optional<std::int64_t> shown_state_us_;
  Pose T_patient_model_;
  std::optional<std::int64_t> frame_us_;                    // Of the last one.
  std::deque<std::pair<FrameName, CArmJoints>> joints_at_;  // Of the last frames.
  std::map<std::string, std::pair<ServoState, std::string>> statuses_;
  std::optional<ViewRequest> request_;  // Until it is reached.
  std::int64_t last_request_us_ = 0, request_sequence_ = 0, asked_us_ = 0;
  std::int64_t frames_ = 0, requests_ = 0, refused_ = 0;
};

}  // namespace angio::slicer
