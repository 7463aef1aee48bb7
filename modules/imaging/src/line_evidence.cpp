// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_evidence.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "angio/base/groups.hpp"
#include "line_density.hpp"
#include "quantile.hpp"

namespace angio::imaging {
namespace {

// Beyond these the marked images say no more.
constexpr float kMinClarity = 0.3f, kMaxClarity = 16, kMinContrast = 0.02f, kMaxContrast = 0.6f, kMinDensity = 0.05f;

// Nor do they here [shorter sides].
constexpr float kMinLength = 0.001f, kMaxLength = 2.9f, kMinGap = 0.006f, kMaxGap = 0.117f;

// A gap that is usual in trees [shorter sides]; what is added to the gap to the tree is small beside one.
constexpr float kUsualGap = 0.039f, kSmallGap = 0.012f;

// Straighter lines are alike, and so are those that bend more. Shorter ones [shorter sides] are straight by their
// length and tell less.
constexpr float kMinBow = 0.03f, kMaxBow = 0.1f, kBowLength = 0.08f;

// Lines that are more even are alike, and so are those with flanks that are more alike, or less.
constexpr float kEven = 0.03f, kMinStep = 0.25f, kMaxStep = 1.5f;

// Of all points of vessels, the part that is fainter than the strong ones.
constexpr float kFainter = 0.9f;

// Lines hang together where an end of one is so near to the other, and an end so near to another line is a branch's
// [working px].
constexpr float kJoined = 3, kHolds = 2;

// Vessels wider than this part of the shorter side were not among those that the weights were learnt from.
constexpr float kWide = 0.0117f;

// The strong vessels are those of at most that width, where there is so much of them [shorter sides]: a wide one
// absorbs over a longer way, and beside an aorta all arteries would be faint.
constexpr float kEnough = 0.25f;

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
  return medianOf(clarities);
}

float densityOf(const CentreLine& line) { return medianOf(densitiesAlong(line, line.line.size())); }

// The farthest that a line is from the chord between its ends.
float bowOf(const CentreLine& line) {
  const cv::Point2f chord = line.line.back() - line.line.front();
  float most = 0;
  for (const cv::Point2f& p : line.line) {
    most = std::max(most, static_cast<float>(std::abs(chord.cross(p - line.line.front()))));
  }
  return most / std::max(static_cast<float>(cv::norm(chord)), 1e-6f);
}

// About the median radius.
float unevennessOf(const CentreLine& line, float radius) {
  std::vector<float> off(line.radius);
  for (float& r : off) r = std::abs(r - radius);
  return medianOf(off) / radius;
}

// Some points of a line that follow each other, and the box that they lie in: most lines' points are far from most
// ends.
struct Piece {
  const cv::Point2f *begin, *end;
  float left, top, right, bottom;

  // Whether none of them is nearer to a place than that. The margin is for what sums of squares are rounded by.
  bool isFurther(const cv::Point2f& place, float distance2) const {
    constexpr float kMargin = 1e-3f;
    const float dx = std::max({left - place.x, place.x - right, 0.0f});
    const float dy = std::max({top - place.y, place.y - bottom, 0.0f});
    return dx * dx + dy * dy > (1 + kMargin) * distance2 + kMargin;
  }
};

std::vector<Piece> piecesOf(const Polyline& line) {
  constexpr std::size_t kPoints = 16;
  std::vector<Piece> pieces;
  for (std::size_t first = 0; first < line.size(); first += kPoints) {
    const cv::Point2f* const begin = line.data() + first;
    Piece piece{begin, line.data() + std::min(first + kPoints, line.size()), begin->x, begin->y, begin->x, begin->y};
    for (const cv::Point2f* p = begin; p != piece.end; ++p) {
      piece.left = std::min(piece.left, p->x);
      piece.right = std::max(piece.right, p->x);
      piece.top = std::min(piece.top, p->y);
      piece.bottom = std::max(piece.bottom, p->y);
    }
    pieces.push_back(piece);
  }
  return pieces;
}

// What the vessels of an image are like, and how its lines hang together.
class Surroundings {
 public:
  Surroundings(const std::vector<CentreLine>& lines, float side) : lines_(lines), side_(side) {
    for (const CentreLine& line : lines) {
      boxes_.push_back(cv::boundingRect(line.line));
      pieces_.push_back(piecesOf(line.line));
      lengths_.push_back(lengthOf(line));
      radii_.push_back(medianOf(line.radius));
      contrasts_.push_back(medianOf(line.contrast));
    }
    measureVessels();
    findNear();
    connect();
    measureGroups();
  }

  LineEvidence evidenceOn(std::size_t i) const {
    const CentreLine& line = lines_[i];
    const Group& group = groups_[root_[i]];
    LineEvidence on;
    on.contrast = contrasts_[i];
    on.contrast_part = on.contrast / strong_contrast_;
    on.density_part = densityOf(line) / usual_density_;
    on.is_wide = isWide(i);
    on.most_are_wide = most_are_wide_;
    on.stands_alone = !isBranch(i);
    on.terms = {std::log(std::clamp(clarityOf(line), kMinClarity, kMaxClarity)),
                std::log(std::clamp(on.contrast_part, kMinContrast, kMaxContrast)),
                std::log(std::max(on.density_part, kMinDensity)),
                std::log(std::clamp(group.length / side_, kMinLength, kMaxLength)),
                std::log(std::max(group.gap / side_, kMinGap) / kUsualGap),
                std::log(treeGapOf(i) / side_ / kSmallGap + 1),
                logBowOf(i),
                std::log(unevennessOf(line, radii_[i]) + kEven),
                std::log(std::clamp(line.step, kMinStep, kMaxStep))};
    return on;
  }

 private:
  struct Group {
    float length = 0, gap = 0;
    float shown = 0;  // Length by contrast.
  };

  bool isWide(std::size_t i) const { return radii_[i] > kWide * side_; }

  void measureVessels() {
    std::vector<float> contrasts, wide_contrasts, densities;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const CentreLine& line = lines_[i];
      if (line.kind == CurveKind::kDevice) continue;
      std::vector<float>& among = isWide(i) ? wide_contrasts : contrasts;
      among.insert(among.end(), line.contrast.begin(), line.contrast.end());
      const std::vector<float> own = densitiesAlong(line, line.line.size());
      densities.insert(densities.end(), own.begin(), own.end());
    }
    most_are_wide_ = wide_contrasts.size() > contrasts.size();
    if (static_cast<float>(contrasts.size()) < kEnough * side_) {
      contrasts.insert(contrasts.end(), wide_contrasts.begin(), wide_contrasts.end());
    }
    if (contrasts.empty()) return;
    strong_contrast_ = std::max(quantileOf(contrasts, kFainter), 1e-9f);
    usual_density_ = std::max(medianOf(densities), 1e-9f);
  }

  void connect() {
    Groups groups(lines_.size());
    for (std::size_t own = 0; own < lines_.size(); ++own) {
      for (const std::size_t other : near_[own]) {
        const int a = static_cast<int>(own), b = static_cast<int>(other);
        if (groups.of(a) != groups.of(b) && endDistance(own, other, kJoined) < kJoined) groups.join(a, b);
      }
    }
    for (int i = 0; i < static_cast<int>(lines_.size()); ++i) root_.push_back(static_cast<std::size_t>(groups.of(i)));
  }

  void measureGroups() {
    groups_.assign(lines_.size(), {0, kMaxGap * side_, 0});
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      Group& group = groups_[root_[i]];
      group.length += lengths_[i];
      if (lines_[i].kind == CurveKind::kDevice) continue;
      group.shown += lengths_[i] * std::min(contrasts_[i] / strong_contrast_, 1.0f);
      if (group.shown > groups_[tree_].shown) tree_ = root_[i];
    }
    std::vector<float> group_lengths;
    for (const std::size_t root : root_) group_lengths.push_back(groups_[root].length);
    const float longest = *std::max_element(group_lengths.begin(), group_lengths.end());
    for (std::size_t own = 0; own < lines_.size(); ++own) {
      if (group_lengths[own] == longest) continue;
      float& gap = groups_[root_[own]].gap;
      for (std::size_t other = 0; other < lines_.size(); ++other) {
        if (group_lengths[other] > group_lengths[own]) gap = endDistance(own, other, gap);
      }
    }
  }

  // From an end of a line to the tree.
  float treeGapOf(std::size_t own) const {
    if (root_[own] == tree_) return 0;
    float gap = kMaxGap * side_;
    for (std::size_t other = 0; other < lines_.size(); ++other) {
      if (root_[other] == tree_) gap = endDistance(own, other, gap);
    }
    return gap;
  }

  // Whether a place may be that near to a line.
  bool isNear(const cv::Point2f& p, std::size_t other, float most) const {
    const cv::Rect2f& box = boxes_[other];
    return p.x >= box.x - most && p.x <= box.x + box.width + most && p.y >= box.y - most &&
           p.y <= box.y + box.height + most;
  }

  // Which others each line's ends may be near to, in ascending order: most are not.
  void findNear() {
    static_assert(kHolds <= kJoined);
    near_.resize(lines_.size());
    std::vector<std::pair<cv::Point2f, std::size_t>> ends;  // From left to right, and whose they are.
    for (std::size_t own = 0; own < lines_.size(); ++own) {
      ends.emplace_back(lines_[own].line.front(), own);
      ends.emplace_back(lines_[own].line.back(), own);
    }
    std::sort(ends.begin(), ends.end(), [](const auto& a, const auto& b) { return a.first.x < b.first.x; });
    for (std::size_t other = 0; other < lines_.size(); ++other) {
      const float left = boxes_[other].x - kJoined, right = boxes_[other].x + boxes_[other].width + kJoined;
      const auto first =
          std::lower_bound(ends.begin(), ends.end(), left, [](const auto& end, float x) { return end.first.x < x; });
      for (auto end = first; end != ends.end() && end->first.x <= right; ++end) {
        std::vector<std::size_t>& near = near_[end->second];
        if (end->second == other || !isNear(end->first, other, kJoined)) continue;
        if (near.empty() || near.back() != other) near.push_back(other);
      }
    }
  }

  // From an end of a line to another line; `most` where it is no less.
  float endDistance(std::size_t own, std::size_t other, float most) const {
    for (const cv::Point2f& end : {lines_[own].line.front(), lines_[own].line.back()}) {
      if (!isNear(end, other, most)) continue;
      float least2 = most * most;
      for (const Piece& piece : pieces_[other]) {
        if (piece.isFurther(end, least2)) continue;
        for (const cv::Point2f* p = piece.begin; p != piece.end; ++p) {
          least2 = std::min(least2, (*p - end).dot(*p - end));
        }
      }
      most = std::sqrt(least2);
    }
    return most;
  }

  bool isBranch(std::size_t own) const {
    return std::any_of(near_[own].begin(), near_[own].end(),
                       [&](std::size_t other) { return endDistance(own, other, kHolds) < kHolds; });
  }

  // 0 for a line that bends as vessels do.
  float logBowOf(std::size_t i) const {
    const float part = std::clamp(bowOf(lines_[i]) / std::max(lengths_[i], 1.0f), kMinBow, kMaxBow);
    return std::log(part / kMaxBow) * std::min(1.0f, lengths_[i] / (kBowLength * side_));
  }

  const std::vector<CentreLine>& lines_;
  float side_;
  std::vector<cv::Rect2f> boxes_;
  std::vector<std::vector<Piece>> pieces_;
  std::vector<float> lengths_, radii_, contrasts_;  // Medians.
  std::vector<std::vector<std::size_t>> near_;
  float strong_contrast_ = 1, usual_density_ = 1;
  bool most_are_wide_ = false;
  std::vector<std::size_t> root_;  // Of each line, the one that stands for its group.
  std::vector<Group> groups_;      // At the roots.
  std::size_t tree_ = 0;           // The root of the group that shows most.
};

}  // namespace

std::vector<LineEvidence> evidenceOf(const std::vector<CentreLine>& lines, float side) {
  std::vector<LineEvidence> evidence;
  if (lines.empty()) return evidence;
  const Surroundings surroundings(lines, side);
  for (std::size_t i = 0; i < lines.size(); ++i) evidence.push_back(surroundings.evidenceOn(i));
  return evidence;
}

}  // namespace angio::imaging
