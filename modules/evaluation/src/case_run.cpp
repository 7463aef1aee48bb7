// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/case_run.hpp"

#include <map>
#include <memory>

#include "angio/base/stopwatch.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/displacement_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"

namespace angio {
namespace {

// Trees and what depends on them only, shared by the cases that name the same file.
class Registrations {
 public:
  explicit Registrations(const RegistrationSettings& settings) : settings_(settings) {}

  Registration& of(const std::string& tree_path) {
    auto& entry = by_path_[tree_path];
    if (!entry) entry = makeRegistration(settings_, readVesselTree(tree_path));
    return *entry;
  }

 private:
  RegistrationSettings settings_;
  std::map<std::string, std::unique_ptr<Registration>> by_path_;
};

Centerline2d seenIn(const View& view, CenterlineExtractor& extractor, CaseOutcome& outcome) {
  if (view.centerline_path) return readCenterline(*view.centerline_path);
  const cv::Mat image = readXrayImage(*view.image_path, view.camera);
  const Stopwatch stage;
  Centerline2d centerline = extractor.extract(image);
  outcome.image_s = stage.seconds();
  return centerline;
}

}  // namespace

std::vector<CaseOutcome> runCases(const CaseSet& set, const CaseRunSettings& settings, const CaseProgress& progress) {
  Registrations registrations(settings.registration);
  const auto extractor = makeExtractor(settings.extractor);
  std::vector<CaseOutcome> outcomes;
  std::optional<Pose> last_converged;
  for (const auto& one : set.cases) {
    Registration& registration = registrations.of(one.tree_path);
    const VesselTree& tree = registration.tree();
    const View& view = one.views.front();
    CaseOutcome outcome;
    outcome.name = one.name;
    const Centerline2d centerline = seenIn(view, *extractor, outcome);
    PosePrior prior;
    prior.T_camera_model = set.sequence && last_converged ? *last_converged : one.initial_pose;
    outcome.result = registration.search(centerline, view.camera, prior, settings.starts);
    outcome.pixel_at_isocentre_m =
        (outcome.result.T_camera_model * tree.centroid()).z() / view.camera.parameters().fx_px;
    if (one.truth_pose) {
      const PlacedTree truth{*one.truth_pose, one.truth_displacements_path
                                                  ? readDisplacements(*one.truth_displacements_path, tree.size())
                                                  : Eigen::Matrix3Xd()};
      outcome.start_error = poseError(tree, view.camera, {prior.T_camera_model, {}}, truth);
      outcome.error =
          poseError(tree, view.camera, {outcome.result.T_camera_model, outcome.result.displacements_m}, truth);
    }
    if (outcome.result.status == RegistrationStatus::kConverged) last_converged = outcome.result.T_camera_model;
    outcomes.push_back(std::move(outcome));
    if (progress) progress(static_cast<int>(outcomes.size()));
  }
  return outcomes;
}

}  // namespace angio
