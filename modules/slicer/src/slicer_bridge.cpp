// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/slicer/slicer_bridge.hpp"

#include <algorithm>

#include "angio/messaging/any_message.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/types/channels.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio::slicer {
namespace {

using igtl::IgtlMessage;
using igtl::IgtlStatus;

// Encoders speak faster than anybody looks.
constexpr std::int64_t kShowJointsEvery_us = 60'000, kAskEvery_us = 200'000;
constexpr std::size_t kMaxFrameNames = 256;

// Of a transform that is a point: nobody has turned it.
constexpr double kNotTurned_rad = 1e-6;

// RegistrationStatus::kConverged, by its number.
constexpr std::int8_t kConverged = 0;

IgtlStatus codeOf(ServoState state) {
  switch (state) {
    case ServoState::kServo:
      return IgtlStatus::kOk;
    case ServoState::kFault:
      return IgtlStatus::kHardwareFailure;
    case ServoState::kEmergencyStop:
      return IgtlStatus::kEmergency;
    case ServoState::kIdle:
    case ServoState::kArmed:
      return IgtlStatus::kManual;
    case ServoState::kHold:
      break;
  }
  return IgtlStatus::kNotReady;
}

}  // namespace

SlicerBridge::SlicerBridge(Bus& bus, igtl::IgtlServer& server, SlicerScene scene, Problem problem)
    : bus_(bus),
      server_(server),
      scene_(std::move(scene)),
      problem_(std::move(problem)),
      T_patient_model_(scene_.T_dsa_cb) {
  listen(kXrayFrameChannel, &SlicerBridge::hearFrame);
  listen(kCArmStateChannel, &SlicerBridge::hearState);
  listen(kRegistrationChannel, &SlicerBridge::hearRegistration);
  listen(kCatheterTipChannel, &SlicerBridge::hearTip);
  listen(kServoStatusChannel, &SlicerBridge::hearServo);
  listen(kCatheterStatusChannel, &SlicerBridge::hearCatheter);
  server_.send(igtl::treeMessage("Tree", scene_.tree));
  if (scene_.displacements_m.size() > 0) {
    server_.send(igtl::treeMessage("DeformedTree", scene_.tree, scene_.displacements_m));
  }
  server_.send(igtl::transformMessage("TreeToPatient", T_patient_model_));
}

template <typename Message>
void SlicerBridge::listen(const char* channel, void (SlicerBridge::*hear)(const Message&)) {
  bus_.subscribe(channel, [this, channel, hear](const std::uint8_t* data, std::size_t size) {
    const auto decoded = decode<Message>(data, size);
    if (decoded.value) return (this->*hear)(*decoded.value);
    refuse(std::string(channel) + ": " + decoded.error);
  });
}

void SlicerBridge::refuse(const std::string& why) {
  ++refused_;
  problem_(why);
}

// Where the camera is by the joints, and the tree by the last registration.
Pose SlicerBridge::T_camera_model() const {
  return scene_.carm.T_camera_patient(state_ ? state_->joints : CArmJoints::Zero()) * T_patient_model_;
}

void SlicerBridge::hearFrame(const XrayFrame& frame) {
  frame_us_ = frame.time_us;
  joints_at_.emplace_back(FrameName(frame.sequence, frame.time_us), state_ ? state_->joints : CArmJoints::Zero());
  if (joints_at_.size() > kMaxFrameNames) joints_at_.pop_front();
  const Pose T_model_camera = T_camera_model().inverse();
  IgtlMessage image = igtl::imageMessage("XrayFrame", frame.image, frame.camera, T_model_camera);
  image.metadata["frame_sequence"] = std::to_string(frame.sequence);
  image.metadata["utime"] = std::to_string(frame.time_us);
  server_.send(image);
  server_.send(igtl::transformMessage("CameraToTree", T_model_camera));
  ++frames_;
}

void SlicerBridge::hearState(const CArmState& state) {
  state_ = state;
  if (shown_state_us_ && std::abs(state.time_us - *shown_state_us_) < kShowJointsEvery_us) return;
  shown_state_us_ = state.time_us;
  Pose T_patient_table = Pose::Identity();  // The table carries the patient: at zero their frames are one.
  T_patient_table.translation() = state.joints.tail<3>();
  server_.send(igtl::transformMessage("TableToPatient", T_patient_table));
  server_.send(igtl::transformMessage("CameraToTree", T_camera_model().inverse()));
}

// With the joints that went with its frame.
void SlicerBridge::hearRegistration(const RegistrationMessage& seen) {
  const bool other_tree = seen.model_id != ModelId::kUnknown && seen.model_id != modelId(scene_.tree);
  if (other_tree) return refuse("REGISTRATION is of another tree than --tree");
  if (seen.status != kConverged) return;
  const auto joints = std::find_if(joints_at_.begin(), joints_at_.end(),
                                   [&](const auto& named) { return named.first == frameOf(seen); });
  if (joints == joints_at_.end()) return;
  T_patient_model_ = scene_.carm.T_camera_patient(joints->second).inverse() * seen.T_camera_model;
  server_.send(igtl::transformMessage("TreeToPatient", T_patient_model_));
  server_.send(igtl::transformMessage("CameraToTree", T_camera_model().inverse()));
}

void SlicerBridge::hearTip(const CatheterTip& tip) {
  if (tip.status == CatheterTipStatus::kLost) return;
  Pose T_model_tip = Pose::Identity();
  T_model_tip.translation() = tip.tip_model;
  IgtlMessage message = igtl::transformMessage("TipToTree", T_model_tip);
  message.metadata["located"] = tip.status == CatheterTipStatus::kLocated ? "yes" : "no";
  message.metadata["branch"] = std::to_string(tip.branch);
  server_.send(message);
}

void SlicerBridge::hearServo(const ServoStatus& status) {
  if (request_ && status.view_reached_us == request_->time_us) request_.reset();
  showStatus("Servo", status);
}

void SlicerBridge::hearCatheter(const ServoStatus& status) { showStatus("Catheter", status); }

void SlicerBridge::showStatus(const std::string& device, const ServoStatus& status) {
  auto now = std::make_pair(status.state, status.reason);
  const auto [last, is_new] = statuses_.try_emplace(device, now);
  if (!is_new && std::exchange(last->second, now) == now) return;
  server_.send(igtl::statusMessage(device, codeOf(status.state), nameOf(status.state), describe(status)));
}

void SlicerBridge::receive(const igtl::Received& received) {
  if (const auto* transform = std::get_if<igtl::ReceivedTransform>(&received)) {
    if (transform->device != "Target") return refuse("TRANSFORM " + transform->device + ": must be named Target");
    std::optional<Eigen::Vector3d> beam;
    if (rotationAngle(transform->T.linear()) > kNotTurned_rad) beam = transform->T.linear().col(2);
    return ask({{}, Eigen::Vector3d(transform->T.translation())}, beam);
  }
  const auto& text = std::get<igtl::ReceivedString>(received);
  if (text.device != "Target") return refuse("STRING " + text.device + ": must be named Target");
  const auto target = readViewTarget(text.text);
  if (const auto* wrong = std::get_if<std::string>(&target)) return refuse("STRING Target: " + *wrong);
  ask(std::get<ViewTarget>(target), {});
}

void SlicerBridge::ask(const ViewTarget& target, const std::optional<Eigen::Vector3d>& beam) {
  if (!frame_us_) return refuse("Target: nothing is asked for before the first frame");
  const Pose T_model_camera = T_camera_model().inverse();
  ViewRequest request;
  // Its time names it: two between the same frames are two.
  last_request_us_ = request.time_us = std::max(*frame_us_, last_request_us_ + 1);
  request.sequence = ++request_sequence_;
  request.model_id = modelId(scene_.tree);
  request.beam_model = beam            ? *beam
                       : target.angles ? Eigen::Vector3d(scene_.R_lps_model.transpose() * beamDirection(*target.angles))
                                       : Eigen::Vector3d(T_model_camera.linear().col(2));
  request.target_model = target.target_lps_m.value_or(scene_.tree.centroid());
  request.within_rad = degToRad(scene_.within_deg);
  request.within_m = 1e-3 * scene_.within_mm;
  request.reason = "asked for by OpenIGTLink";
  request_ = request;
  asked_us_ = 0;
  ++requests_;
}

void SlicerBridge::serve(std::int64_t now_us, std::chrono::milliseconds timeout) {
  server_.handle(
      timeout, [this](const igtl::Received& received) { receive(received); }, problem_);
  if (!request_ || (asked_us_ != 0 && now_us - asked_us_ < kAskEvery_us)) return;
  asked_us_ = now_us;
  publish(bus_, kViewRequestChannel, *request_);
}

}  // namespace angio::slicer
