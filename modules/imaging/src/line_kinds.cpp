// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_kinds.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace angio {
namespace {

// A line begins at the border when its end is so near to it [working px].
constexpr float kAtBorder = 9;

// Radius and contrast of a device stay within this part of their own median; the contrast changes with the background's
// scatter and with what crosses.
constexpr float kEvenRadius = 0.2f, kEvenContrast = 0.4f;

// Values are medians over so many points, so that a crossing vessel does not end a catheter.
constexpr std::size_t kWindow = 33;

// One line may end at a device, which touches the wall somewhere.
constexpr int kMostBranches = 1;

// Edges and overlaps of bones and organs absorb less than this; a line that absorbs more is a vessel, however dilute.
constexpr float kBone = 0.15f;

// Radius of the thinnest vessel that can be seen [working px].
constexpr float kThinnest = 0.5f;

// What is left of a line after its device is a vessel if it is so long, else it belongs to the device.
constexpr std::size_t kRest = 22;

// Metal, or contrast agent before the blood dilutes it, is not fainter than this part of what is usual in the image.
constexpr float kFaint = 0.7f;

// Vessels are there when their lines are so long, in the device's length.
constexpr float kVesselsPart = 0.5f;

bool atBorder(const cv::Point2f& p, const std::vector<RowRange>& open) {
  const int y = std::clamp(static_cast<int>(p.y + 0.5f), 0, static_cast<int>(open.size()) - 1);
  const auto lit = [&](int row) {
    return row >= 0 && row < static_cast<int>(open.size()) && open[row].begin < open[row].end &&
           p.x >= static_cast<float>(open[row].begin) && p.x < static_cast<float>(open[row].end);
  };
  const int reach = static_cast<int>(kAtBorder);
  return p.x - static_cast<float>(open[y].begin) < kAtBorder || static_cast<float>(open[y].end) - p.x < kAtBorder ||
         !lit(y - reach) || !lit(y + reach);
}

float medianOf(const std::vector<float>& values, std::size_t from, std::size_t to) {
  std::vector<float> part(values.begin() + static_cast<std::ptrdiff_t>(from),
                          values.begin() + static_cast<std::ptrdiff_t>(to));
  const auto middle = part.begin() + static_cast<std::ptrdiff_t>(part.size() / 2);
  std::nth_element(part.begin(), middle, part.end());
  return *middle;
}

void reverse(CentreLine& line) {
  std::reverse(line.line.begin(), line.line.end());
  for (auto* values : {&line.radius, &line.sigma, &line.contrast}) std::reverse(values->begin(), values->end());
}

// Points from the line's beginning on over which it is as even as a device.
std::size_t evenPart(const CentreLine& line, std::size_t shortest) {
  const std::size_t n = line.line.size();
  if (n < shortest || n < 2 * kWindow) return 0;
  const float radius = medianOf(line.radius, 0, shortest), contrast = medianOf(line.contrast, 0, shortest);
  std::size_t end = 0;
  for (std::size_t from = 0; from + kWindow <= n; from += kWindow / 4) {
    const std::size_t to = from + kWindow;
    if (std::abs(medianOf(line.radius, from, to) - radius) > kEvenRadius * std::max(radius, 1.0f)) break;
    if (std::abs(medianOf(line.contrast, from, to) - contrast) > kEvenContrast * contrast) break;
    end = to;
  }
  return n - end < kRest ? n : end;
}

// Lines that end at the side of the first `count` points.
int branchesOff(const std::vector<CentreLine>& lines, std::size_t own, std::size_t count) {
  const CentreLine& line = lines[own];
  int found = 0;
  for (std::size_t other = 0; other < lines.size(); ++other) {
    if (other == own) continue;
    for (const cv::Point2f& end : {lines[other].line.front(), lines[other].line.back()}) {
      // Near the device's tip vessels begin.
      const std::size_t side = count - std::min(count, kWindow);
      for (std::size_t i = 0; i < side; ++i) {
        if (cv::norm(line.line[i] - end) > line.radius[i] + 2) continue;
        ++found;
        break;
      }
    }
  }
  return found;
}

CentreLine cut(CentreLine& line, std::size_t at) {
  CentreLine rest;
  const auto from = static_cast<std::ptrdiff_t>(at);
  rest.line.assign(line.line.begin() + from - 1, line.line.end());
  rest.radius.assign(line.radius.begin() + from - 1, line.radius.end());
  rest.sigma.assign(line.sigma.begin() + from - 1, line.sigma.end());
  rest.contrast.assign(line.contrast.begin() + from - 1, line.contrast.end());
  line.line.resize(at);
  for (auto* values : {&line.radius, &line.sigma, &line.contrast}) values->resize(at);
  return rest;
}

}  // namespace

void dropAlongBorder(std::vector<CentreLine>& lines, const std::vector<RowRange>& open) {
  const auto follows = [&](const CentreLine& line) {
    const auto near =
        std::count_if(line.line.begin(), line.line.end(), [&](const auto& p) { return atBorder(p, open); });
    return 2 * static_cast<std::size_t>(near) > line.line.size();
  };
  lines.erase(std::remove_if(lines.begin(), lines.end(), follows), lines.end());
}

void dropDilute(std::vector<CentreLine>& lines, float least) {
  std::vector<float> densities, all, own;
  for (const CentreLine& line : lines) {
    own.clear();
    for (std::size_t i = 0; i < line.line.size(); ++i)
      own.push_back(line.contrast[i] / std::max(line.radius[i], kThinnest));
    all.insert(all.end(), own.begin(), own.end());
    densities.push_back(medianOf(own, 0, own.size()));
  }
  if (all.empty()) return;
  const float needed = least * medianOf(all, 0, all.size());
  std::size_t kept = 0;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const std::vector<float>& contrast = lines[l].contrast;
    if (densities[l] < needed && medianOf(contrast, 0, contrast.size()) < kBone) continue;
    if (kept != l) lines[kept] = std::move(lines[l]);
    ++kept;
  }
  lines.resize(kept);
}

void tellDevices(std::vector<CentreLine>& lines, const std::vector<RowRange>& open, float shortest) {
  std::vector<std::size_t> part(lines.size(), 0);
  std::vector<float> contrasts;
  for (const CentreLine& line : lines) contrasts.insert(contrasts.end(), line.contrast.begin(), line.contrast.end());
  if (contrasts.empty()) return;
  const float usual = medianOf(contrasts, 0, contrasts.size());
  float vessels = 0, devices = 0;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    CentreLine& line = lines[l];
    if (!atBorder(line.line.front(), open) && atBorder(line.line.back(), open)) reverse(line);
    if (atBorder(line.line.front(), open)) part[l] = evenPart(line, static_cast<std::size_t>(shortest));
    if (part[l] < static_cast<std::size_t>(shortest) || branchesOff(lines, l, part[l]) > kMostBranches) part[l] = 0;
    if (part[l] > 0 && medianOf(line.contrast, 0, part[l]) < kFaint * usual) part[l] = 0;
    devices += static_cast<float>(part[l]);
    vessels += static_cast<float>(line.line.size() - part[l]);
  }
  if (vessels < kVesselsPart * devices) return;
  const std::size_t count = lines.size();
  for (std::size_t l = 0; l < count; ++l) {
    if (part[l] == 0) continue;
    if (part[l] < lines[l].line.size()) lines.push_back(cut(lines[l], part[l]));
    lines[l].kind = CurveKind::kDevice;
  }
}

}  // namespace angio
