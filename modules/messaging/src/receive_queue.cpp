// SPDX-License-Identifier: GPL-2.0-or-later
#include "receive_queue.hpp"

#include <algorithm>
#include <utility>

namespace angio::messaging {

void ReceiveQueue::push(LcmMessage message, bool named) {
  Waiting added{named ? message.channel : "", std::move(message)};
  if (counts_[added.group] >= (named ? kMaxWaiting : kMaxWaitingUnnamed)) {
    erase(std::find_if(waiting_.begin(), waiting_.end(), [&](const Waiting& w) { return w.group == added.group; }));
  }
  const std::size_t size = added.message.bytes.size();
  while (!waiting_.empty() && bytes_ + size > kMaxWaiting_bytes) erase(waiting_.begin());
  ++counts_[added.group];
  bytes_ += size;
  waiting_.push_back(std::move(added));
}

std::optional<LcmMessage> ReceiveQueue::pop() {
  if (waiting_.empty()) return std::nullopt;
  const std::size_t size = waiting_.front().message.bytes.size();
  LcmMessage message = std::move(waiting_.front().message);
  bytes_ -= size;
  --counts_[waiting_.front().group];
  waiting_.pop_front();
  return message;
}

void ReceiveQueue::erase(std::deque<Waiting>::iterator oldest) {
  bytes_ -= oldest->message.bytes.size();
  --counts_[oldest->group];
  waiting_.erase(oldest);
}

}  // namespace angio::messaging
