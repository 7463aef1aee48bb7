// SPDX-License-Identifier: GPL-2.0-or-later
#include "tube_shadows.hpp"

#include <algorithm>
#include <cmath>

namespace angio::imaging {

constexpr int kCell = 16;  // Side of a cell [working px].

// A tube is entered in the cells that its shadow, and the profile of a vessel like it, may reach [radii, px].
constexpr float kReachRadii = 1.5f, kShadowReach = 6;

// Pieces are entered some at a time, and a run goes on over gaps as long as two of these.
constexpr int kAtOnce = 4;

// The nearest piece is sought among some first [px].
constexpr int kStride = 8;

// How far a shadow's blur reaches beyond its tube [px].
constexpr float kBlurred = 3;

void TubeShadows::set(const cv::Size& image, std::vector<std::vector<Piece>> tubes) {
  tubes_ = std::move(tubes);
  columns_ = image.width / kCell + 1;
  rows_ = image.height / kCell + 1;
  cells_.resize(static_cast<std::size_t>(columns_) * rows_);
  for (auto& cell : cells_) cell.clear();
  for (std::size_t t = 0; t < tubes_.size(); ++t) {
    const int count = static_cast<int>(tubes_[t].size());
    for (int first = 0; first < count; first += kAtOnce) {
      enter(static_cast<int>(t), first, std::min(first + kAtOnce, count) - 1);
    }
  }
}

void TubeShadows::enter(int tube, int first, int last) {
  const Piece& piece = tubes_[tube][(first + last) / 2];
  if (!(piece.contrast > 0)) return;
  const float reach = kReachRadii * piece.radius + kShadowReach;
  const auto cellAt = [](float at, int count) { return std::clamp(static_cast<int>(at) / kCell, 0, count - 1); };
  const int right = cellAt(piece.position.x + reach, columns_), bottom = cellAt(piece.position.y + reach, rows_);
  for (int y = cellAt(piece.position.y - reach, rows_); y <= bottom; ++y) {
    for (int x = cellAt(piece.position.x - reach, columns_); x <= right; ++x) {
      auto& cell = cells_[static_cast<std::size_t>(y) * columns_ + x];
      if (!cell.empty() && cell.back().tube == tube && first - cell.back().last <= 2 * kAtOnce) {
        cell.back().last = last;
      } else {
        cell.push_back({tube, first, last});
      }
    }
  }
}

// The run's piece that is nearest to the profile, or -1.
int TubeShadows::nearest(const Run& run, const Profile& profile) const {
  const std::vector<Piece>& tube = tubes_[run.tube];
  const float half = profile.step * static_cast<float>(profile.count / 2);
  float least = 1e9f;
  int best = -1;
  const auto offer = [&](int i) {
    if (!(tube[i].contrast > 0)) return;
    const cv::Point2f d = tube[i].position - profile.middle;
    const float across = std::abs(d.x * profile.normal.y - d.y * profile.normal.x);
    const float away = across + std::max(0.0f, std::abs(d.dot(profile.normal)) - half);
    if (away >= least) return;
    least = away;
    best = i;
  };
  // Pieces stand a pixel apart: some of them tell where to look closer.
  for (int i = run.first; i <= run.last; i += kStride) offer(i);
  offer(run.last);
  if (best < 0 || least > TubeChord::reach(tube[best].radius, profile.blur) + kStride) return -1;
  for (int step = kStride / 2; step > 0; step /= 2) {
    const int middle = best;
    if (middle - step >= run.first) offer(middle - step);
    if (middle + step <= run.last) offer(middle + step);
  }
  return least < TubeChord::reach(tube[best].radius, profile.blur) ? best : -1;
}

// Near the profile the tube is taken for straight.
void TubeShadows::subtract(const Piece& piece, bool first, bool last, const Profile& profile, float* samples) const {
  const cv::Point2f d = profile.middle - piece.position;
  const auto offAxis = [&](const cv::Point2f& v) { return v.x * piece.along.y - v.y * piece.along.x; };
  const float off = offAxis(d), off_step = offAxis(profile.normal);
  const float ahead = d.dot(piece.along), ahead_step = profile.normal.dot(piece.along);
  const TubeChord::Profile shadow_at = chord_.of(piece.radius, profile.blur);
  const float fade = 1 / std::max(2 * profile.blur, 1.0f);
  for (int k = 0; k < profile.count; ++k) {
    const float at = profile.step * static_cast<float>(k - profile.count / 2), along = ahead + at * ahead_step;
    float shadow = piece.contrast * shadow_at(off + at * off_step);
    // At its end half of a blurred shadow is left.
    if (first) shadow *= std::clamp(0.5f + fade * along, 0.0f, 1.0f);
    if (last) shadow *= std::clamp(0.5f - fade * along, 0.0f, 1.0f);
    samples[k] -= shadow;
  }
}

bool TubeShadows::othersNear(int own, const cv::Point2f& place, float reach) const {
  const int x = std::clamp(static_cast<int>(place.x) / kCell, 0, columns_ - 1);
  const int y = std::clamp(static_cast<int>(place.y) / kCell, 0, rows_ - 1);
  for (const Run& run : cells_[static_cast<std::size_t>(y) * columns_ + x]) {
    if (run.tube == own) continue;
    for (int i = run.first; i <= run.last; i += 2) {  // Pieces stand a pixel apart.
      const Piece& piece = tubes_[run.tube][i];
      if (!(piece.contrast > 0)) continue;
      const cv::Point2f to = piece.position - place;
      const float most = reach + piece.radius + kBlurred;
      if (to.dot(to) < most * most) return true;
    }
  }
  return false;
}

void TubeShadows::subtractOthers(int own, const Profile& profile, float* samples) const {
  const int x = std::clamp(static_cast<int>(profile.middle.x) / kCell, 0, columns_ - 1);
  const int y = std::clamp(static_cast<int>(profile.middle.y) / kCell, 0, rows_ - 1);
  for (const Run& run : cells_[static_cast<std::size_t>(y) * columns_ + x]) {
    if (run.tube == own) continue;
    const int piece = nearest(run, profile);
    if (piece < 0) continue;
    subtract(tubes_[run.tube][piece], piece == run.first, piece == run.last, profile, samples);
  }
}

}  // namespace angio::imaging
