// SPDX-License-Identifier: GPL-2.0-or-later
#include "oriented_frame.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace angio::registration {
namespace {

// A row of Gaussians three quarters of their width apart is smooth to one part in 10^15: more points add nothing but
// time.
constexpr double kPointsPerScale = 4.0 / 3;

// The part of the detector where points within three scales can pull: elsewhere the field is nothing, and costs
// nothing.
KernelField::Region reachOf(const OrientedPoints& points, double scale_px, const XrayCamera& camera) {
  const double max_u = camera.width_px() - 0.5, max_v = camera.height_px() - 0.5;
  double u_first = max_u, u_last = -0.5, v_first = max_v, v_last = -0.5;
  for (int j = 0; j < points.size(); ++j) {
    u_first = std::min(u_first, points.u[j] - 3 * scale_px);
    u_last = std::max(u_last, points.u[j] + 3 * scale_px);
    v_first = std::min(v_first, points.v[j] - 3 * scale_px);
    v_last = std::max(v_last, points.v[j] + 3 * scale_px);
  }
  u_first = std::clamp(u_first, -0.5, max_u);
  v_first = std::clamp(v_first, -0.5, max_v);
  u_last = std::clamp(u_last, u_first, max_u);
  v_last = std::clamp(v_last, v_first, max_v);
  return {u_first, v_first, u_last - u_first, v_last - v_first};
}

constexpr double kMaxPixel_px = 8192;  // No detector is larger: what lies beyond does not count.
constexpr double kChord_px = 12;

Eigen::Vector2f doubleAngle(double tangent_rad) {
  const auto twice = static_cast<float>(2 * tangent_rad);
  return {std::cos(twice), std::sin(twice)};
}

// How certain a point is beside the image's middling one. Bounded: a curve that an extractor is very sure of is still
// one curve among others, may be the wrong one, and shares with them what an extractor does not know of.
class Certainty {
 public:
  explicit Certainty(const Centerline2d& c) : std_px_(c.std_px) {
    if (std_px_.size() == 0) return;
    Eigen::VectorXd sorted = std_px_;
    const auto middle = sorted.data() + sorted.size() / 2;
    std::nth_element(sorted.data(), middle, sorted.data() + sorted.size());
    middle_px_ = *middle;
  }
  float between(Eigen::Index a, Eigen::Index b, double weight_of_b) const {
    if (std_px_.size() == 0) return 1;
    const double std_px = (1 - weight_of_b) * std_px_[a] + weight_of_b * std_px_[b];
    return static_cast<float>(std::clamp(middle_px_ / std_px, 0.25, 1.0));
  }

 private:
  const Eigen::VectorXd& std_px_;
  double middle_px_ = 1;
};

float radiusBetween(const Centerline2d& c, Eigen::Index a, Eigen::Index b, double weight_of_b) {
  if (c.radius_px.size() == 0) return 0;
  return static_cast<float>((1 - weight_of_b) * c.radius_px[a] + weight_of_b * c.radius_px[b]);
}

void addPoint(const Centerline2d& c, const Certainty& certainty, Eigen::Index i, float mass, OrientedPoints& to) {
  const Eigen::Vector2f along = doubleAngle(c.tangent_rad[i]);
  to.add(static_cast<float>(c.points_px(0, i)), static_cast<float>(c.points_px(1, i)), along.x(), along.y(), mass,
         certainty.between(i, i, 0), radiusBetween(c, i, i, 0));
}

// A branch: points between its own where they stand far apart, each with the length of line it stands for.
void addBranch(const Centerline2d& c, const Certainty& certainty, Eigen::Index first, Eigen::Index last,
               double spacing_px, OrientedPoints& to) {
  const auto& p = c.points_px;
  const int began = to.size();
  to.begin.push_back(began);
  addPoint(c, certainty, first, 0, to);
  for (Eigen::Index i = first + 1; i <= last; ++i) {
    const Eigen::Vector2f here = doubleAngle(c.tangent_rad[i]);
    const Eigen::Vector2d a = p.col(i - 1), step = p.col(i) - a;
    const double length = step.norm();
    const bool gap = length > kMaxStep_px;
    const int pieces = gap ? 1 : std::max(1, static_cast<int>(std::ceil(length / spacing_px - 1e-9)));
    const float half_mass = gap ? 0 : static_cast<float>(0.5 * length / pieces);
    for (int k = 1; k <= pieces; ++k) {
      const double w = static_cast<double>(k) / pieces;
      const Eigen::Vector2d at = a + w * step;
      const Eigen::Vector2f along = k == pieces ? here : doubleAngle(std::atan2(step.y(), step.x()));
      to.mass_px.back() += half_mass;
      to.add(static_cast<float>(at.x()), static_cast<float>(at.y()), along.x(), along.y(), half_mass,
             certainty.between(i - 1, i, w), radiusBetween(c, i - 1, i, w));
    }
  }
  if (to.size() == began + 1) to.mass_px.back() = static_cast<float>(spacing_px);  // A branch of one point.
}

// Without order nobody knows how much line a point stands for; but a line's own kernel sum is 1 when its masses are
// right.
void massFromDensity(OrientedPoints& points) {
  constexpr double kScale_px = 8;
  KernelField field;
  const auto [u_min, u_max] = std::minmax_element(points.u.begin(), points.u.end());
  const auto [v_min, v_max] = std::minmax_element(points.v.begin(), points.v.end());
  const Eigen::Vector2d least = Eigen::Vector2d(*u_min, *v_min).cwiseMax(-kMaxPixel_px);
  const Eigen::Vector2d size = (Eigen::Vector2d(*u_max, *v_max) - least).cwiseMin(kMaxPixel_px).cwiseMax(1.0);
  field.build(points, kScale_px, {least.x(), least.y(), size.x(), size.y()});
  std::vector<double> sums;
  for (int i = 0; i < points.size(); ++i)
    sums.push_back(field.at({points.u[i], points.v[i]}, points.cos2[i], points.sin2[i]).F);
  const auto middle = sums.begin() + static_cast<std::ptrdiff_t>(sums.size() / 2);
  std::nth_element(sums.begin(), middle, sums.end());
  const auto mass = static_cast<float>(1 / std::max(0.05, *middle));
  for (auto& m : points.mass_px) m = mass;
}

double massOf_px(const OrientedPoints& points) {
  return std::accumulate(points.mass_px.begin(), points.mass_px.end(), 0.0);
}

// Of all branches, the last chord of each as long as it is.
double lengthByChords_px(const OrientedPoints& points) {
  double sum = 0;
  for (std::size_t b = 0; b < points.begin.size(); ++b) {
    const int end = b + 1 < points.begin.size() ? points.begin[b + 1] : points.size();
    int from = points.begin[b];
    for (int i = from; i < end; ++i) {
      const double chord = std::hypot(points.u[i] - points.u[from], points.v[i] - points.v[from]);
      if (chord < kChord_px && i + 1 < end) continue;
      sum += chord;
      from = i;
    }
  }
  return sum;
}

}  // namespace

void OrientedFrame::begin(const XrayViews& views, const OrientedKernelSettings& settings) {
  views_ = &views;
  if (images_.size() < views.size()) images_.resize(views.size());
  point_count_ = 0;
  length_px_ = 0;
  chord_length_px_.reset();
  for (std::size_t v = 0; v < views.size(); ++v) {
    Image& image = images_[v];
    orientedPoints(views[v].centerline, settings.spacing_px, settings.max_points_2d, image.points);
    angio::registration::fieldOfView(views[v], image.field_of_view);
    image.built.fill(false);
    point_count_ += image.points.size();
    for (const float mass : image.points.mass_px) length_px_ += mass;
  }
}

double OrientedFrame::chordLength_px() {
  if (chord_length_px_) return *chord_length_px_;
  double sum = 0;
  for (std::size_t v = 0; v < viewCount(); ++v) {
    // Points without order have no chords, and the mass of how dense they are.
    sum += (*views_)[v].centerline.ordered() ? lengthByChords_px(points(v)) : massOf_px(points(v));
  }
  chord_length_px_ = sum;
  return sum;
}

const KernelField& OrientedFrame::field(std::size_t view, int scale) {
  Image& image = images_[view];
  if (!image.built[scale]) {
    // As many pixels of line a point as the image has on average: a dense centreline is thinned more.
    const double point_px = length_px_ / std::max(1, point_count_);
    const int stride =
        std::max(1, static_cast<int>(kFieldScales_px[scale] / kPointsPerScale / std::max(0.1, point_px)));
    thinned(image.points, stride, image.thin);
    const XrayCamera& camera = (*views_)[view].camera;
    image.field[scale].build(image.thin, kFieldScales_px[scale], reachOf(image.thin, kFieldScales_px[scale], camera));
    image.built[scale] = true;
  }
  return image.field[scale];
}

void thinned(const OrientedPoints& points, int stride, OrientedPoints& to) {
  to.clear();
  for (std::size_t b = 0; b < points.begin.size(); ++b) {
    const int branch_end = b + 1 < points.begin.size() ? points.begin[b + 1] : points.size();
    to.begin.push_back(to.size());
    for (int begin = points.begin[b]; begin < branch_end; begin += stride) {
      const int end = std::min(branch_end, begin + stride), middle = (begin + end) / 2;
      float mass = 0;
      for (int i = begin; i < end; ++i) mass += points.mass_px[i];
      to.add(points.u[middle], points.v[middle], points.cos2[middle], points.sin2[middle], mass,
             points.certainty[middle], points.radius_px[middle]);
    }
  }
  to.pad();
}

void orientedPoints(const Centerline2d& c, double spacing_px, int max_points, OrientedPoints& to) {
  to.clear();
  const Certainty certainty(c);
  // Branches, or points without order, in the order of where they are: whoever wrote them in another order gets the
  // same sums, to the last bit.
  thread_local std::vector<std::pair<Eigen::Index, Eigen::Index>> runs;
  runs.clear();
  for (Eigen::Index first = 0; first < c.points_px.cols();) {
    Eigen::Index last = first;
    while (c.ordered() && last + 1 < c.points_px.cols() && c.branch[last + 1] == c.branch[first]) ++last;
    runs.emplace_back(first, last);
    first = last + 1;
  }
  const auto key = [&](const std::pair<Eigen::Index, Eigen::Index>& run) {
    return std::make_tuple(c.points_px(1, run.first), c.points_px(0, run.first), c.points_px(1, run.second),
                           c.points_px(0, run.second));
  };
  std::sort(runs.begin(), runs.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
  if (c.ordered()) {
    for (const auto& [first, last] : runs) addBranch(c, certainty, first, last, spacing_px, to);
  } else {
    if (!runs.empty()) to.begin.push_back(0);
    for (const auto& run : runs) addPoint(c, certainty, run.first, 1, to);
    if (to.size() > 0) massFromDensity(to);
  }
  if (to.size() > max_points) {
    const OrientedPoints all = to;
    thinned(all, (all.size() + max_points - 1) / max_points, to);
  }
  to.pad();
}

}  // namespace angio::registration
