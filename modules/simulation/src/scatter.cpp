// SPDX-License-Identifier: GPL-2.0-or-later
#include "scatter.hpp"

#include <algorithm>
#include <numeric>

#include "angio/base/row_bands.hpp"

namespace angio::simulation {
namespace {

void addRow(const float* __restrict row, int count, float* __restrict sum) {
  for (int x = 0; x < count; ++x) sum[x] += row[x];
}

// Adds to each pixel what lies on the line from one cell's value to the next one's; beyond the outer ones' middles
// their value holds.
void addBetween(const std::vector<float>& cells, int cell_px, int width, float* __restrict row) {
  const int half = cell_px / 2, last = static_cast<int>(cells.size()) - 1;
  for (int x = 0; x < std::min(half, width); ++x) row[x] += cells.front();
  for (int i = 0, x = half; x < width; ++i, x += cell_px) {
    const float step = (cells[std::min(i + 1, last)] - cells[i]) / static_cast<float>(cell_px);
    const float first = cells[i] + 0.5F * step;
    const int count = std::min(cell_px, width - x);
    for (int k = 0; k < count; ++k) row[x + k] += first + static_cast<float>(k) * step;
  }
}

}  // namespace

Scatter::Scatter(double ratio, double std_px) : ratio_(ratio), blur_(std_px / kCell) {}

void Scatter::add(cv::Mat& primary, int threads) {
  if (ratio_ == 0) return;
  const int columns = (primary.cols + kCell - 1) / kCell, rows = (primary.rows + kCell - 1) / kCell;
  cells_.create(rows, columns, CV_32FC1);
  forBands(threads, rows, [&](const RowBand& band) {
    std::vector<float> line(primary.cols);
    for (int j = band.top; j < band.bottom; ++j) {
      const int bottom = std::min((j + 1) * kCell, primary.rows);
      std::fill(line.begin(), line.end(), 0.0F);
      for (int y = j * kCell; y < bottom; ++y) addRow(primary.ptr<float>(y), primary.cols, line.data());
      float* cells = cells_.ptr<float>(j);
      for (int i = 0; i < columns; ++i) {
        const int right = std::min((i + 1) * kCell, primary.cols);
        const float sum = std::accumulate(line.begin() + i * kCell, line.begin() + right, 0.0F);
        cells[i] = sum / static_cast<float>((bottom - j * kCell) * (right - i * kCell));
      }
    }
  });
  blur_.apply(cells_, blurred_, 1);

  const float ratio = static_cast<float>(ratio_);
  forBands(threads, primary.rows, [&](const RowBand& band) {
    std::vector<float> line(columns);
    for (int y = band.top; y < band.bottom; ++y) {
      // Cells are where their middle is.
      const float v = std::clamp((static_cast<float>(y) + 0.5F) / kCell - 0.5F, 0.0F, static_cast<float>(rows - 1));
      const int j = static_cast<int>(v);
      const float* above = blurred_.ptr<float>(j);
      const float* below = blurred_.ptr<float>(std::min(j + 1, rows - 1));
      const float down = v - static_cast<float>(j);
      for (int i = 0; i < columns; ++i) line[i] = ratio * (above[i] + down * (below[i] - above[i]));
      addBetween(line, kCell, primary.cols, primary.ptr<float>(y));
    }
  });
}

}  // namespace angio::simulation
