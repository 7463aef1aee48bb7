// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry_problem.hpp"

#include <algorithm>
#include <random>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "information.hpp"

namespace angio::calibration {
namespace {

constexpr std::size_t kMinPositions = 6;
constexpr double kMinPrimaryRange_rad = degToRad(20);
constexpr double kSmallRange_rad = degToRad(10), kSmallRange_m = 10e-3;

// Positions closer than this are one.
bool samePosition(const CArmJoints& a, const CArmJoints& b) {
  const CArmJoints d = a - b;
  return d.head<2>().norm() < degToRad(0.5) && d.tail<3>().norm() < 5e-3;
}

double rangeOf(const std::vector<ViewObservation>& views, int joint) {
  double low = views[0].joints[joint], high = low;
  for (const auto& view : views) {
    if (view.held_out) continue;
    low = std::min(low, view.joints[joint]);
    high = std::max(high, view.joints[joint]);
  }
  return high - low;
}

// Known worse than this, an arm's number is not worth having.
double limitOf(int parameter) {
  const double unit = kCArmPoseParameterNames[parameter].unit;
  return unit == 1 ? 0.02 : unit == 1e-3 ? 5e-3 : degToRad(0.5);
}

// The table's joint that a number is about; -1: none's. The primary offset is counted from the table's x.
int tableJointOf(int parameter) {
  if (parameter == kPrimaryOffsetParameter) return 0;
  if (parameter < kFirstTableParameter) return -1;
  return parameter < kFirstTableParameter + 2 ? 0 : parameter < kFirstTableParameter + 5 ? 1 : 2;
}

}  // namespace

void requirePositions(const std::string& place, const std::vector<CArmJoints>& positions) {
  std::vector<CArmJoints> different;
  double low = kPi, high = -kPi;
  for (const CArmJoints& joints : positions) {
    low = std::min(low, joints[0]);
    high = std::max(high, joints[0]);
    if (std::none_of(different.begin(), different.end(),
                     [&](const CArmJoints& other) { return samePosition(joints, other); })) {
      different.push_back(joints);
    }
  }
  if (different.size() < kMinPositions) {
    throw InputError(place, "views", formatted("%zu at %zu different positions", positions.size(), different.size()),
                     "there must be at least 6 positions that differ by 0.5 deg or 5 mm: neither axis can be known");
  }
  if (high - low < kMinPrimaryRange_rad) {
    throw InputError(place, "primary_deg", formatted("from %.3g to %.3g", radToDeg(low), radToDeg(high)),
                     "must span at least 20 deg: the primary axis, and with it the isocentre, cannot be known");
  }
}

std::vector<std::string> freeObservable(GeometryProblem& problem, const GeometryModel& start, bool refines_camera) {
  const auto& views = problem.views();
  std::fill(problem.free.begin(), problem.free.end(), false);
  std::fill_n(problem.free.begin(), kFirstCameraNumber, true);
  if (refines_camera) {
    // The principal point's slope needs different distances.
    const auto [near, far] = std::minmax_element(views.begin(), views.end(), [](const auto& a, const auto& b) {
      return a.source_detector_distance_m < b.source_detector_distance_m;
    });
    const bool zooms = far->source_detector_distance_m - near->source_detector_distance_m > kSmallRange_m;
    std::fill_n(problem.free.begin() + kFirstCameraNumber, zooms ? kCameraNumbers : kCameraNumbers - 2, true);
  }
  std::vector<std::string> kept;
  for (int joint = 0; joint < 3; ++joint) {
    const double range_m = rangeOf(views, 2 + joint);
    if (range_m >= kSmallRange_m) continue;
    std::vector<std::string> names;
    for (int k = 0; k < kCArmPoseParameters; ++k) {
      if (tableJointOf(k) != joint) continue;
      problem.free[kFirstArmNumber + k] = false;
      names.emplace_back(kCArmPoseParameterNames[k].name);
    }
    kept.push_back(joined(names) +
                   formatted(": kept, as the table's %c moves by only %.3g mm", "xyz"[joint], 1e3 * range_m));
  }

  // Standard deviations before solving: by the positions alone.
  const Eigen::VectorXd sigmas = covarianceOf(problem.information(start)).diagonal().cwiseSqrt();
  const std::vector<int> places = problem.freePlaces();
  const double secondary_deg = radToDeg(rangeOf(views, 1));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const int k = places[i] - kFirstArmNumber;
    if (k < 0 || k >= kCArmPoseParameters || sigmas[i] < limitOf(k)) continue;
    const CArmParameter& parameter = kCArmPoseParameterNames[k];
    kept.push_back(formatted("%s stays near the ideal arm's: views at these positions tell it to %.2g only%s",
                             parameter.name, sigmas[i] / parameter.unit,
                             secondary_deg < radToDeg(kSmallRange_rad)
                                 ? formatted(", as the secondary angle spans %.3g deg", secondary_deg).c_str()
                                 : ""));
  }
  return kept;
}

namespace {

constexpr int kDraws = 80;
constexpr std::size_t kViewsOfADraw = 5;
constexpr double kAgrees = 3;  // Standard deviations of a wide scatter.

bool isArm(const CArmGeometry& carm) {
  try {
    carm.check();
    return true;
  } catch (const InputError&) {
    return false;
  }
}

// With an arm whose axes are turned about, angles of the wrong sign agree as well: none agree with what is no arm.
std::vector<bool> agreeing(const GeometryProblem& problem, const GeometryModel& model, const std::vector<bool>& among) {
  std::vector<bool> agree(among.size(), false);
  if (!isArm(model.carm)) return agree;
  for (std::size_t i = 0; i < among.size(); ++i) {
    agree[i] = among[i] && problem.surprise(problem.views()[i], model) < kAgrees;
  }
  return agree;
}

auto countOf(const std::vector<bool>& set) { return std::count(set.begin(), set.end(), true); }

// The largest set of views, among some, that one C-arm explains.
std::vector<bool> consensus(GeometryProblem problem, const GeometryModel& start, const std::vector<bool>& among) {
  std::vector<std::size_t> candidates;
  for (std::size_t i = 0; i < among.size(); ++i) {
    if (among[i]) candidates.push_back(i);
  }
  std::vector<bool> best(among.size(), false);
  if (candidates.size() < kViewsOfADraw) return best;
  std::mt19937 engine(1);
  for (int draw = 0; draw < kDraws; ++draw) {
    problem.used.assign(among.size(), false);
    for (std::size_t k = 0; k < kViewsOfADraw; ++k) problem.used[candidates[engine() % candidates.size()]] = true;
    const std::vector<bool> first = agreeing(problem, problem.solve(start, GeometryProblem::Loss::kSquared), among);
    if (countOf(first) <= countOf(best)) continue;
    problem.used = first;  // All that agree have a better say.
    const std::vector<bool> second = agreeing(problem, problem.solve(start, GeometryProblem::Loss::kCauchy), among);
    best = countOf(second) > countOf(first) ? second : first;
    if (countOf(best) == countOf(among)) break;
  }
  return best;
}

std::string namesOfViews(const std::vector<ViewObservation>& views, const std::vector<bool>& chosen) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (chosen[i]) names.push_back(views[i].name);
  }
  return joined(names, 6);
}

}  // namespace

void requireOneMachine(const std::string& place, const GeometryProblem& problem, const GeometryModel& start,
                       const PoseScatter& scatter) {
  GeometryProblem wide = problem;
  wide.scatter.translation_m = scatter.translation_m;
  wide.scatter.rotation_rad = scatter.rotation_rad;
  std::vector<bool> all(problem.views().size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = !problem.views()[i].held_out;
  const std::vector<bool> first = consensus(wide, start, all);
  std::vector<bool> rest = all;
  for (std::size_t i = 0; i < all.size(); ++i) rest[i] = all[i] && !first[i];
  const std::vector<bool> second = consensus(wide, start, rest);
  const auto views = countOf(all);
  if (4 * countOf(second) >= views) {
    throw InputError(
        place, "views", namesOfViews(problem.views(), second),
        formatted("%d of %d views fit one another but not the other %d: they are of another C-arm, or what "
                  "they show has moved",
                  static_cast<int>(countOf(second)), static_cast<int>(views), static_cast<int>(countOf(first))));
  }
  if (3 * countOf(first) < 2 * views) {
    throw InputError(place, "joints",
                     formatted("%d of %d views agree", static_cast<int>(countOf(first)), static_cast<int>(views)),
                     "no C-arm explains the others: angles of another sign or unit, table positions in other units, or "
                     "a phantom or patient that moved");
  }
}

}  // namespace angio::calibration
