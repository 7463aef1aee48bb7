// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/case_run.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "angio/base/stopwatch.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/displacement_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/perception/gated_perception.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/perception/registration_gate.hpp"
#include "angio/results/case_row.hpp"

namespace angio::results {
namespace {

// Where a case set does not say it. Fluoroscopy runs at 15 frames a second, which who follows a motion goes by. A
// catheter's frames may be picked from a run: between two of them a hand may have pushed it by centimetres.
constexpr double kFramePeriod_s = 1.0 / 15, kPickedPeriod_s = 0.5;

// A task may be asked for any place of the tree: so many of them must be known well enough.
constexpr double kMinUsableShare = 0.95;
// Each asks for a covariance, and that of a deformed fit solves a system of up to 400 unknowns.
constexpr Eigen::Index kPlaces = 60;

// A case's initial pose is what joints and calibration say: as good as a camera's place in a patient frame that is the
// model's by calibration.
CameraPlace placeOf(const Case& one, std::size_t frame, double period_s) {
  return {std::llround(1e6 * static_cast<double>(frame) * period_s), one.initial_pose};
}

GatedPerception trackerOf(const CaseRunSettings& settings, const VesselTree& tree) {
  GatedPerceptionSettings tracked;
  tracked.perception.search = tracked.perception.tracking = settings.registration;
  tracked.perception.search_starts = settings.starts;
  tracked.perception.tracker = settings.tracker;
  tracked.perception.by_catheter = std::holds_alternative<OrientedKernelSettings>(settings.registration);
  tracked.perception.catheter_rounds_at_once = 0;  // No machine waits for the next frame.
  return GatedPerception(tracked, tree);
}

// Empty where it is not needed, or there is none.
cv::Mat imageOf(const View& view, bool needed) {
  if (!view.image_path || (view.centerline_path && !needed)) return {};
  return readXrayImage(*view.image_path, view.camera);
}

Centerline2d seenIn(const View& view, const cv::Mat& image, CenterlineExtractor& extractor, CaseOutcome& outcome) {
  if (view.centerline_path) return readCenterline(*view.centerline_path);
  const Stopwatch stage;
  Centerline2d centerline = vesselsToMatch(extractor.extract(image));
  outcome.image_s += stage.seconds();
  return centerline;
}

// Nothing where a result has no covariance.
std::optional<PatientObservation> claimedBy(const RegistrationResult& result) {
  if (!result.covariance || !result.covariance->allFinite()) return std::nullopt;
  return PatientObservation{result.T_camera_model, *result.covariance, result.points};
}

void addUses(const VesselTree& tree, CaseOutcome& outcome) {
  outcome.usable_for.clear();
  const auto seen = claimedBy(outcome.result);
  if (!seen || outcome.result.status != RegistrationStatus::kConverged) return;
  const double enough_m = 1e-3 * RegistrationGateSettings().max_target_std_mm;
  const Eigen::Matrix3Xd& points = tree.points();
  double places = 0, across = 0, everywhere = 0;
  const Eigen::Index stride = std::max<Eigen::Index>(1, points.cols() / kPlaces);
  for (Eigen::Index i = stride / 2; i < points.cols(); i += stride, ++places) {
    across += seen->worstStdAcross_m(points.col(i)) <= enough_m;
    everywhere += seen->worstStd_m(points.col(i)) <= enough_m;
  }
  if (across >= kMinUsableShare * places) outcome.usable_for.push_back("centre");
  if (everywhere >= kMinUsableShare * places) outcome.usable_for.push_back("view");
  if (across >= kMinUsableShare * places) outcome.usable_for.push_back("navigate");
}

void addIntervals(const VesselTree& tree, CaseOutcome& outcome) {
  outcome.interval_90.reset();
  const auto seen = claimedBy(outcome.result);
  if (!seen) return;
  double places = 0, across_m2 = 0, depth_m2 = 0;
  const Eigen::Index stride = std::max<Eigen::Index>(1, tree.points().cols() / kPlaces);
  for (Eigen::Index i = stride / 2; i < tree.points().cols(); i += stride, ++places) {
    const Eigen::Vector3d p = tree.points().col(i), ray = seen->placeAt(p).normalized();
    const Eigen::Matrix3d C = seen->centralCovariance(p);
    const double along_m2 = ray.dot(C * ray);
    depth_m2 += std::max(0.0, along_m2);
    across_m2 += std::max(0.0, 0.5 * (C.trace() - along_m2));
  }
  outcome.interval_90 = {kInterval90 * std::sqrt(across_m2 / places), kInterval90 * std::sqrt(depth_m2 / places)};
}

void addPointCovariances(const VesselTree& tree, CaseOutcome& outcome) {
  outcome.point_covariances_m2.clear();
  outcome.point_central_covariances_m2.clear();
  const auto seen = claimedBy(outcome.result);
  if (!seen) return;
  for (const auto& point : tree.points().colwise()) {
    outcome.point_covariances_m2.push_back(seen->pointCovariance(point));
    outcome.point_central_covariances_m2.push_back(seen->centralCovariance(point));
  }
}

// Runs the cases of a set, one after another.
class CaseRunner {
 public:
  CaseRunner(const CaseSet& set, const CaseRunSettings& settings)
      : set_(set), settings_(settings), extractor_(makeExtractor(settings.extractor)) {}

  // Until an interruption.
  std::vector<CaseOutcome> all(const Progress& progress) {
    std::vector<CaseOutcome> outcomes;
    const InterruptionGuard guard;
    for (const auto& one : set_.cases) {
      if (interrupted()) break;
      outcomes.push_back(run(one, static_cast<int>(outcomes.size())));
      if (progress) progress(static_cast<int>(outcomes.size()));
    }
    if (interrupted() && outcomes.empty()) throw Interrupted();
    return outcomes;
  }

  // `frame` counts those of a sequence.
  CaseOutcome run(const Case& one, int frame);

 private:
  // Registers a sequence's frame; returns where it was expected.
  Pose track(const Case& one, int frame, const XrayViews& views, const Registration& registration,
             CaseOutcome& outcome);

  const CaseSet& set_;
  const CaseRunSettings& settings_;
  std::map<std::string, std::unique_ptr<Registration>> registrations_;  // By their trees' files, which cases share.
  std::unique_ptr<CenterlineExtractor> extractor_;
  std::map<const Registration*, GatedPerception> trackers_;  // Of a sequence, one for each tree.
};

Pose CaseRunner::track(const Case& one, int frame, const XrayViews& views, const Registration& registration,
                       CaseOutcome& outcome) {
  const VesselTree& tree = registration.tree();
  auto found = trackers_.find(&registration);
  if (found == trackers_.end()) found = trackers_.emplace(&registration, trackerOf(settings_, tree)).first;
  GatedPerception& tracker = found->second;
  const double period_s =
      set_.frame_period_s.value_or(settings_.tracker.follow_motion ? kFramePeriod_s : kPickedPeriod_s);
  GatedObservation seen = tracker.observe(views, placeOf(one, static_cast<std::size_t>(frame), period_s));
  tracker.learn();
  outcome.by_catheter = seen.by_catheter.has_value();
  outcome.result = std::move(outcome.by_catheter ? seen.by_catheter->result : seen.observation.registration);
  // Of the whole tree a catheter does not say where it is, which is for tasks to ask: see usable_for.
  outcome.rejection = outcome.by_catheter ? seen.by_catheter->rejection : seen.rejection;
  outcome.followed = !outcome.rejection;
  const VesselTree& vessels = outcome.by_catheter ? seen.by_catheter->vessels : tree;
  addUses(vessels, outcome);
  addIntervals(vessels, outcome);
  if (settings_.point_covariance) addPointCovariances(tree, outcome);
  return seen.observation.predicted.T_camera_model;
}

CaseOutcome CaseRunner::run(const Case& one, int frame) {
  auto& registration = registrations_[one.tree_path];
  if (!registration) registration = makeRegistration(settings_.registration, readVesselTree(one.tree_path));
  const VesselTree& tree = registration->tree();
  const XrayCamera& camera = one.views.front().camera;
  CaseOutcome outcome;
  outcome.name = one.name;
  std::vector<cv::Mat> images;
  std::vector<Centerline2d> centerlines;
  for (const View& view : one.views) {
    images.push_back(imageOf(view, imageNeeded(settings_.registration)));
    centerlines.push_back(seenIn(view, images.back(), *extractor_, outcome));
  }
  XrayViews views;
  for (std::size_t v = 0; v < one.views.size(); ++v) {
    const View& view = one.views[v];
    views.push_back(
        {centerlines[v], view.camera, view.T_view_first, view.collimator_px, images[v].empty() ? nullptr : &images[v]});
  }
  PosePrior prior;
  prior.T_camera_model = one.initial_pose;
  if (set_.sequence) {
    prior.T_camera_model = track(one, frame, views, *registration, outcome);
  } else {
    outcome.result = registration->search(views, prior, settings_.starts);
    addClaims(tree, settings_.point_covariance, outcome);
  }
  if (settings_.displacements && outcome.result.displacements_m.cols() == 0) {
    outcome.result.displacements_m.setZero(3, tree.size());
  }
  outcome.pixel_at_isocenter_m = (outcome.result.T_camera_model * tree.centroid()).z() / camera.parameters().fx_px;
  if (one.truth_pose) {
    const PlacedTree truth{*one.truth_pose, one.truth_displacements_path
                                                ? readDisplacements(*one.truth_displacements_path, tree.size())
                                                : Eigen::Matrix3Xd()};
    outcome.start_error = poseError(tree, camera, {prior.T_camera_model, {}}, truth);
    outcome.error = poseError(tree, camera, {outcome.result.T_camera_model, outcome.result.displacements_m}, truth);
  }
  return outcome;
}

}  // namespace

PatientTrackerSettings trackerOfCases() {
  const OrientedKernelSettings believed;
  PatientTrackerSettings tracker;
  tracker.calibration_rotation_std_deg = believed.prior_rotation_std_deg;
  tracker.calibration_translation_std_mm = believed.prior_translation_std_mm;
  return tracker;
}

void addClaims(const VesselTree& tree, bool of_each_point, CaseOutcome& outcome) {
  addUses(tree, outcome);
  addIntervals(tree, outcome);
  if (of_each_point) addPointCovariances(tree, outcome);
}

std::vector<CaseOutcome> runCases(const CaseSet& set, const CaseRunSettings& settings, const Progress& progress) {
  if (!settings.campaign) return CaseRunner(set, settings).all(progress);
  constexpr int kThreads = 1;  // Times of one run can be compared.
  if (set.sequence) {          // Each frame starts from what those before it have shown.
    const auto whole = recordsOf(
        settings.campaign, 1, kThreads, [](int) { return std::string("sequence"); },
        [&](int) { return CaseRunner(set, settings).all(progress); });
    return whole.empty() ? std::vector<CaseOutcome>() : whole.front();
  }
  CaseRunner runner(set, settings);
  const auto caseOf = [&](int k) -> const Case& { return set.cases[static_cast<std::size_t>(k)]; };
  return recordsOf(
      settings.campaign, static_cast<int>(set.cases.size()), kThreads, [&](int k) { return "case " + caseOf(k).name; },
      [&](int k) { return runner.run(caseOf(k), k); }, progress);
}

}  // namespace angio::results
