// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_evidence.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "line_density.hpp"
#include "quantile.hpp"

namespace angio::imaging {
namespace {

// Log odds of a vessel: the constant, and what each logarithm counts.
constexpr float kPrior = -0.66f, kPerClarity = 2.58f, kPerContrast = 2.35f, kPerLength = 1.16f, kPerGap = -0.63f,
                kPerBend = 0.25f;

// Beyond these the marked images say no more. Lengths and gaps are in the shorter side.
constexpr float kMinClarity = 0.3f, kMaxClarity = 16, kMinShownContrast = 0.02f, kMaxShownContrast = 0.6f,
                kMaxConnected = 2.9f;
constexpr float kMinGap = 0.006f, kMaxGap = 0.117f, kUsualGap = 0.039f;

// The least bend that counts; that of shorter lines counts less [working px].
constexpr float kMinBend = 0.01f, kBendLength = 40;

// Of all points of vessels, the part that is fainter than the strong ones.
constexpr float kFainter = 0.9f;

// Lines hang together where an end of one is so near to the other [working px].
constexpr float kJoined = 3;

// Vessels wider than this part of the shorter side were not among those that the odds were learnt from, and a wide
// line's place is less sure: it owes less. Most lines of an aortic arch have -1 and more, a step's edge below -3.
constexpr float kWide = 0.0117f, kWideOdds = -1;

// The strong vessels are those of at most that width, where there is so much of them [shorter sides]: a wide one
// absorbs over a longer way, and beside an aorta all arteries would be faint.
constexpr float kEnough = 0.25f;

// Log odds of a vessel where one is expected, over those of one elsewhere. Chosen on simulated livers, seed 11.
constexpr float kExpectedOdds = 5;

// A line of these log odds is no bone, however dilute.
constexpr float kNoBone = 3;

// Edges and overlaps of bones and organs absorb less than this, or than this part of what strong vessels do; a line
// that absorbs more is a vessel, however dilute.
constexpr float kBone = 0.15f, kBonePart = 0.5f;

// A line that stands alone must have this many times the density that the others must.
constexpr float kAloneFactor = 1.37f;

// An end so near to another line [working px] is a branch's.
constexpr float kHolds = 2;

float lengthOf(const CentreLine& line) {
  float length = 0;
  for (std::size_t i = 1; i < line.line.size(); ++i) {
    length += static_cast<float>(cv::norm(line.line[i] - line.line[i - 1]));
  }
  return length;
}

// The median of radius over standard deviation across the line.
float clarityOf(const CentreLine& line) {
  std::vector<float> clarities(line.line.size());
  for (std::size_t i = 0; i < clarities.size(); ++i) clarities[i] = line.radius[i] / std::max(line.sigma[i], 1e-3f);
  return medianOf(std::move(clarities));
}

// By how much a line is longer than the chord between its ends, as the logarithm of a part of its length.
float logBendOf(const CentreLine& line, float length) {
  const float chord = static_cast<float>(cv::norm(line.line.back() - line.line.front()));
  return std::log(std::max(1 - chord / std::max(length, 1.0f), kMinBend)) * std::min(1.0f, length / kBendLength);
}

// What the vessels of an image are like, and how its lines hang together.
class LineEvidence {
 public:
  LineEvidence(const std::vector<CentreLine>& lines, float side) : lines_(lines), side_(side) {
    std::vector<float> contrasts, wide_contrasts, densities;
    for (const CentreLine& line : lines) {
      boxes_.push_back(cv::boundingRect(line.line));
      lengths_.push_back(lengthOf(line));
      if (line.kind == CurveKind::kDevice) continue;
      std::vector<float>& among = isWide(line) ? wide_contrasts : contrasts;
      among.insert(among.end(), line.contrast.begin(), line.contrast.end());
      const std::vector<float> own = densitiesAlong(line, line.line.size());
      densities.insert(densities.end(), own.begin(), own.end());
    }
    if (static_cast<float>(contrasts.size()) < kEnough * side) {
      contrasts.insert(contrasts.end(), wide_contrasts.begin(), wide_contrasts.end());
    }
    if (contrasts.empty()) return;
    strong_contrast_ = std::max(quantileOf(contrasts, kFainter), 1e-9f);
    usual_density_ = medianOf(std::move(densities));
    connect();
  }

  bool isWide(const CentreLine& line) const { return medianOf(line.radius) > kWide * side_; }

  float logOdds(std::size_t i) const {
    const CentreLine& line = lines_[i];
    const Group& group = groups_[root_[i]];
    const float contrast = std::clamp(medianOf(line.contrast) / strong_contrast_, kMinShownContrast, kMaxShownContrast);
    return kPrior + kPerClarity * std::log(std::clamp(clarityOf(line), kMinClarity, kMaxClarity)) +
           kPerContrast * std::log(contrast) +
           kPerLength * std::log(std::clamp(group.length / side_, 1e-3f, kMaxConnected)) +
           kPerGap * std::log(std::max(group.gap / side_, kMinGap) / kUsualGap) +
           kPerBend * logBendOf(line, lengths_[i]);
  }

  bool isDilute(std::size_t i, float least) const {
    if (medianOf(lines_[i].contrast) >= std::min(kBone, kBonePart * strong_contrast_)) return false;
    const float density = medianOf(densitiesAlong(lines_[i], lines_[i].line.size()));
    return density < least * usual_density_ || (density < kAloneFactor * least * usual_density_ && !isBranch(i));
  }

 private:
  struct Group {
    float length = 0, gap = 0;
  };

  void connect() {
    root_.resize(lines_.size());
    std::iota(root_.begin(), root_.end(), std::size_t{0});
    const auto rootOf = [&](std::size_t i) {
      while (root_[i] != i) i = root_[i] = root_[root_[i]];
      return i;
    };
    for (std::size_t own = 0; own < lines_.size(); ++own) {
      for (std::size_t other = 0; other < lines_.size(); ++other) {
        if (rootOf(own) != rootOf(other) && endDistance(own, other, kJoined) < kJoined)
          root_[rootOf(own)] = rootOf(other);
      }
    }
    groups_.assign(lines_.size(), {0, kMaxGap * side_});
    for (std::size_t i = 0; i < lines_.size(); ++i) root_[i] = rootOf(i);
    for (std::size_t i = 0; i < lines_.size(); ++i) groups_[root_[i]].length += lengths_[i];
    for (std::size_t own = 0; own < lines_.size(); ++own) {
      Group& group = groups_[root_[own]];
      for (std::size_t other = 0; other < lines_.size(); ++other) {
        if (groups_[root_[other]].length > group.length) group.gap = endDistance(own, other, group.gap);
      }
    }
  }

  // From an end of a line to another line; `most` where it is no less.
  float endDistance(std::size_t own, std::size_t other, float most) const {
    const cv::Rect2f box = boxes_[other];
    for (const cv::Point2f& end : {lines_[own].line.front(), lines_[own].line.back()}) {
      if (end.x < box.x - most || end.x > box.x + box.width + most || end.y < box.y - most ||
          end.y > box.y + box.height + most) {
        continue;
      }
      float least2 = most * most;
      for (const cv::Point2f& p : lines_[other].line) least2 = std::min(least2, (p - end).dot(p - end));
      most = std::sqrt(least2);
    }
    return most;
  }

  bool isBranch(std::size_t own) const {
    for (std::size_t other = 0; other < lines_.size(); ++other) {
      if (other != own && endDistance(own, other, kHolds) < kHolds) return true;
    }
    return false;
  }

  const std::vector<CentreLine>& lines_;
  float side_;
  std::vector<cv::Rect> boxes_;
  std::vector<float> lengths_;
  float strong_contrast_ = 1, usual_density_ = 0;
  std::vector<std::size_t> root_;  // Of each line, the one that stands for its group.
  std::vector<Group> groups_;      // At the roots.
};

}  // namespace

void dropUnlikely(std::vector<CentreLine>& lines, float side, float least_density) {
  std::vector<bool> keep;
  {
    const LineEvidence evidence(lines, side);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const bool device = lines[i].kind == CurveKind::kDevice;
      const float log_odds = device ? 0 : evidence.logOdds(i) + (lines[i].expected ? kExpectedOdds : 0);
      const bool likely = log_odds > (!device && evidence.isWide(lines[i]) ? kWideOdds : 0);
      keep.push_back(device ||
                     (likely && (lines[i].expected || log_odds > kNoBone || !evidence.isDilute(i, least_density))));
    }
  }
  std::vector<CentreLine> kept;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (keep[i]) kept.push_back(std::move(lines[i]));
  }
  lines = std::move(kept);
}

}  // namespace angio::imaging
