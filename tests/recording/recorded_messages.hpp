// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "angio/messaging/codec.hpp"
#include "angio/messaging/log_writer.hpp"
#include "angio/recording/mcap_log.hpp"
#include "angio/test/namespace.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {

/// Two branches of a tree, 100 mm long.
inline RecordedScene recordedScene() {
  Eigen::Matrix3Xd points(3, 5);
  points << 0, 0, 0, 0.02, -0.02, 0, 0.01, 0, 0, 0, -0.05, -0.02, 0, 0.04, 0.05;
  Pose T_dsa_cb = Pose::Identity();
  T_dsa_cb.translation() << 0.01, -0.02, 0.03;
  CArmGeometry carm;
  carm.image_width_px = carm.image_height_px = 128;
  carm.pixel_spacing_m = 2e-3;
  return {VesselTree(points, {-1, 0, 1, 2, 2}), carm, T_dsa_cb};
}

constexpr int kRecordedFrames = 12;

/// A run in small: of each frame the joints, the image, its registration, the tip and a status; and what is none of our
/// messages.
inline std::vector<std::pair<std::string, std::vector<std::uint8_t>>> recordedMessages() {
  std::vector<std::pair<std::string, std::vector<std::uint8_t>>> messages;
  const RecordedScene scene = recordedScene();
  for (int i = 1; i <= kRecordedFrames; ++i) {
    const std::int64_t time_us = 66'000 * i;
    CArmState state{time_us, i, CArmJoints::Zero(), CArmJoints::Zero()};
    state.joints << 0.1 * i, -0.05, 1e-3 * i, 2e-3, 0;
    const XrayCamera camera = scene.carm.camera();
    cv::Mat image(128, 128, i % 2 ? CV_16UC1 : CV_8UC1);
    cv::randu(image, 0, i % 2 ? 65535 : 255);
    RegistrationMessage seen;
    seen.time_us = time_us;
    seen.frame_sequence = i;
    seen.status_text = i % 3 ? "converged" : "ambiguous";
    seen.T_camera_model = scene.carm.T_camera_patient(state.joints) * scene.T_dsa_cb;
    CatheterTip tip;
    tip.time_us = time_us;
    tip.frame_sequence = i;
    tip.status = CatheterTipStatus::kLocated;
    tip.tip_model << 0, 0, 1e-3 * i;
    ServoStatus status;
    status.time_us = time_us;
    status.frame_sequence = i;
    status.state = i > 6 ? ServoState::kServo : ServoState::kHold;
    status.reason = i > 6 ? "" : "a \"reason\" with \xff in it";
    messages.emplace_back(kCArmStateChannel, encode(state));
    messages.emplace_back(kXrayFrameChannel, encode(XrayFrame{time_us, i, image, camera}));
    messages.emplace_back(kRegistrationChannel, encode(seen));
    messages.emplace_back(kCatheterTipChannel, encode(tip));
    messages.emplace_back(kServoStatusChannel, encode(status));
    messages.emplace_back("SOMEBODY_ELSES", std::vector<std::uint8_t>{1, 2, static_cast<std::uint8_t>(i)});
  }
  return messages;
}

/// The same as a log of LCM's, its messages 15 ms apart.
inline void writeRecordedLog(const std::string& path) {
  LogWriter log(path);
  LogEvent event;
  event.time_us = 1'700'000'000'000'000;
  for (const auto& [channel, bytes] : recordedMessages()) {
    event.channel = channel;
    event.bytes = bytes;
    log.write(event);
    ++event.number;
    event.time_us += 15'000;
  }
}

}  // namespace angio::test
