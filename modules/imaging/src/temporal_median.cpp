// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/temporal_median.hpp"

#include <opencv2/core.hpp>
#include <string>

#include "angio/base/errors.hpp"
#include "xray_image.hpp"

namespace angio::imaging {

TemporalMedian::TemporalMedian(int frames) : frames_(frames) {
  if (frames >= 1 && frames <= kMaxFrames && frames % 2 == 1) return;
  throw InputError("temporal median", "frames", std::to_string(frames),
                   "must be odd and at most " + std::to_string(kMaxFrames));
}

const cv::Mat& TemporalMedian::add(const cv::Mat& frame) {
  requireXray(frame);
  if (!ring_.empty() && (ring_.front().size() != frame.size() || ring_.front().type() != frame.type())) ring_.clear();
  if (ring_.empty()) next_ = 0;
  if (static_cast<int>(ring_.size()) < frames_) {
    ring_.push_back(frame.clone());
  } else {
    frame.copyTo(ring_[next_]);
    next_ = (next_ + 1) % ring_.size();
  }
  result_.create(frame.size(), frame.type());
  for (int y = 0; y < frame.rows; ++y) sortRow(y);
  return result_;
}

// Bubbles the smaller values up, a whole row at a time, until the middle one is in its place.
void TemporalMedian::sortRow(int y) {
  const std::size_t n = ring_.size(), middle = (n - 1) / 2;
  sorted_.resize(n);
  for (std::size_t i = 0; i < n; ++i) ring_[i].row(y).copyTo(sorted_[i]);
  for (std::size_t place = 0; place <= middle; ++place) {
    for (std::size_t i = n - 1; i > place; --i) {
      cv::min(sorted_[i - 1], sorted_[i], smaller_);
      cv::max(sorted_[i - 1], sorted_[i], sorted_[i]);
      cv::swap(sorted_[i - 1], smaller_);
    }
  }
  sorted_[middle].copyTo(result_.row(y));
}

}  // namespace angio::imaging
