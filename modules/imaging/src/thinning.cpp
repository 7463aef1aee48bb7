// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/thinning.hpp"

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "angio/base/errors.hpp"
#include "framed_masks.hpp"

namespace angio::imaging {
namespace {

constexpr std::uint8_t kInside = 255, kTouched = 254;

// Directions are counted counter-clockwise from east: E, NE, N, NW, W, SW, S, SE.
constexpr int kNorth = 2, kSouth = 6, kEast = 0, kWest = 4;

// A neighbourhood as Neighbourhood::of gives it: bit k is the neighbour in this direction.
constexpr int kDirections[] = {3, 2, 1, 4, 0, 5, 6, 7};

// A pixel may go when its Yokoi number for 8-connected regions is one (it is simple) and it is not the end of a line.
std::array<bool, 256> removableTable() {
  std::array<bool, 256> table{};
  for (int bits = 0; bits < 256; ++bits) {
    int around = 0;
    for (int k = 0; k < 8; ++k) around |= ((bits >> k) & 1) << kDirections[k];
    const auto empty = [around](int k) { return ((around >> (k % 8)) & 1) == 0 ? 1 : 0; };
    int yokoi = 0, count = 0;
    for (int k = 0; k < 8; k += 2) yokoi += empty(k) - empty(k) * empty(k + 1) * empty(k + 2);
    for (int k = 0; k < 8; ++k) count += 1 - empty(k);
    table[bits] = yokoi == 1 && count >= 2;
  }
  return table;
}

struct Neighbourhood {
  explicit Neighbourhood(std::ptrdiff_t row) : offset{1, 1 - row, -row, -1 - row, -1, row - 1, row, row + 1} {}

  // Which neighbours are set, three of a row at a time: north-west to north-east, west and east, south-west to
  // south-east.
  unsigned of(const std::uint8_t* p) const {
    const unsigned above = setOf(p + offset[3]), here = setOf(p - 1), below = setOf(p + offset[5] - 1) >> 8;
    const auto three = [](unsigned set) { return (set | set >> 7 | set >> 14) & 7; };
    return three(above) | ((here | here >> 15) & 3) << 3 | three(below) << 5;
  }

  std::array<std::ptrdiff_t, 8> offset;

 private:
  // Four pixels, bit 8 k for the one number k. Pixels that are set have their highest bit; compilers make one load of
  // it.
  static unsigned setOf(const std::uint8_t* p) {
    const unsigned word = static_cast<unsigned>(p[0]) | static_cast<unsigned>(p[1]) << 8 |
                          static_cast<unsigned>(p[2]) << 16 | static_cast<unsigned>(p[3]) << 24;
    return word >> 7 & 0x01010101u;
  }
};

std::vector<std::uint8_t*> foreground(cv::Mat& framed) {
  std::vector<std::uint8_t*> pixels;
  forEachSet(framed, [&](std::uint8_t* p) {
    *p = kInside;
    pixels.push_back(p);
  });
  return pixels;
}

}  // namespace

void thinFramed(cv::Mat& framed) {
  static const std::array<bool, 256> kRemovable = removableTable();
  const Neighbourhood neighbours(static_cast<std::ptrdiff_t>(framed.step));
  // A pixel is looked at again only when a neighbour has gone since: what stays is soon a small part of the region.
  // None of these lists is longer than the first.
  std::vector<std::uint8_t*> active = foreground(framed), next(active.size()), side(active.size());
  std::size_t left = active.size();
  while (left > 0) {
    std::size_t touched = 0;
    for (const int direction : {kNorth, kSouth, kEast, kWest}) {
      // The side is fixed before it is peeled: one layer goes, not the whole region.
      std::size_t on_side = 0;
      const std::ptrdiff_t towards = neighbours.offset[direction];
      for (std::size_t i = 0; i < left; ++i) {
        std::uint8_t* const p = active[i];
        if (*p == 0 || p[towards] != 0) continue;
        side[on_side] = p;
        on_side += kRemovable[neighbours.of(p)] ? 1 : 0;
      }
      // One after the other with a second look: only so is the topology safe.
      for (std::size_t i = 0; i < on_side; ++i) {
        std::uint8_t* const p = side[i];
        if (!kRemovable[neighbours.of(p)]) continue;
        *p = 0;
        for (const std::ptrdiff_t offset : neighbours.offset) {
          if (p[offset] != kInside) continue;
          p[offset] = kTouched;
          next[touched++] = p + offset;
        }
      }
    }
    left = 0;
    for (std::size_t i = 0; i < touched; ++i) {
      std::uint8_t* const p = next[i];
      if (*p == 0) continue;
      *p = kInside;
      active[left++] = p;
    }
  }
}

void thin(cv::Mat& mask) {
  if (mask.type() != CV_8UC1) throw InputError("mask", "type", cv::typeToString(mask.type()), "must be CV_8UC1");
  cv::Mat framed;
  cv::copyMakeBorder(mask, framed, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  thinFramed(framed);
  framed(cv::Rect(1, 1, mask.cols, mask.rows)).copyTo(mask);
}

}  // namespace angio::imaging
