// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <memory>

#include "angio/evaluation/extraction_run.hpp"
#include "angio/simulation/device.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "simulation_image.hpp"

namespace angio::evaluation {
namespace {

// A frame is taken at any time from before an injection of two seconds until most of it has been washed out.
constexpr double kLast_s = 5;
// Devices reach so far into the tree, and go for one of so many of its ends.
constexpr double kMinInserted_mm = 40, kMaxInserted_mm = 250;
constexpr int kEnds = 12;
// Numbers for the noise of a run's frames.
constexpr int kFrames = 10000;

// What of a frame can be seen: a device hides in a vessel that absorbs more than it does.
Centerline2d shownOf(const Centerline2d& truth) {
  const Centerline2d vessels = ofKind(truth, CurveKind::kVessel);
  const auto hides = [&](int device) {
    for (int i = 0; i < vessels.size(); ++i) {
      const double apart_px = (vessels.points_px.col(i) - truth.points_px.col(device)).norm();
      if (apart_px <= vessels.radius_px[i] && vessels.contrast[i] >= truth.contrast[device]) return true;
    }
    return false;
  };
  std::vector<bool> shown;
  for (int i = 0; i < truth.size(); ++i) shown.push_back(truth.kind[i] == CurveKind::kVessel || !hides(i));
  return pointsWhere(truth, shown);
}

}  // namespace

ExtractionSamples deviceSamples(const std::vector<VesselTree>& trees, const std::optional<XrayCamera>& camera,
                                const SimulationSettings& settings, const DeviceRuns& runs) {
  const auto one = [=](int i) {
    const VesselTree& tree = trees[static_cast<std::size_t>(i) % trees.size()];
    const SimulatedTrial trial = simulatedTrial(tree, camera, settings, i);
    SimulationRandom random(settings.seed, i, DrawFor::kDevice);
    SimulatedPatientSettings patient_settings(settings.fluoroscopy);
    patient_settings.bolus.enabled = true;
    patient_settings.motion.breathing.amplitude_mm = runs.breath_mm;
    patient_settings.device.kind = runs.device;
    patient_settings.device.inserted_mm = random.uniform(kMinInserted_mm, kMaxInserted_mm);
    const int ends = std::min(kEnds, static_cast<int>(endsByDistance(tree).size()));
    patient_settings.device.tip_branch = std::min(ends - 1, static_cast<int>(ends * random.uniform()));
    const double time_s = random.uniform(0, kLast_s);

    const auto patient =
        std::make_shared<SimulatedPatient>(tree, patient_settings, Surroundings{lpsOf(settings.model_axes), {}});
    const XrayCamera& seen_by = trial.true_views.front().camera;
    const XrayScene scene = patient->scene(trial.truth, time_s);
    ExtractionSample sample;
    sample.name = "simulated " + std::to_string(i);
    sample.image = patient->render(seen_by, scene, static_cast<std::uint64_t>(i));
    sample.allowed = patient->truth(seen_by, scene).centerline;
    sample.required = sample.shown = shownOf(sample.allowed);
    if (!(runs.frames_per_s > 0)) return sample;
    const int index = static_cast<int>(std::max(0.0, time_s - runs.from_s) * runs.frames_per_s);
    const int after = runs.looks_ahead ? static_cast<int>((kLast_s - time_s) * runs.frames_per_s) : 0;
    sample.run = {index, index + 1 + after, runs.looks_ahead, [=, pose = trial.truth](int frame) {
                    const XrayScene at = patient->scene(pose, time_s + (frame - index) / runs.frames_per_s);
                    return patient->render(seen_by, at, static_cast<std::uint64_t>((i + 1) * kFrames + frame));
                  }};
    return sample;
  };
  return {settings.trials, one};
}

}  // namespace angio::evaluation
