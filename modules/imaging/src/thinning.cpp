// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/thinning.hpp"

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "angio/base/errors.hpp"

namespace angio::imaging {
namespace {

constexpr std::uint8_t kInside = 255, kTouched = 254;

// Bit k of a neighbourhood is the neighbour in direction k, counter-clockwise from east: E, NE, N, NW, W, SW, S, SE.
constexpr int kNorth = 2, kSouth = 6, kEast = 0, kWest = 4;

// A pixel may go when its Yokoi number for 8-connected regions is one (it is simple) and it is not the end of a line.
std::array<bool, 256> removableTable() {
  std::array<bool, 256> table{};
  for (int around = 0; around < 256; ++around) {
    const auto empty = [around](int k) { return ((around >> (k % 8)) & 1) == 0 ? 1 : 0; };
    int yokoi = 0, count = 0;
    for (int k = 0; k < 8; k += 2) yokoi += empty(k) - empty(k) * empty(k + 1) * empty(k + 2);
    for (int k = 0; k < 8; ++k) count += 1 - empty(k);
    table[around] = yokoi == 1 && count >= 2;
  }
  return table;
}

struct Neighbourhood {
  explicit Neighbourhood(std::ptrdiff_t row) : offset{1, 1 - row, -row, -1 - row, -1, row - 1, row, row + 1} {}

  int of(const std::uint8_t* p) const {
    int around = 0;
    for (int k = 0; k < 8; ++k) around |= (p[offset[k]] != 0 ? 1 : 0) << k;
    return around;
  }

  std::array<std::ptrdiff_t, 8> offset;
};

std::vector<std::uint8_t*> foreground(cv::Mat& image) {
  std::vector<std::uint8_t*> pixels;
  for (int y = 1; y + 1 < image.rows; ++y) {
    std::uint8_t* row = image.ptr(y);
    for (int x = 1; x + 1 < image.cols; ++x) {
      if (row[x] == 0) continue;
      row[x] = kInside;
      pixels.push_back(row + x);
    }
  }
  return pixels;
}

// `framed` has an empty frame one pixel wide, so that every pixel of it has eight neighbours.
void thinFramed(cv::Mat& framed) {
  static const std::array<bool, 256> kRemovable = removableTable();
  const Neighbourhood neighbours(static_cast<std::ptrdiff_t>(framed.step));
  // A pixel is looked at again only when a neighbour has gone since: what stays is soon a small part of the region.
  std::vector<std::uint8_t*> active = foreground(framed), next, side;
  while (!active.empty()) {
    next.clear();
    for (const int direction : {kNorth, kSouth, kEast, kWest}) {
      // The side is fixed before it is peeled: one layer goes, not the whole region.
      side.clear();
      const std::ptrdiff_t towards = neighbours.offset[direction];
      for (std::uint8_t* p : active) {
        if (*p != 0 && p[towards] == 0 && kRemovable[neighbours.of(p)]) side.push_back(p);
      }
      // One after the other with a second look: only so is the topology safe.
      for (std::uint8_t* p : side) {
        if (!kRemovable[neighbours.of(p)]) continue;
        *p = 0;
        for (const std::ptrdiff_t offset : neighbours.offset) {
          if (p[offset] != kInside) continue;
          p[offset] = kTouched;
          next.push_back(p + offset);
        }
      }
    }
    active.clear();
    for (std::uint8_t* p : next) {
      if (*p == 0) continue;
      *p = kInside;
      active.push_back(p);
    }
  }
}

}  // namespace

void thin(cv::Mat& mask) {
  if (mask.type() != CV_8UC1) throw InputError("mask", "type", cv::typeToString(mask.type()), "must be CV_8UC1");
  cv::Mat framed;
  cv::copyMakeBorder(mask, framed, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  thinFramed(framed);
  framed(cv::Rect(1, 1, mask.cols, mask.rows)).copyTo(mask);
}

}  // namespace angio::imaging
