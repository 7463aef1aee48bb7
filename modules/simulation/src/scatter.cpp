// SPDX-License-Identifier: GPL-2.0-or-later
#include "scatter.hpp"

#include <algorithm>

#include "bands.hpp"

namespace angio {

Scatter::Scatter(double ratio, double sigma_px) : ratio_(ratio), blur_(sigma_px / kCell) {}

void Scatter::add(cv::Mat& primary, int threads) {
  if (ratio_ == 0) return;
  const int columns = (primary.cols + kCell - 1) / kCell, rows = (primary.rows + kCell - 1) / kCell;
  cells_.create(rows, columns, CV_32FC1);
  forBands(threads, rows, [&](const RowBand& band) {
    for (int j = band.top; j < band.bottom; ++j) {
      const int bottom = std::min((j + 1) * kCell, primary.rows);
      float* cells = cells_.ptr<float>(j);
      std::fill(cells, cells + columns, 0.0F);
      for (int y = j * kCell; y < bottom; ++y) {
        const float* row = primary.ptr<float>(y);
        for (int i = 0; i < columns; ++i) {
          const int right = std::min((i + 1) * kCell, primary.cols);
          float sum = 0;
          for (int x = i * kCell; x < right; ++x) sum += row[x];
          cells[i] += sum / static_cast<float>((bottom - j * kCell) * (right - i * kCell));
        }
      }
    }
  });
  blur_.apply(cells_, blurred_, 1);

  const float ratio = static_cast<float>(ratio_);
  // Cells are where their middle is; beyond the outer ones' middles their value holds.
  const auto place = [](int pixel, int count) {
    return std::clamp((static_cast<float>(pixel) + 0.5F) / kCell - 0.5F, 0.0F, static_cast<float>(count - 1));
  };
  forBands(threads, primary.rows, [&](const RowBand& band) {
    std::vector<float> line(columns + 1);
    for (int y = band.top; y < band.bottom; ++y) {
      const float v = place(y, rows);
      const int j = static_cast<int>(v);
      const float* above = blurred_.ptr<float>(j);
      const float* below = blurred_.ptr<float>(std::min(j + 1, rows - 1));
      const float down = v - static_cast<float>(j);
      for (int i = 0; i < columns; ++i) line[i] = ratio * (above[i] + down * (below[i] - above[i]));
      line[columns] = line[columns - 1];
      float* row = primary.ptr<float>(y);
      for (int x = 0; x < primary.cols; ++x) {
        const float u = place(x, columns);
        const int i = static_cast<int>(u);
        row[x] += line[i] + (u - static_cast<float>(i)) * (line[i + 1] - line[i]);
      }
    }
  });
}

}  // namespace angio
