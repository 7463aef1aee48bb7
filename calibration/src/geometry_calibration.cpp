// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/geometry_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/results/statistics.hpp"
#include "geometry_problem.hpp"

namespace angio::calibration {
namespace {

// An arm that scatters more than this by itself, or whose registered poses do, is none: then views of several machines
// are looked for.
constexpr PoseScatter kWidestBeads{1.5e-3, degToRad(0.15), 0, 0}, kWidestPoses{2e-3, degToRad(0.3), 0, 0};

GeometryModel priorModel(const GeometryCamera& camera, const GeometrySettings& settings) {
  GeometryModel model;
  CArmGeometry& carm = model.carm;
  carm.image_width_px = camera.width_px;
  carm.image_height_px = camera.height_px;
  carm.pixel_spacing_m = *camera.pixel_spacing_m;
  carm.source_isocenter_distance_m = settings.source_isocenter_distance_mm * 1e-3;
  carm.source_detector_distance_m = *camera.source_detector_distance_m;
  CArmDeviations& d = carm.deviations;
  d.source_detector_offset_m = camera.fx_px * carm.pixel_spacing_m - carm.source_detector_distance_m;
  d.pixel_aspect = camera.fy_px / camera.fx_px - 1;
  d.principal_point_px = {camera.cx_px - 0.5 * (camera.width_px - 1), camera.cy_px - 0.5 * (camera.height_px - 1)};
  d.principal_point_slope_px_per_m = camera.principal_point_slope_px_per_m;
  return model;
}

// Each view alone says where the phantom lies; the start is the one that the others are nearest to.
Pose phantomStart(const std::vector<ViewObservation>& views, const CArmGeometry& carm, const Eigen::Vector3d& middle) {
  std::vector<Pose> says;
  for (const auto& view : views) {
    if (!view.held_out) says.push_back(carm.T_camera_patient(view.joints).inverse() * view.T_camera_phantom);
  }
  std::vector<double> far(says.size());
  for (std::size_t i = 0; i < says.size(); ++i) {
    std::vector<double> distances;
    for (const Pose& other : says) {
      distances.push_back((says[i] * middle - other * middle).norm() +
                          0.1 * rotationAngle(says[i].linear().transpose() * other.linear()));
    }
    far[i] = percentile(distances, 0.5);
  }
  return says[std::min_element(far.begin(), far.end()) - far.begin()];
}

double pooledSigma_px(const std::vector<ViewObservation>& views) {
  double sum = 0, freedom = 0;
  for (const auto& view : views) {
    if (view.held_out) continue;
    sum += view.unexplained_px2;
    freedom += 2 * view.beads - kViewChanges;
  }
  return std::max(std::sqrt(sum / freedom), 1e-3);
}

// Which views count: those that are not much worse than the usual one.
std::vector<bool> soundViews(const GeometryProblem& problem, const GeometryModel& model, double factor) {
  const auto& views = problem.views();
  std::vector<double> surprises;
  for (const auto& view : views) {
    if (!view.held_out) surprises.push_back(problem.surprise(view, model));
  }
  const double limit = factor * std::max(percentile(surprises, 0.5), 0.1);
  std::vector<bool> sound(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    sound[i] = !views[i].held_out && problem.surprise(views[i], model) < limit;
  }
  return sound;
}

// Solves robustly, leaves out what that left out, and finds what joints do not explain.
GeometryModel refined(GeometryProblem& problem, const GeometryModel& start, const GeometrySettings& settings) {
  std::vector<bool> all(problem.views().size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = !problem.views()[i].held_out;
  problem.used = all;
  GeometryModel model = problem.solve(start, GeometryProblem::Loss::kCauchy);
  for (int round = 0; round < 4; ++round) {
    problem.used = soundViews(problem, model, settings.outlier_view_factor);
    const PoseScatter before = problem.scatter;
    problem.scatter = problem.likeliestScatter(model, round == 0 ? 4 : 1.5);
    model = problem.solve(model, GeometryProblem::Loss::kSquared);
    const double change = std::abs(std::log(problem.scatter.translation_m / before.translation_m)) +
                          std::abs(std::log(problem.scatter.rotation_rad / before.rotation_rad));
    if (change < 0.1) break;
  }
  return model;
}

void requireCamera(const std::string& place, const GeometryCamera& camera) {
  requirePositive(place, "pixel_spacing_mm", camera.pixel_spacing_m.value_or(0) * 1e3);
  requirePositive(place, "source_detector_distance_mm", camera.source_detector_distance_m.value_or(0) * 1e3);
  requirePositive(place, "fx_px", camera.fx_px);
  requirePositive(place, "fy_px", camera.fy_px);
  const double offset_mm = 1e3 * (camera.fx_px * *camera.pixel_spacing_m - *camera.source_detector_distance_m);
  if (std::abs(offset_mm) > 200) {
    throw InputError(
        place, "fx_px", formatValue(camera.fx_px),
        formatted("makes the source-detector distance %.4g mm more than the encoder's: pixel_spacing_mm or "
                  "the camera is another one's",
                  offset_mm));
  }
}

// Residual of each sixth of the views by an arm from the other five.
double foldedRms(GeometryProblem problem, const GeometryModel& model) {
  constexpr std::size_t kFolds = 6;
  const std::vector<bool> all = problem.used;
  double sum = 0, views = 0;
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    std::vector<bool> left_out(all.size(), false);
    for (std::size_t i = fold; i < all.size(); i += kFolds) {
      left_out[i] = all[i];
      problem.used[i] = false;
    }
    const GeometryModel other = problem.solve(model, GeometryProblem::Loss::kSquared);
    const auto count = static_cast<double>(std::count(left_out.begin(), left_out.end(), true));
    sum += count * std::pow(problem.residualRms(other, left_out), 2);
    views += count;
    problem.used = all;
  }
  return std::sqrt(sum / views);
}

template <typename View>
std::vector<CArmJoints> positionsOf(const std::vector<View>& views) {
  std::vector<CArmJoints> positions;
  for (const auto& view : views) {
    if (!view.held_out) positions.push_back(view.joints);
  }
  return positions;
}

// Views condensed again about the camera as it is now known.
using Condense = std::function<std::vector<ViewObservation>(const CArmGeometry&)>;

GeometryCalibration solved(const std::string& place, GeometryProblem problem, const GeometryModel& start,
                           bool refines_camera, const Condense& condensed, const GeometrySettings& settings) {
  GeometryCalibration result;
  result.kept = freeObservable(problem, start, refines_camera);
  GeometryModel model = refined(problem, start, settings);
  const std::size_t views = problem.views().size();
  const auto left_out = positionsOf(problem.views()).size() -
                        static_cast<std::size_t>(std::count(problem.used.begin(), problem.used.end(), true));
  const PoseScatter& widest = problem.registered() ? kWidestPoses : kWidestBeads;
  constexpr double kDoubtful = 4.0 / 3;
  if (problem.scatter.translation_m > kDoubtful * widest.translation_m ||
      problem.scatter.rotation_rad > kDoubtful * widest.rotation_rad || 4 * left_out >= views) {
    requireOneMachine(place, problem, start, widest);
  }
  if (condensed) {
    // A wrong camera's second order is larger than what many views average to.
    problem.replace(condensed(model.carm));
    model = refined(problem, model, settings);
  }
  result.rms_without_flex = problem.residualRms(model, problem.used);
  if (settings.flex == FlexModel::kLowOrder) {
    model.carm.deviations.flex = CArmFlex::lowOrder();
    std::fill_n(problem.free.begin() + kFirstFlexNumber, kFlexNumbers, true);
    model = refined(problem, model, settings);
  }
  try {
    model.carm.check();
  } catch (const InputError& error) {
    throw error.within(place);
  }
  result.carm = model.carm;
  result.T_patient_phantom = model.T_patient_phantom;
  result.pose_scatter_m = problem.scatter.translation_m;
  result.pose_scatter_rad = problem.scatter.rotation_rad;
  result.record = geometryRecord(problem, model);
  if (problem.registered()) result.record.held_out_rms = foldedRms(problem, model);
  result.views = geometryFits(problem, model);
  result.doubts = geometryDoubts(problem);
  return result;
}

// The isocentre in the model, as most poses have it with an ideal arm.
Eigen::Vector3d middleOf(const std::vector<ViewObservation>& views, const CArmGeometry& carm) {
  Eigen::Vector3d middle;
  for (Eigen::Index k = 0; k < 3; ++k) {
    std::vector<double> says;
    for (const auto& view : views) {
      says.push_back(
          (view.T_camera_phantom.inverse() * (carm.source_isocenter_distance_m * Eigen::Vector3d::UnitZ()))[k]);
    }
    middle[k] = percentile(says, 0.5);
  }
  return middle;
}

}  // namespace

GeometryCalibration calibrateGeometry(const std::string& place, const BeadPhantom& phantom,
                                      const GeometryCamera& camera, const std::vector<BeadView>& given,
                                      const GeometrySettings& settings) {
  checkSettings("geometry", settings);
  requireCamera(place, camera);
  std::vector<BeadView> views = given;
  for (BeadView& view : views) {
    if (!view.source_detector_distance_m) view.source_detector_distance_m = camera.source_detector_distance_m;
  }
  requirePositions(place, positionsOf(views));
  GeometryModel start = priorModel(camera, settings);
  const Condense condensed = [&](const CArmGeometry& carm) {
    std::vector<ViewObservation> seen;
    for (const auto& view : views) {
      const XrayCamera at_distance = carm.camera(*view.source_detector_distance_m);
      seen.push_back(observeView(place, phantom, at_distance, view, settings.outlier_std));
    }
    return seen;
  };
  const std::vector<ViewObservation> seen = condensed(start.carm);
  requireSoundBeads(place, phantom, views, seen);
  start.T_patient_phantom = phantomStart(seen, start.carm, phantom.center_m());
  const double bead_std_px = pooledSigma_px(seen);
  GeometryCalibration result =
      solved(place, GeometryProblem(seen, start, camera, settings, phantom.center_m(), bead_std_px), start,
             camera.covariance.has_value(), condensed, settings);
  result.bead_std_px = bead_std_px;
  return result;
}

GeometryCalibration calibrateGeometry(const PoseSet& set, const GeometryCamera& camera,
                                      const GeometrySettings& settings) {
  checkSettings("geometry", settings);
  requireCamera(set.path, camera);
  checkPoseSet(set);
  std::vector<ViewObservation> seen;
  for (const HandEyePose& pose : set.poses) {
    if (!pose.joints) {
      throw InputError(set.path, pose.name + ".primary_deg", "", "is missing: the geometry needs every pose's angles");
    }
    seen.push_back(observePose(pose, set.camera_std));
    seen.back().source_detector_distance_m = *camera.source_detector_distance_m;
  }
  requirePositions(set.path, positionsOf(seen));
  GeometryModel start = priorModel(camera, settings);
  const Eigen::Vector3d middle = middleOf(seen, start.carm);
  start.T_patient_phantom = phantomStart(seen, start.carm, middle);
  GeometryCalibration result = solved(set.path, GeometryProblem(seen, start, camera, settings, middle, std::nullopt),
                                      start, false, nullptr, settings);
  result.kept.insert(result.kept.begin(),
                     "the camera (source_detector_offset_mm, pixel_aspect, principal point) is kept: poses do not tell "
                     "of it");
  return result;
}

GeometryCalibration calibrateGeometry(const GeometryInput& input, const GeometrySettings& settings) {
  if (input.poses) return calibrateGeometry(*input.poses, input.camera, settings);
  return calibrateGeometry(input.path, input.phantom, input.camera, input.views, settings);
}

}  // namespace angio::calibration
