// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/live_feed.hpp"

#include <algorithm>

#include "angio/types/channels.hpp"

namespace angio::evaluation {
namespace {

constexpr std::size_t kMaxWaiting = 8;           // Half a second of frames: an answer later than that is of no use.
constexpr std::int64_t kSilence_us = 1'000'000;  // After it nobody is waited for.

bool silent(const std::optional<std::int64_t>& last_us, std::int64_t now_us) {
  return !last_us || now_us - *last_us > kSilence_us || now_us < *last_us;
}

}  // namespace

LiveScene* LiveFeed::sceneOf(std::int64_t frame_sequence, std::int64_t time_us) {
  const auto found = std::find_if(waiting_.begin(), waiting_.end(), [&](const LiveScene& s) {
    return s.frame.sequence == frame_sequence && s.frame.time_us == time_us;
  });
  return found == waiting_.end() ? nullptr : &*found;
}

std::optional<LiveScene> LiveFeed::take(LiveScene* scene) {
  if (!scene) return std::nullopt;
  LiveScene taken = std::move(*scene);
  taken.state = state_;
  // What is older will not be answered any more.
  while (&waiting_.front() != scene) waiting_.pop_front();
  waiting_.pop_front();
  return taken;
}

std::optional<LiveScene> LiveFeed::hear(const std::string& channel, AnyMessage message, std::int64_t arrival_us) {
  if (auto* frame = std::get_if<XrayFrame>(&message)) {
    LiveScene scene{std::move(*frame), {}, {}, {}, {}, {}, {}};
    waiting_.push_back(std::move(scene));
    if (waiting_.size() > kMaxWaiting) waiting_.pop_front();
    const bool alone = silent(last_status_us_, arrival_us) && silent(last_registration_us_, arrival_us);
    return alone ? take(&waiting_.back()) : std::nullopt;
  }
  if (const auto* state = std::get_if<CArmState>(&message)) {
    state_ = *state;
  } else if (const auto* tip = std::get_if<CatheterTip>(&message)) {
    if (LiveScene* scene = sceneOf(tip->frame_sequence, tip->time_us)) scene->tip = *tip;
  } else if (const auto* registration = std::get_if<RegistrationMessage>(&message)) {
    last_registration_us_ = arrival_us;
    LiveScene* scene = sceneOf(registration->frame_sequence, registration->time_us);
    if (scene) scene->registration = *registration;
    if (silent(last_status_us_, arrival_us)) return take(scene);
  } else if (const auto* status = std::get_if<ServoStatus>(&message)) {
    const bool catheters = channel == kCatheterStatusChannel;
    if (catheters && !silent(last_carm_status_us_, arrival_us)) return std::nullopt;
    if (!catheters) last_carm_status_us_ = arrival_us;
    last_status_us_ = arrival_us;
    LiveScene* scene = sceneOf(status->frame_sequence, status->time_us);
    if (scene) scene->status = *status;
    return take(scene);
  }
  return std::nullopt;
}

}  // namespace angio::evaluation
