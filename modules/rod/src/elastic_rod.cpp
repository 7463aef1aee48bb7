// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rod/elastic_rod.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "angio/base/checked.hpp"
#include "angio/base/errors.hpp"
#include "wall_friction.hpp"

namespace angio::rod {
namespace {

constexpr double kMaxStep_m = 1e-3, kMaxStep_rad = 0.2;  // Of the drive, in one step.
constexpr double kLongest = 1.6, kShortest = 0.4;        // Of the first edge, by the spacing.

// Length that two intervals have in common, each given by its middle and its length.
double overlap(double middle_a, double length_a, double middle_b, double length_b) {
  return std::min(middle_a + 0.5 * length_a, middle_b + 0.5 * length_b) -
         std::max(middle_a - 0.5 * length_a, middle_b - 0.5 * length_b);
}

// Between a point of the rod and the next one up the rod.
double spacingAt(const RodSettings& settings, double from_tip_m) {
  const double beyond_m = from_tip_m - settings.tip_length_m - 0.5 * settings.bend_length_m;
  if (beyond_m < 0) return settings.tip_spacing_m;
  return std::min(settings.spacing_m, settings.tip_spacing_m + 0.2 * beyond_m);
}

}  // namespace

ElasticRod::ElasticRod(ElasticRod&&) noexcept = default;
ElasticRod& ElasticRod::operator=(ElasticRod&&) noexcept = default;
ElasticRod::~ElasticRod() = default;

ElasticRod::ElasticRod(Lumen lumen, const RodSettings& settings, const RodStart& start)
    : lumen_(std::move(lumen)), settings_(checked("rod", settings)), bend_rad_(start.bend_rad) {
  layOut(start);
  setSections();
  rest();
}

void ElasticRod::layOut(const RodStart& start) {
  const TreeLocation& tip = start.tip;
  const TreeTopology& map = lumen_.map();
  inserted_m_ = map.start_m(tip.branch) + tip.arc_m;
  requireBetween("rod", "tip's way from the root [m]", inserted_m_, kMinInserted_m, 10);
  std::vector<double> from_tip{0};
  for (double space = spacingAt(settings_, 0); inserted_m_ - from_tip.back() > kLongest * space;
       space = spacingAt(settings_, from_tip.back())) {
    from_tip.push_back(from_tip.back() + space);
  }
  const int root = map.pathTo(tip.branch).front();
  const TreeFrame entry = map.frame({root, 0});
  const auto count = static_cast<Eigen::Index>(from_tip.size()) + 2;
  Eigen::Matrix3Xd points(3, count);
  points.col(1) = map.point({root, 0});
  points.col(0) = points.col(1) - settings_.spacing_m * entry.along;
  body_.lengths_m = Eigen::VectorXd::Constant(count - 1, settings_.spacing_m);
  tubes_.assign(static_cast<std::size_t>(count), lumen_.tubeAt({root, 0}));
  double before = inserted_m_;
  for (Eigen::Index i = 2; i < count; ++i) {
    const double s = from_tip[static_cast<std::size_t>(count - 1 - i)];
    const TreeLocation place = map.before(tip, s);
    points.col(i) = map.point(place);
    body_.lengths_m[i - 1] = before - s;
    tubes_[static_cast<std::size_t>(i)] = lumen_.tubeAt(place);
    before = s;
  }
  shape_ = untwistedRod(points, std::cos(start.roll_rad) * entry.normal + std::sin(start.roll_rad) * entry.binormal);
}

void ElasticRod::setSections() {
  const Eigen::Index n = shape_.size();
  body_.sections.resize(static_cast<std::size_t>(n));
  double from_tip_m = 0;
  for (Eigen::Index i = n - 1; i >= 0; --i) {
    RodSection& section = body_.sections[static_cast<std::size_t>(i)];
    const double stiff = std::clamp((from_tip_m - settings_.tip_length_m) / settings_.soft_length_m, 0.0, 1.0);
    // By the logarithm: each tenth of the way is as much stiffer.
    section.bending_n_m2 =
        settings_.tip_bending_n_m2 * std::pow(settings_.shaft_bending_n_m2 / settings_.tip_bending_n_m2, stiff);
    section.twisting_n_m2 = settings_.twist_per_bending * section.bending_n_m2;
    section.stretching_n = settings_.stretching_n;
    section.curvature_per_m.setZero();
    const double share_m = i > 0 && i + 1 < n ? body_.share_m(i) : 0;
    const double bent_m = overlap(from_tip_m, share_m, settings_.tip_length_m, settings_.bend_length_m);
    if (bent_m > 0) section.curvature_per_m[0] = bent_m / share_m * bend_rad_ / settings_.bend_length_m;
    if (i > 0) from_tip_m += body_.lengths_m[i - 1];
  }
}

void ElasticRod::bend(double angle_rad) {
  if (angle_rad == bend_rad_) return;
  bend_rad_ = angle_rad;
  setSections();
}

void ElasticRod::move(const RodMotion& motion) {
  const double in_m = std::max(motion.inserted_m, kMinInserted_m - inserted_m_);
  const int steps = std::max(
      1, static_cast<int>(
             std::ceil(std::max(std::abs(in_m) / kMaxStep_m, std::abs(motion.rolled_rad) / kMaxStep_rad) - 1e-9)));
  effort_.iterations = 0;
  for (int k = 0; k < steps; ++k) step({in_m / steps, motion.rolled_rad / steps});
}

void ElasticRod::step(const RodMotion& motion) {
  inserted_m_ += motion.inserted_m;
  body_.lengths_m[1] += motion.inserted_m;
  while (fitPoints()) {
  }
  shape_.turned.setZero();
  from_ = shape_.points;
  sliding_ = pressed();  // By the wall's forces as they were, until new ones are known.
  shape_ = rolled(shape_, motion.rolled_rad);
  slideBy(motion.inserted_m);
  rest();
}

// Where the rod would be if it only followed itself.
void ElasticRod::slideBy(double inserted_m) {
  Eigen::VectorXd way = Eigen::VectorXd::Zero(shape_.freedoms());
  for (Eigen::Index i = 2; i < shape_.size(); ++i) {
    const Eigen::Index j = i + 1 < shape_.size() && inserted_m > 0 ? i : i - 1;
    way.segment<3>(RodShape::placeOf(i)) = inserted_m * shape_.edge(j).normalized();
  }
  shape_ = moved(shape_, way);
}

// One more point behind the held ones when the first edge has grown long, or one less when it has shrunk; whether there
// was one. A step of the drive may be longer than an edge.
bool ElasticRod::fitPoints() {
  const Eigen::Index n = shape_.size();
  const double from_tip_m = inserted_m_ - body_.lengths_m[1];  // Of the second end of the first edge.
  const double space_m = spacingAt(settings_, from_tip_m);
  Eigen::Index more = 0;
  if (body_.lengths_m[1] > kLongest * space_m) more = 1;
  if (n > 4 && body_.lengths_m[1] < kShortest * body_.lengths_m[2]) more = -1;
  if (more == 0) return false;
  const RodShape old = shape_;
  const Eigen::VectorXd lengths = body_.lengths_m;
  const std::vector<int> tubes = tubes_;
  const Eigen::Index m = n + more, kept = n - (more > 0 ? 2 : 3);  // Points at the end that stay as they are.
  shape_.points.resize(3, m);
  shape_.directors.resize(3, m - 1);
  shape_.twists.resize(m);
  shape_.turned = Eigen::VectorXd::Zero(m - 1);
  body_.lengths_m.resize(m - 1);
  tubes_.resize(static_cast<std::size_t>(m));
  shape_.points << old.points.leftCols<2>(), Eigen::Matrix3Xd(3, m - 2 - kept), old.points.rightCols(kept);
  shape_.twists << old.twists.head<2>(), Eigen::VectorXd::Zero(m - 2 - kept), old.twists.tail(kept);
  shape_.directors.leftCols<2>() = old.directors.leftCols<2>();
  shape_.directors.rightCols(kept - 1) = old.directors.rightCols(kept - 1);
  body_.lengths_m.head<2>() = lengths.head<2>();
  body_.lengths_m.tail(kept - 1) = lengths.tail(kept - 1);
  std::copy(tubes.end() - kept, tubes.end(), tubes_.end() - kept);
  if (more > 0) {
    const double share = 1 - space_m / lengths[1];
    shape_.points.col(2) = (1 - share) * old.points.col(1) + share * old.points.col(2);
    shape_.directors.col(2) = old.directors.col(1);
    body_.lengths_m[1] = lengths[1] - space_m;
    body_.lengths_m[2] = space_m;
    tubes_[2] = lumen_.gapNear(tubes[2], shape_.points.col(2), settings_.radius_m).tube;
  } else {
    // The first edge now ends where the second did, and has its frame. Both twists are between the held frame and that.
    body_.lengths_m[1] = lengths[1] + lengths[2];
    const Eigen::Vector3d along = shape_.edge(1).normalized();
    const Eigen::Vector3d director = carried(old.directors.col(2), old.edge(2).normalized(), along);
    shape_.directors.col(1) = (director - director.dot(along) * along).normalized();
    shape_.twists[1] = old.twists[1] + old.twists[2];
  }
  setSections();
  shape_ = rolled(shape_, 0);  // Brings the twists up to date.
  return true;
}

}  // namespace angio::rod
