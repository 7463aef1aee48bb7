// SPDX-License-Identifier: GPL-2.0-or-later
#include "contrast_arrival.hpp"

#include <algorithm>

namespace angio::imaging {
namespace {

// Times the least amount, and more by this part of the side: what quiet frames show at most, and what shows that
// contrast agent has arrived. Noise alone changes what is found from frame to frame by some per cent.
constexpr double kQuiet = 1.08, kQuietMore = 0.006, kArrived = 1.5, kArrivedMore = 0.06;
// A frame with less than this part of the least amount is a new beginning, if the next one is as well: once, a device
// may be missed.
constexpr double kLow = 0.7;
// So many quiet frames, at least, come before contrast agent arrives; then the amount rises, a frame, by so many times
// what it rose among them. While vessels fill it rises evenly.
constexpr int kMinQuiet = 2;
constexpr double kAbrupt = 3;

}  // namespace

ContrastArrival::Frame ContrastArrival::beginAnew(double amount) {
  quietest_ = first_ = last_ = amount;
  first_frame_ = last_frame_ = frame_;
  quiet_frames_ = 1;
  was_low_ = false;
  return Frame::kAnew;
}

bool ContrastArrival::isAbrupt(double amount) const {
  const double before = (last_ - first_) / std::max(1, last_frame_ - first_frame_);
  return (amount - last_) / (frame_ - last_frame_) > kAbrupt * before;
}

ContrastArrival::Frame ContrastArrival::addUnbranched(double amount, double side) {
  const bool is_low = amount < kLow * quietest_, lasts = is_low && was_low_;
  was_low_ = is_low;
  if (quiet_frames_ == 0 || (lasts && !arrived_)) return beginAnew(amount);
  if (is_low || amount > kQuiet * quietest_ + kQuietMore * side) return Frame::kFilled;
  quietest_ = std::min(quietest_, amount);
  last_ = amount;
  last_frame_ = frame_;
  ++quiet_frames_;
  return Frame::kQuiet;
}

ContrastArrival::Frame ContrastArrival::add(double amount, bool branched, double side) {
  ++frame_;
  const bool is_much = quiet_frames_ > 0 && amount > kArrived * quietest_ + kArrivedMore * side;
  if (!is_much || arrived_) return branched ? Frame::kFilled : addUnbranched(amount, side);
  arrived_ = quiet_frames_ >= kMinQuiet && isAbrupt(amount);
  if (arrived_) return Frame::kFilled;
  quiet_frames_ = 0;
  return branched ? Frame::kFilled : beginAnew(amount);
}

}  // namespace angio::imaging
