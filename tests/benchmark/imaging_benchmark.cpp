// SPDX-License-Identifier: GPL-2.0-or-later
// From the frame to its centrelines: the module's methods, and what one writes with OpenCV alone, on the same frames.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <opencv2/ximgproc.hpp>
#include <vector>

#include "angio/benchmarks/namespace.hpp"
#include "angio/imaging/collimator_opening.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/imaging/subtraction.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "scene.hpp"

namespace angio::benchmarks {
namespace {

// One simulated arteriogram with what is to be seen in it.
struct Frame {
  explicit Frame(int side_px) {
    const Scene scene;
    const auto& p = scene.camera.parameters();
    const double spacing_m = p.pixel_spacing_m.value() * p.width_px / side_px;
    const XrayCamera camera = XrayCamera::centered(side_px, side_px, spacing_m, p.source_detector_distance_m.value());
    FluoroscopyRenderer renderer(scene.tree, FluoroscopySettings());
    image = renderer.render(camera, scene.truth, 0);
    next = renderer.render(camera, scene.truth, 1);
    XrayScene seen;
    seen.T_camera_model = scene.truth;
    truth = renderer.truth(camera, seen).centerline;
  }

  cv::Mat image, next;
  Centerline2d truth;
};

double nearest(const Eigen::Matrix2Xd& points, const Eigen::Vector2d& p) {
  return points.cols() == 0 ? 1e9 : (points.colwise() - p).colwise().norm().minCoeff();
}

// Points that a person could tell: not within another vessel at least as wide, as where vessels part or cross.
std::vector<int> apart(const Centerline2d& truth) {
  std::vector<int> points;
  for (int i = 0; i < truth.size(); ++i) {
    bool hidden = false;
    for (int j = 0; j < truth.size() && !hidden; ++j) {
      const double r = truth.radius_px[j];
      hidden = truth.branch[j] != truth.branch[i] && r >= 0.8 * truth.radius_px[i] &&
               (truth.points_px.col(j) - truth.points_px.col(i)).squaredNorm() < r * r;
    }
    if (!hidden) points.push_back(i);
  }
  return points;
}

// Lengths of what is covered count equally wherever points lie: both are in steps of a pixel or less.
void report(benchmark::State& state, const Eigen::Matrix2Xd& found, const Frame& frame) {
  constexpr double kReach_px = 1.5;
  int covered = 0, right = 0;
  std::vector<double> errors;
  const std::vector<int> seen = apart(frame.truth);
  for (const int i : seen) {
    covered += nearest(found, frame.truth.points_px.col(i)) <= kReach_px ? 1 : 0;
  }
  const Eigen::Matrix2Xd truth = densified(frame.truth, 0.2).points_px;
  for (Eigen::Index i = 0; i < found.cols(); ++i) {
    errors.push_back(nearest(truth, found.col(i)));
    right += errors.back() <= kReach_px ? 1 : 0;
  }
  state.counters["covered"] = static_cast<double>(covered) / std::max<double>(1, static_cast<double>(seen.size()));
  state.counters["apart"] = static_cast<double>(seen.size()) / std::max(1, frame.truth.size());
  state.counters["right"] = static_cast<double>(right) / std::max<double>(1, static_cast<double>(found.cols()));
  if (errors.empty()) return;
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  state.counters["median_px"] = errors[errors.size() / 2];
}

template <typename Settings>
void extractLines(benchmark::State& state) {
  cv::setNumThreads(1);
  const Frame frame(static_cast<int>(state.range(0)));
  const auto extractor = makeExtractor(Settings());
  Centerline2d found;
  for (auto _ : state) found = extractor->extract(frame.image);
  report(state, densified(found, 1).points_px, frame);
}
BENCHMARK_TEMPLATE(extractLines, RidgeSettings)->Arg(512)->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(extractLines, OtsuSettings)->Arg(512)->Arg(1024)->Unit(benchmark::kMillisecond);

// Flattened by a wide blur, smoothed by a narrow one, thresholded by Otsu, thinned; regions too small to be vessels go.
// The widths were chosen by eye for these frames, and not searched for.
void extractWithOpenCv(benchmark::State& state) {
  cv::setNumThreads(1);
  const int side_px = static_cast<int>(state.range(0));
  const Frame frame(side_px);
  const double wide = side_px / 40.0, narrow = side_px / 700.0;
  cv::Mat image, background, flat, eight, mask, labels, stats, centroids, lines;
  std::vector<cv::Point> pixels;
  for (auto _ : state) {
    frame.image.convertTo(image, CV_32F);
    cv::GaussianBlur(image, background, cv::Size(), wide);
    cv::GaussianBlur(image, flat, cv::Size(), narrow);
    cv::divide(flat, background, flat);
    flat.convertTo(eight, CV_8U, -500, 500);  // Vessels are what is darker than its surroundings.
    cv::threshold(eight, mask, 0, 255, cv::THRESH_BINARY | cv::THRESH_OTSU);
    const int count = cv::connectedComponentsWithStats(mask, labels, stats, centroids);
    std::vector<std::uint8_t> kept(static_cast<std::size_t>(count), 0);
    for (int k = 1; k < count; ++k) kept[k] = stats.at<int>(k, cv::CC_STAT_AREA) >= side_px / 6 ? 255 : 0;
    mask.forEach<std::uint8_t>([&](std::uint8_t& m, const int* at) { m = kept[labels.at<int>(at)]; });
    cv::ximgproc::thinning(mask, lines);
    cv::findNonZero(lines, pixels);
  }
  Eigen::Matrix2Xd found(2, static_cast<Eigen::Index>(pixels.size()));
  for (std::size_t i = 0; i < pixels.size(); ++i) found.col(static_cast<Eigen::Index>(i)) << pixels[i].x, pixels[i].y;
  report(state, found, frame);
}
BENCHMARK(extractWithOpenCv)->Arg(512)->Arg(1024)->Unit(benchmark::kMillisecond);

void findField(benchmark::State& state) {
  const Frame frame(1024);
  for (auto _ : state) benchmark::DoNotOptimize(findOpenField(frame.image).polygon_px.size());
}
BENCHMARK(findField)->Unit(benchmark::kMillisecond);

void subtractMask(benchmark::State& state) {
  const Frame frame(1024);
  for (auto _ : state) benchmark::DoNotOptimize(subtracted(frame.image, frame.next).data);
}
BENCHMARK(subtractMask)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace angio::benchmarks
