// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/frame_mailbox.hpp"

#include <algorithm>

#include "angio/types/channels.hpp"

namespace angio::servo {
namespace {

// Of what waits: half a second of frames, and what may be said of them ahead of time.
constexpr std::size_t kMaxFrames = 8, kMaxMessages = 32;

template <typename T>
void keep(std::deque<T>& kept, std::vector<T> heard) {
  for (T& message : heard) kept.push_back(std::move(message));
  while (kept.size() > kMaxMessages) kept.pop_front();
}

template <typename T>
std::optional<T> of(const XrayFrame& frame, const std::deque<T>& kept) {
  const auto found = std::find_if(kept.begin(), kept.end(), [&](const T& message) {
    return message.frame_sequence == frame.sequence && message.time_us == frame.time_us;
  });
  return found == kept.end() ? std::nullopt : std::optional(*found);
}

}  // namespace

FrameMailbox::FrameMailbox(Bus& bus, const ExternalInputs& wanted) : wanted_(wanted), frames_(bus, kXrayFrameChannel) {
  if (wanted.registration) {
    registrations_ = std::make_unique<MessageQueue<RegistrationMessage>>(bus, kRegistrationChannel);
  }
  if (wanted.tip) tips_ = std::make_unique<MessageQueue<CatheterTip>>(bus, kCatheterTipChannel);
}

std::vector<std::string> FrameMailbox::awaited() const {
  std::vector<std::string> channels;
  if (waiting_.empty()) return channels;
  if (wanted_.registration && !of(waiting_.back().frame, heard_registrations_))
    channels.push_back(kRegistrationChannel);
  if (wanted_.tip && !of(waiting_.back().frame, heard_tips_)) channels.push_back(kCatheterTipChannel);
  return channels;
}

std::optional<FrameWithEstimates> FrameMailbox::take() {
  if (auto frame = frames_.take()) waiting_.push_back({std::move(*frame), frames_.record().sender});
  if (waiting_.size() > kMaxFrames) waiting_.pop_front();
  if (registrations_) keep(heard_registrations_, registrations_->take());
  if (tips_) keep(heard_tips_, tips_->take());
  for (auto waiting = waiting_.rbegin(); waiting != waiting_.rend(); ++waiting) {
    ExternalEstimates external{of(waiting->frame, heard_registrations_), of(waiting->frame, heard_tips_)};
    if ((wanted_.registration && !external.registration) || (wanted_.tip && !external.tip)) continue;
    FrameWithEstimates result{std::move(waiting->frame), std::move(external), std::move(waiting->sender)};
    waiting_.erase(waiting_.begin(), waiting.base());
    return result;
  }
  return std::nullopt;
}

}  // namespace angio::servo
