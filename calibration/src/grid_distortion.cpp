// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/grid_distortion.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/geometry/decompositions.hpp"

namespace angio::calibration {
namespace {

constexpr int kMaxFittedOrder = 15;
constexpr double kGoodEnough = 1.02;  // Of the best order's error.
constexpr double kOutlierStds = 8;    // Robust standard deviations per axis.
constexpr std::size_t kMinWholeHoles = 100;
constexpr double kMaxOutlierShare = 0.05;
constexpr double kRayleighMedian_stds = 1.1774;

enum class Share { kFit, kChoose, kHeldOut };

// A pattern over the grid, so that each share is everywhere.
Share shareOf(const GridHole& hole) {
  const int k = ((3 * hole.index.x() + 5 * hole.index.y()) % 4 + 4) % 4;
  return k == 0 ? Share::kHeldOut : k == 1 ? Share::kChoose : Share::kFit;
}

// The whole holes with their places in the regular grid as laid over the image, and in the circle around them.
struct LaidGrid {
  std::vector<std::size_t> holes;  // Among those of the grid.
  Eigen::Matrix2Xd pinhole_px, seen_px;
  Eigen::Vector2d center_px{0, 0};
  double unit_px = 1;
  Eigen::MatrixXd rows;  // A hole's terms of the highest order.
  std::vector<bool> use;
};

// The similarity z -> a z + b of complex numbers that is nearest to the image.
struct GridSimilarity {
  std::complex<double> a, b;

  Eigen::Vector2d operator()(const Eigen::Vector2d& place) const {
    const std::complex<double> z = a * std::complex<double>(place.x(), place.y()) + b;
    return {z.real(), z.imag()};
  }
};

GridSimilarity similarityOf(const HoleGrid& grid) {
  std::complex<double> mean_place, mean_seen, product;
  double squares = 0, count = 0;
  const auto complexOf = [](const Eigen::Vector2d& v) { return std::complex<double>(v.x(), v.y()); };
  for (const GridHole& hole : grid.holes) {
    if (!hole.whole) continue;
    mean_place += complexOf(hole.place_pitches);
    mean_seen += complexOf(hole.center_px);
    ++count;
  }
  mean_place /= count;
  mean_seen /= count;
  for (const GridHole& hole : grid.holes) {
    if (!hole.whole) continue;
    const std::complex<double> place = complexOf(hole.place_pitches) - mean_place;
    product += std::conj(place) * (complexOf(hole.center_px) - mean_seen);
    squares += std::norm(place);
  }
  const std::complex<double> a = product / squares;
  return {a, mean_seen - a * mean_place};
}

LaidGrid laidGrid(const HoleGrid& grid) {
  const GridSimilarity lay = similarityOf(grid);
  LaidGrid laid;
  std::vector<cv::Point2f> places;
  for (std::size_t i = 0; i < grid.holes.size(); ++i) {
    if (!grid.holes[i].whole) continue;
    const Eigen::Vector2f at = lay(grid.holes[i].place_pitches).cast<float>();
    laid.holes.push_back(i);
    places.emplace_back(at.x(), at.y());
  }
  cv::Point2f center;
  float radius = 0;
  cv::minEnclosingCircle(places, center, radius);
  laid.center_px = {center.x, center.y};
  laid.unit_px = radius;
  const auto count = static_cast<Eigen::Index>(laid.holes.size());
  laid.pinhole_px.resize(2, count);
  laid.seen_px.resize(2, count);
  laid.rows.resize(count, DisplacementPolynomial::termCount(kMaxFittedOrder));
  laid.use.assign(laid.holes.size(), true);
  for (Eigen::Index k = 0; k < count; ++k) {
    const GridHole& hole = grid.holes[laid.holes[static_cast<std::size_t>(k)]];
    laid.pinhole_px.col(k) = lay(hole.place_pitches);
    laid.seen_px.col(k) = hole.center_px;
    laid.rows.row(k) =
        DisplacementPolynomial::terms(kMaxFittedOrder, (laid.pinhole_px.col(k) - laid.center_px) / laid.unit_px);
  }
  return laid;
}

// Normal equations of the used holes for which `takes` holds; those of a lower order are their upper left part.
struct NormalEquations {
  Eigen::MatrixXd A, b;
  int holes = 0;
};

template <typename Takes>
NormalEquations normalEquationsOf(const HoleGrid& grid, const LaidGrid& laid, const Takes& takes) {
  NormalEquations sums;
  Eigen::MatrixXd rows(laid.rows.rows(), laid.rows.cols()), shifts(laid.rows.rows(), 2);
  for (std::size_t k = 0; k < laid.holes.size(); ++k) {
    if (!laid.use[k] || !takes(grid.holes[laid.holes[k]])) continue;
    const auto at = static_cast<Eigen::Index>(k);
    rows.row(sums.holes) = laid.rows.row(at);
    shifts.row(sums.holes++) = (laid.seen_px.col(at) - laid.pinhole_px.col(at)).transpose();
  }
  sums.A = rows.topRows(sums.holes).transpose() * rows.topRows(sums.holes);
  sums.b = rows.topRows(sums.holes).transpose() * shifts.topRows(sums.holes);
  return sums;
}

DisplacementPolynomial solvedPolynomial(const NormalEquations& sums, int order) {
  const Eigen::Index terms = DisplacementPolynomial::termCount(order);
  DisplacementPolynomial polynomial{order, Eigen::Matrix2Xd(2, terms)};
  const Eigen::MatrixXd A = sums.A.topLeftCorner(terms, terms);
  for (int axis = 0; axis < 2; ++axis) {
    polynomial.coefficients_px.row(axis) = solveSymmetric(A, sums.b.col(axis).head(terms)).transpose();
  }
  return polynomial;
}

Eigen::Matrix2Xd residualsOf(const LaidGrid& laid, const DisplacementPolynomial& polynomial) {
  const Eigen::Index terms = DisplacementPolynomial::termCount(polynomial.order);
  return laid.pinhole_px - laid.seen_px + polynomial.coefficients_px * laid.rows.leftCols(terms).transpose();
}

// Lengths of the residuals of used holes for which `takes` holds.
template <typename Takes>
std::vector<double> lengthsOf(const HoleGrid& grid, const LaidGrid& laid, const Eigen::Matrix2Xd& residuals_px,
                              const Takes& takes) {
  std::vector<double> lengths;
  for (std::size_t k = 0; k < laid.holes.size(); ++k) {
    if (!laid.use[k] || !takes(grid.holes[laid.holes[k]])) continue;
    lengths.push_back(residuals_px.col(static_cast<Eigen::Index>(k)).norm());
  }
  return lengths;
}

double rmsOf(const std::vector<double>& lengths) {
  double squared = 0;
  for (const double length : lengths) squared += length * length;
  return lengths.empty() ? 0 : std::sqrt(squared / static_cast<double>(lengths.size()));
}

int chosenOrder(const HoleGrid& grid, const LaidGrid& laid, std::vector<double>& choice_rms_px) {
  const auto isShare = [](Share share) { return [share](const GridHole& hole) { return shareOf(hole) == share; }; };
  const NormalEquations sums = normalEquationsOf(grid, laid, isShare(Share::kFit));
  choice_rms_px.clear();
  for (int order = 1; order <= kMaxFittedOrder; ++order) {
    if (DisplacementPolynomial::termCount(order) * 3 > sums.holes) break;
    const Eigen::Matrix2Xd r = residualsOf(laid, solvedPolynomial(sums, order));
    choice_rms_px.push_back(rmsOf(lengthsOf(grid, laid, r, isShare(Share::kChoose))));
  }
  const double best = *std::min_element(choice_rms_px.begin(), choice_rms_px.end());
  const auto chosen =
      std::find_if(choice_rms_px.begin(), choice_rms_px.end(), [&](double rms) { return rms <= kGoodEnough * best; });
  return static_cast<int>(chosen - choice_rms_px.begin()) + 1;
}

// Holes that lie off a smooth map are no longer used: a hole that is plugged, or half behind the rim.
void leaveOut(const HoleGrid& grid, LaidGrid& laid, int order, GridDistortion& result) {
  const auto all = [](const GridHole&) { return true; };
  const Eigen::Matrix2Xd r = residualsOf(laid, solvedPolynomial(normalEquationsOf(grid, laid, all), order));
  std::vector<double> lengths = lengthsOf(grid, laid, r, all);
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  const double largest_px = kOutlierStds * *middle / kRayleighMedian_stds;
  for (std::size_t k = 0; k < laid.holes.size(); ++k) {
    if (!laid.use[k] || r.col(static_cast<Eigen::Index>(k)).norm() <= largest_px) continue;
    laid.use[k] = false;
    result.outliers.push_back(laid.holes[k]);
  }
}

void fitAll(const HoleGrid& grid, const LaidGrid& laid, GridDistortion& result) {
  const auto all = [](const GridHole&) { return true; };
  const NormalEquations sums = normalEquationsOf(grid, laid, all);
  const DisplacementPolynomial shift = solvedPolynomial(sums, result.order);
  result.distortion = DetectorDistortion::polynomial(laid.center_px, laid.unit_px, shift);
  const std::vector<double> lengths = lengthsOf(grid, laid, residualsOf(laid, shift), all);
  result.residual_rms_px = rmsOf(lengths);
  result.used = sums.holes;
  const Eigen::Index terms = DisplacementPolynomial::termCount(result.order);
  const double freedom = 2.0 * sums.holes - 2.0 * static_cast<double>(terms);
  result.noise_px = result.residual_rms_px * std::sqrt(sums.holes / freedom);
  result.term_covariance_px2 =
      result.noise_px * result.noise_px * inverseOfSymmetric(Eigen::MatrixXd(sums.A.topLeftCorner(terms, terms)));
  const std::vector<double> moved = lengthsOf(grid, laid, laid.seen_px - laid.pinhole_px, all);
  result.displacement_rms_px = rmsOf(moved);
  result.displacement_max_px = *std::max_element(moved.begin(), moved.end());
}

}  // namespace

double GridDistortion::std_px(const Eigen::Vector2d& pinhole_px) const {
  Eigen::Vector2d p = (pinhole_px - distortion.center_px).cwiseQuotient(distortion.unit_px);
  p /= std::max(1.0, p.norm());
  const Eigen::VectorXd row = DisplacementPolynomial::terms(order, p);
  return std::sqrt(row.dot(term_covariance_px2 * row));
}

GridDistortion fitGridDistortion(const std::string& place, const HoleGrid& grid) {
  const auto whole = std::count_if(grid.holes.begin(), grid.holes.end(), [](const GridHole& h) { return h.whole; });
  if (static_cast<std::size_t>(whole) < kMinWholeHoles) {
    throw InputError(place, "whole holes", std::to_string(whole), "must be at least 100");
  }
  LaidGrid laid = laidGrid(grid);
  GridDistortion result;
  result.found = static_cast<int>(grid.holes.size());
  result.order = chosenOrder(grid, laid, result.choice_rms_px);
  leaveOut(grid, laid, result.order, result);
  if (static_cast<double>(result.outliers.size()) > kMaxOutlierShare * static_cast<double>(whole)) {
    throw InputError(place, "holes", std::to_string(result.outliers.size()) + " of " + std::to_string(whole),
                     "are off every smooth map of a regular grid: is the grid whole, and flat on the detector?");
  }
  result.order = chosenOrder(grid, laid, result.choice_rms_px);
  const NormalEquations seen =
      normalEquationsOf(grid, laid, [](const GridHole& h) { return shareOf(h) != Share::kHeldOut; });
  const std::vector<double> held_out = lengthsOf(grid, laid, residualsOf(laid, solvedPolynomial(seen, result.order)),
                                                 [](const GridHole& h) { return shareOf(h) == Share::kHeldOut; });
  result.held_out = static_cast<int>(held_out.size());
  result.held_out_rms_px = rmsOf(held_out);
  if (!held_out.empty()) result.held_out_max_px = *std::max_element(held_out.begin(), held_out.end());
  fitAll(grid, laid, result);
  const GridSimilarity lay = similarityOf(grid);
  result.residuals_px.resize(2, static_cast<Eigen::Index>(grid.holes.size()));
  for (std::size_t i = 0; i < grid.holes.size(); ++i) {
    result.residuals_px.col(static_cast<Eigen::Index>(i)) =
        result.distortion.distorted(lay(grid.holes[i].place_pitches)) - grid.holes[i].center_px;
  }
  result.distortion.check(place, grid.width_px, grid.height_px);
  return result;
}

}  // namespace angio::calibration
