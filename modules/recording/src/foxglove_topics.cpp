// SPDX-License-Identifier: GPL-2.0-or-later
#include "foxglove_topics.hpp"

#include <opencv2/imgproc.hpp>
#include <utility>

#include "angio/messaging/any_message.hpp"
#include "angio/types/channels.hpp"
#include "foxglove_json.hpp"

namespace angio::recording {
namespace {

constexpr FoxgloveTopic kImage{"/camera/image", "foxglove.CompressedImage"},
    kCalibration{"/camera/calibration", "foxglove.CameraCalibration"},
    kAnnotations{"/camera/annotations", "foxglove.ImageAnnotations"}, kTransforms{"/tf", "foxglove.FrameTransforms"},
    kTree{"/tree", "foxglove.SceneUpdate"}, kProjected{"/tree/projected", "foxglove.SceneUpdate"},
    kRegistered{"/registration/pose", "foxglove.PosesInFrame"}, kTip{"/catheter/tip", "foxglove.PosesInFrame"},
    kLog{"/log", "foxglove.Log"};

constexpr std::size_t kMaxFrameTimes = 256, kMaxTips = 100;

// A branch is drawn within this of where it is.
constexpr double kMaxDrawingError_px = 0.75;

// Foxglove's LogLevel.
enum Level { kInfo = 2, kWarning = 3, kError = 4 };

Level levelOf(ServoState state) {
  switch (state) {
    case ServoState::kHold:
      return kWarning;
    case ServoState::kFault:
    case ServoState::kEmergencyStop:
      return kError;
    default:
      return kInfo;
  }
}

Json blue() { return colorJson(0.2, 0.5, 1); }
Json colorOf(const RegistrationMessage& seen) {
  return seen.status_text == "converged" ? colorJson(0.1, 0.9, 0.2) : colorJson(1, 0.7, 0);
}

void appendDrawing(std::vector<std::vector<Eigen::Vector2d>>& drawn, const std::vector<cv::Point2f>& line) {
  if (line.size() < 2) return;
  std::vector<cv::Point2f> few;
  cv::approxPolyDP(line, few, kMaxDrawingError_px, false);
  auto& points = drawn.emplace_back();
  for (const cv::Point2f& p : few) points.emplace_back(p.x, p.y);
}

// The tree's branches on the detector, with few points; what lies off it is left out.
std::vector<std::vector<Eigen::Vector2d>> projected(const VesselTree& tree, const Pose& T_camera_model,
                                                    const XrayCamera& camera) {
  std::vector<std::vector<Eigen::Vector2d>> drawn;
  for (const auto& branch : tree.branches()) {
    std::vector<cv::Point2f> line;
    for (const int i : branch) {
      const auto pixel = camera.project(T_camera_model * Eigen::Vector3d(tree.points().col(i)));
      if (pixel && camera.sees(*pixel)) {
        line.emplace_back(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()));
      } else {
        appendDrawing(drawn, line);
        line.clear();
      }
    }
    appendDrawing(drawn, line);
  }
  return drawn;
}

}  // namespace

void FoxgloveTopics::show(const std::string& channel, const AnyMessage& message, std::int64_t time_us,
                          const Emit& emit) {
  if (scene_ && !std::exchange(tree_shown_, true)) showTree(time_us, emit);
  if (const auto* status = std::get_if<ServoStatus>(&message)) return showStatus(channel, *status, time_us, emit);
  std::visit([&](const auto& m) { showOne(m, time_us, emit); }, message);
}

std::int64_t FoxgloveTopics::timeOfFrame(const FrameName& frame, std::int64_t otherwise_us) const {
  for (auto known = frame_times_.rbegin(); known != frame_times_.rend(); ++known) {
    if (known->first == frame) return known->second;
  }
  return otherwise_us;
}

void FoxgloveTopics::showOne(const XrayFrame& frame, std::int64_t time_us, const Emit& emit) {
  frame_times_.emplace_back(FrameName(frame.sequence, frame.time_us), time_us);
  if (frame_times_.size() > kMaxFrameTimes) frame_times_.pop_front();
  camera_ = frame.camera;
  emit(kImage, Json{{"timestamp", timeJson(time_us)},
                    {"frame_id", "camera"},
                    {"data", jpegBase64(frame.image)},
                    {"format", "jpeg"}}
                   .dump());
  const auto& p = frame.camera.parameters();
  emit(kCalibration, Json{{"timestamp", timeJson(time_us)},
                          {"frame_id", "camera"},
                          {"width", p.width_px},
                          {"height", p.height_px},
                          {"distortion_model", ""},
                          {"D", Json::array()},
                          {"K", {p.fx_px, 0, p.cx_px, 0, p.fy_px, p.cy_px, 0, 0, 1}},
                          {"R", {1, 0, 0, 0, 1, 0, 0, 0, 1}},
                          {"P", {p.fx_px, 0, p.cx_px, 0, 0, p.fy_px, p.cy_px, 0, 0, 0, 1, 0}}}
                         .dump());
}

void FoxgloveTopics::showOne(const CArmState& state, std::int64_t time_us, const Emit& emit) {
  if (!scene_) return;
  // The table moves the patient: to the patient the isocentre moves the other way.
  Pose T_patient_iso = Pose::Identity();
  T_patient_iso.translation() = -state.joints.tail<3>();
  Json transforms = Json::array();
  transforms.push_back(transformJson(time_us, "patient", "iso", T_patient_iso));
  transforms.push_back(
      transformJson(time_us, "patient", "camera", scene_->carm.T_camera_patient(state.joints).inverse()));
  emit(kTransforms, Json{{"transforms", transforms}}.dump());
}

void FoxgloveTopics::showTree(std::int64_t time_us, const Emit& emit) {
  std::vector<Line> lines;
  for (const auto& branch : scene_->tree.branches()) {
    Line& line = lines.emplace_back();
    for (const int i : branch) line.emplace_back(scene_->tree.points().col(i));
  }
  emit(kTransforms,
       Json{{"transforms", Json::array({transformJson(time_us, "patient", "calibrated", scene_->T_dsa_cb)})}}.dump());
  const Json entities =
      Json::array({lineEntityJson(time_us, "calibrated", "by calibration", lines, 5, blue()),
                   lineEntityJson(time_us, "model", "registered", lines, 5, colorJson(0.1, 0.9, 0.2))});
  emit(kTree, Json{{"deletions", Json::array()}, {"entities", entities}}.dump());
}

void FoxgloveTopics::showOne(const RegistrationMessage& seen, std::int64_t time_us, const Emit& emit) {
  const std::int64_t frame_us = timeOfFrame(frameOf(seen), time_us);
  emit(kTransforms,
       Json{{"transforms", Json::array({transformJson(frame_us, "camera", "model", seen.T_camera_model)})}}.dump());
  emit(kRegistered, Json{{"timestamp", timeJson(frame_us)},
                         {"frame_id", "camera"},
                         {"poses", Json::array({poseJson(seen.T_camera_model)})}}
                        .dump());
  if (scene_ && camera_) showProjected(seen, frame_us, emit);
}

void FoxgloveTopics::showProjected(const RegistrationMessage& seen, std::int64_t time_us, const Emit& emit) {
  const auto& p = camera_->parameters();
  const double depth_m = p.source_detector_distance_m.value_or(scene_->carm.source_detector_distance_m);
  const Json color = colorOf(seen);
  // Pairs that are joined, in one list: an annotation for each branch would be twice as long.
  Json pixels = Json::array();
  std::vector<Line> lines;
  for (const auto& line : projected(scene_->tree, seen.T_camera_model, *camera_)) {
    Line& points = lines.emplace_back();
    for (std::size_t i = 0; i < line.size(); ++i) {
      points.emplace_back(depth_m * camera_->ray(line[i]));
      if (i == 0) continue;
      pixels.push_back(pointJson(line[i - 1]));
      pixels.push_back(pointJson(line[i]));
    }
  }
  const Json annotation{{"timestamp", timeJson(time_us)},
                        {"type", 4},  // LINE_LIST
                        {"points", std::move(pixels)},
                        {"outline_color", color},
                        {"outline_colors", Json::array()},
                        {"fill_color", {{"r", 0}, {"g", 0}, {"b", 0}, {"a", 0}}},
                        {"thickness", 1.5}};
  emit(kAnnotations,
       Json{{"circles", Json::array()}, {"points", Json::array({annotation})}, {"texts", Json::array()}}.dump());
  const Json entity = lineEntityJson(time_us, "camera", "on the detector", lines, 4, color);
  emit(kProjected, Json{{"deletions", Json::array()}, {"entities", Json::array({entity})}}.dump());
}

void FoxgloveTopics::showOne(const CatheterTip& tip, std::int64_t time_us, const Emit& emit) {
  if (tip.status == CatheterTipStatus::kLost) return;
  tips_.push_front(tip.tip_model);
  if (tips_.size() > kMaxTips) tips_.pop_back();
  Json poses = Json::array();
  for (const Eigen::Vector3d& place : tips_) {
    Pose pose = Pose::Identity();
    pose.translation() = place;
    poses.push_back(poseJson(pose));
  }
  const std::int64_t frame_us = timeOfFrame(frameOf(tip), time_us);
  emit(kTip, Json{{"timestamp", timeJson(frame_us)}, {"frame_id", "model"}, {"poses", poses}}.dump());
}

// What is said again with each frame is said once here.
void FoxgloveTopics::showStatus(const std::string& channel, const ServoStatus& status, std::int64_t time_us,
                                const Emit& emit) {
  auto now = std::make_pair(status.state, status.reason);
  const auto [last, is_new] = statuses_.try_emplace(channel, now);
  if (!is_new && std::exchange(last->second, now) == now) return;
  emit(kLog, Json{{"timestamp", timeJson(time_us)},
                  {"level", static_cast<int>(levelOf(status.state))},
                  {"message", describe(status)},
                  {"name", channel},
                  {"file", ""},
                  {"line", 0}}
                 .dump());
}

}  // namespace angio::recording
