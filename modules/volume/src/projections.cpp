// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/projections.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>

namespace angio::volume {
namespace {

constexpr int kHeight_px = 900;
constexpr int kShift = 4;  // OpenCV draws to sixteenths of a pixel.

// The two axes of the picture that looks along a third one.
struct View {
  int right, down, along;
};

cv::Mat largestAlong(const Volume& volume, const View& view) {
  const VoxelGrid& grid = volume.grid;
  cv::Mat largest(grid.size[view.down], grid.size[view.right], CV_32F, cv::Scalar(-3e38));
  forEachVoxel(grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    float& pixel = largest.at<float>(v[view.down], v[view.right]);
    pixel = std::max(pixel, volume.values[at]);
  });
  return largest;
}

// Grey from the median to nearly the brightest, so that neither noise nor one bright voxel takes all contrast.
cv::Mat greyOf(const cv::Mat& values) {
  std::vector<float> sorted(values.begin<float>(), values.end<float>());
  std::sort(sorted.begin(), sorted.end());
  const double low = sorted[sorted.size() / 20], high = sorted[sorted.size() - 1 - sorted.size() / 200];
  cv::Mat grey, color;
  const double scale = 220 / std::max(high - low, 1e-30);
  values.convertTo(grey, CV_8U, scale, -low * scale);
  cv::cvtColor(grey, color, cv::COLOR_GRAY2BGR);
  return color;
}

cv::Scalar branchColor(std::size_t branch) {
  static const cv::Scalar kColors[] = {{60, 200, 60},  {60, 120, 255}, {255, 160, 60}, {200, 80, 220},
                                       {60, 220, 240}, {240, 220, 60}, {140, 140, 255}};
  return kColors[branch % std::size(kColors)];
}

// The part of the volume that the tree needs, and some millimetres around it.
Volume aroundTree(const Volume& volume, const VesselTree& tree) {
  constexpr double kAround_m = 10e-3;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  for (Eigen::Index i = 0; i < tree.points().cols(); ++i) {
    const Eigen::Vector3d index = volume.grid.indexAt(tree.points().col(i));
    low = low.cwiseMin(index);
    high = high.cwiseMax(index);
  }
  const Eigen::Vector3d around = kAround_m * volume.grid.spacing_m.cwiseInverse(),
                        last = volume.grid.size.cast<double>().array() - 1;
  const Eigen::Vector3d first = (low - around).cwiseMax(0).cwiseMin(last),
                        end = (high + around).cwiseMin(last).cwiseMax(0);
  return cropped(volume, first.cast<int>(), end.cast<int>(), 0, 0);
}

cv::Mat drawView(const Volume& volume, const VesselTree& tree, const View& view) {
  const VoxelGrid& grid = volume.grid;
  const double width_m = grid.size[view.right] * grid.spacing_m[view.right];
  const double height_m = grid.size[view.down] * grid.spacing_m[view.down];
  const double px_per_m = kHeight_px / std::max(height_m, width_m);
  const cv::Size size(std::max(1, static_cast<int>(std::lround(width_m * px_per_m))),
                      std::max(1, static_cast<int>(std::lround(height_m * px_per_m))));
  cv::Mat picture;
  cv::resize(greyOf(largestAlong(volume, view)), picture, size, 0, 0, cv::INTER_LINEAR);
  const auto place = [&](int i) {
    const Eigen::Vector3d index = grid.indexAt(tree.points().col(i));
    // A pixel's middle is at whole numbers, as a voxel's.
    const auto px = [&](int axis) {
      return static_cast<int>(
          std::lround(((index[axis] + 0.5) * grid.spacing_m[axis] * px_per_m - 0.5) * (1 << kShift)));
    };
    return cv::Point(px(view.right), px(view.down));
  };
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const auto& branch = tree.branches()[b];
    for (std::size_t i = 1; i < branch.size(); ++i) {
      cv::line(picture, place(branch[i - 1]), place(branch[i]), branchColor(b), 2, cv::LINE_AA, kShift);
    }
  }
  for (int i = 0; i < tree.size(); ++i) {
    if (tree.parents()[i] >= 0) continue;
    cv::circle(picture, place(i), 6 << kShift, {40, 40, 255}, cv::FILLED, cv::LINE_AA, kShift);
  }
  return picture;
}

}  // namespace

cv::Mat drawProjections(const Volume& whole, const VesselTree& tree) {
  const Volume volume = aroundTree(whole, tree);
  std::vector<cv::Mat> pictures;
  for (const View& view : {View{0, 1, 2}, View{0, 2, 1}, View{1, 2, 0}}) {
    cv::Mat framed;
    const cv::Mat picture = drawView(volume, tree, view);
    cv::copyMakeBorder(picture, framed, 0, kHeight_px - picture.rows, 0, 8, cv::BORDER_CONSTANT, {40, 40, 40});
    pictures.push_back(framed);
  }
  cv::Mat sheet;
  cv::hconcat(pictures, sheet);
  return sheet;
}

}  // namespace angio::volume
