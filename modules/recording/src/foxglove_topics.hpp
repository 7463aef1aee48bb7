// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "angio/messaging/logged_frames.hpp"
#include "angio/recording/mcap_log.hpp"

namespace angio::recording {

/// A topic that Foxglove shows without being told how.
struct FoxgloveTopic {
  const char *name, *schema;
};

/// What Foxglove shows of the bus's messages, as JSON of its well-known schemas.
class FoxgloveTopics {
 public:
  /// Takes a message for a topic.
  using Emit = std::function<void(const FoxgloveTopic& topic, std::string json)>;

  /// Without a scene there are no tree and no transforms.
  explicit FoxgloveTopics(std::optional<RecordedScene> scene) : scene_(std::move(scene)) {}

  /// What is to be seen of one message. @param time_us  When it was heard, wall clock.
  void show(const std::string& channel, const AnyMessage& message, std::int64_t time_us, const Emit& emit);

 private:
  template <typename Message>
  void showOne(const Message&, std::int64_t, const Emit&) {}
  void showOne(const XrayFrame& frame, std::int64_t time_us, const Emit& emit);
  void showOne(const CArmState& state, std::int64_t time_us, const Emit& emit);
  void showOne(const RegistrationMessage& seen, std::int64_t time_us, const Emit& emit);
  void showOne(const CatheterTip& tip, std::int64_t time_us, const Emit& emit);
  void showStatus(const std::string& channel, const ServoStatus& status, std::int64_t time_us, const Emit& emit);
  void showTree(std::int64_t time_us, const Emit& emit);
  void showProjected(const RegistrationMessage& seen, std::int64_t time_us, const Emit& emit);

  // When a frame was heard, so that what is said of it later lies on it.
  std::int64_t timeOfFrame(const FrameName& frame, std::int64_t otherwise_us) const;

  std::optional<RecordedScene> scene_;
  bool tree_shown_ = false;
  std::deque<std::pair<FrameName, std::int64_t>> frame_times_;
  std::optional<XrayCamera> camera_;                                    // Of the last frame.
  std::deque<Eigen::Vector3d> tips_;                                    // The last places of the tip, model frame.
  std::map<std::string, std::pair<ServoState, std::string>> statuses_;  // The last of each loop.
};

}  // namespace angio::recording
