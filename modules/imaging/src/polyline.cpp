// SPDX-License-Identifier: GPL-2.0-or-later
#include "polyline.hpp"

#include <algorithm>
#include <cmath>

namespace angio::imaging {

Polyline smoothed(const Polyline& line, float sigma, bool closed) {
  const int n = static_cast<int>(line.size()), reach = static_cast<int>(std::ceil(2.5f * sigma));
  if (n < 3 || reach < 1) return line;
  std::vector<float> weight(static_cast<std::size_t>(reach) + 1);
  for (int k = 0; k <= reach; ++k) {
    weight[k] = std::exp(-0.5f * static_cast<float>(k * k) / (sigma * sigma));
  }
  const auto beyond = [&](int i) -> cv::Point2f {
    if (closed) return line[((i % n) + n) % n];
    if (i < 0) return 2 * line.front() - line[std::min(-i, n - 1)];
    if (i >= n) return 2 * line.back() - line[std::max(2 * (n - 1) - i, 0)];
    return line[i];
  };
  Polyline result(line.size());
  for (int i = 0; i < n; ++i) {
    cv::Point2f sum = weight[0] * line[i];
    float total = weight[0];
    for (int k = 1; k <= reach; ++k) {
      sum += weight[k] * (beyond(i - k) + beyond(i + k));
      total += 2 * weight[k];
    }
    result[i] = sum * (1 / total);
  }
  return result;
}

std::vector<float> equalSteps(const Polyline& line, float spacing) {
  std::vector<float> length(line.size(), 0);
  for (std::size_t i = 1; i < line.size(); ++i) {
    length[i] = length[i - 1] + static_cast<float>(cv::norm(line[i] - line[i - 1]));
  }
  const int pieces = std::max(1, static_cast<int>(std::lround(length.back() / spacing)));
  std::vector<float> places;
  std::size_t edge = 0;
  for (int p = 0; p <= pieces; ++p) {
    const float wanted = length.back() * static_cast<float>(p) / static_cast<float>(pieces);
    while (edge + 2 < line.size() && length[edge + 1] < wanted) ++edge;
    const float step = edge + 1 < line.size() ? length[edge + 1] - length[edge] : 0;
    places.push_back(static_cast<float>(edge) +
                     (step > 0 ? std::clamp((wanted - length[edge]) / step, 0.0f, 1.0f) : 0));
  }
  return places;
}

cv::Point2f at(const Polyline& line, float place) {
  const std::size_t i = std::min(static_cast<std::size_t>(place), line.size() - 1);
  const std::size_t next = std::min(i + 1, line.size() - 1);
  const float w = place - static_cast<float>(i);
  return (1 - w) * line[i] + w * line[next];
}

cv::Point2f directionAt(const Polyline& line, std::size_t i, std::size_t reach) {
  const cv::Point2f chord = line[std::min(i + reach, line.size() - 1)] - line[i - std::min(i, reach)];
  const float length = static_cast<float>(cv::norm(chord));
  return length > 0 ? chord * (1 / length) : cv::Point2f(0, 0);
}

}  // namespace angio::imaging
