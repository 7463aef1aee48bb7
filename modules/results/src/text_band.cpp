// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/text_band.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "drawing.hpp"

namespace angio::results {
namespace {

constexpr double kMinSize = 0.45;              // Smaller letters of this font are hard to read.
constexpr double kSizesPerPixel = 1 / 1300.0;  // About 80 letters in the width of a large picture.
constexpr int kRim_px = 2;

int rounded(double value) { return static_cast<int>(std::lround(value)); }

int strokeLength_px(const TextStyle& style) { return rounded(36 * style.size); }

// What the text of an entry stands to the right of.
int indent_px(const BandEntry& entry, const TextStyle& style) {
  const int mark_px = entry.mark == BandEntry::Mark::kStroke ? strokeLength_px(style) + style.margin_px() : 0;
  return style.margin_px() + mark_px;
}

std::vector<std::string> linesOf(const BandEntry& entry, int width_px, const TextStyle& style) {
  return wrapped(entry.text, width_px - indent_px(entry, style) - style.margin_px(), style);
}

}  // namespace

int TextStyle::lineHeight_px() const { return rounded(30 * size) + 4; }

int TextStyle::margin_px() const { return rounded(12 * size) + 4; }

TextStyle textStyle(int picture_width_px) {
  const double size = std::max(kMinSize, kSizesPerPixel * picture_width_px);
  return {size, std::max(1, rounded(1.7 * size))};
}

int textWidth_px(const std::string& text, const TextStyle& style) {
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, style.size, style.stroke_px + kRim_px, nullptr).width;
}

std::vector<std::string> wrapped(const std::string& text, int width_px, const TextStyle& style) {
  const auto fits = [&](const std::string& part) { return textWidth_px(part, style) <= width_px; };
  std::vector<std::string> lines;
  std::string line, word;
  std::istringstream words(text);
  while (words >> word) {
    const std::string longer = line.empty() ? word : line + " " + word;
    if (fits(longer)) {
      line = longer;
      continue;
    }
    if (!line.empty()) lines.push_back(line);
    while (word.size() > 1 && !fits(word)) {
      std::size_t letters = word.size() - 1;
      while (letters > 1 && !fits(word.substr(0, letters))) --letters;
      lines.push_back(word.substr(0, letters));
      word.erase(0, letters);
    }
    line = word;
  }
  if (!line.empty()) lines.push_back(line);
  return lines;
}

int bandHeight_px(const std::vector<BandEntry>& entries, int width_px, const TextStyle& style) {
  std::size_t lines = 0;
  for (const BandEntry& entry : entries) lines += linesOf(entry, width_px, style).size();
  return lines == 0 ? 0 : static_cast<int>(lines) * style.lineHeight_px() + style.margin_px();
}

void writeBand(cv::Mat band, const std::vector<BandEntry>& entries, const TextStyle& style) {
  int baseline_px = style.margin_px() / 2;
  for (const BandEntry& entry : entries) {
    bool first = true;
    for (const std::string& line : linesOf(entry, band.cols, style)) {
      baseline_px += style.lineHeight_px();
      // The middle of a capital, which is 22 px high at size 1.
      const int middle_px = baseline_px - rounded(11 * style.size), margin_px = style.margin_px();
      if (first && entry.mark == BandEntry::Mark::kStroke) {
        cv::line(band, {margin_px, middle_px}, {margin_px + strokeLength_px(style), middle_px}, entry.color_bgr,
                 std::max(3, rounded(5 * style.size)), cv::LINE_AA);
      }
      writeText(band, line, {indent_px(entry, style), baseline_px}, entry.color_bgr, style.size, style.stroke_px,
                kRim_px);
      first = false;
    }
  }
}

cv::Mat withBandBelow(const cv::Mat& picture, const std::vector<BandEntry>& entries) {
  const TextStyle style = textStyle(picture.cols);
  const int height_px = bandHeight_px(entries, picture.cols, style);
  if (height_px == 0) return picture;
  cv::Mat whole;
  cv::copyMakeBorder(picture, whole, 0, height_px, 0, 0, cv::BORDER_CONSTANT, kGroundColor);
  writeBand(whole.rowRange(picture.rows, whole.rows), entries, style);
  return whole;
}

}  // namespace angio::results
