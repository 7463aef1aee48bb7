// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/perception.hpp"

#include "angio/base/stopwatch.hpp"

namespace angio {

IterativePnpSettings PerceptionSettings::iterativePnpForSearch() {
  IterativePnpSettings settings;
  settings.prior = PriorForm::kCovariance;
  settings.outside_image = OutsideImage::kIgnore;
  settings.last_scale_px = 1.5;
  return settings;
}

IterativePnpSettings PerceptionSettings::iterativePnpForTracking() {
  IterativePnpSettings settings = iterativePnpForSearch();
  settings.first_scale_px = 6;
  settings.most_iterations = 20;
  return settings;
}

void PerceptionSettings::useIterativePnp() {
  search = iterativePnpForSearch();
  tracking = iterativePnpForTracking();
  search_starts.count = 12;
  search_starts.rotation_std_deg = 2;
  search_starts.translation_std_mm = 6;
}

Perception::Perception(const PerceptionSettings& settings, const CArmGeometry& carm, const Pose& T_dsa_cb,
                       const VesselTree& tree)
    : carm_(carm),
      T_dsa_cb_(T_dsa_cb),
      search_starts_(settings.search_starts),
      extractor_(makeExtractor(settings.extractor)),
      search_(makeRegistration(settings.search, tree)),
      tracking_(makeRegistration(settings.tracking, tree)),
      tracker_(settings.tracker, carm, T_dsa_cb, tree.centroid()) {}

Sight Perception::look(const XrayFrame& frame, const CArmState& state) {
  Sight sight;
  Stopwatch stage;
  sight.curves = extractor_->extract(frame.image);
  sight.centerline = vesselsToMatch(sight.curves);
  sight.image_s = stage.seconds();

  stage = Stopwatch();
  sight.predicted = tracker_.predict(state);
  sight.tracked = tracker_.tracking();
  sight.registration = sight.tracked ? tracking_->align(sight.centerline, frame.camera, sight.predicted)
                                     : search_->search(sight.centerline, frame.camera, sight.predicted, search_starts_);
  sight.registration_s = stage.seconds();
  return sight;
}

void Perception::trust(const Sight& sight, const CArmState& state) {
  tracker_.update(sight.registration.T_camera_model, state, sight.registration.covariance);
}

void Perception::doubt() { tracker_.miss(); }

Pose Perception::calibrated_T_camera_model(const CArmJoints& joints) const {
  return carm_.T_camera_patient(joints) * T_dsa_cb_;
}

Pose Perception::tracked_T_camera_model(const CArmJoints& joints) const {
  return tracker_.predict(joints).T_camera_model;
}

}  // namespace angio
