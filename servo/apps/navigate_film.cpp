// SPDX-License-Identifier: GPL-2.0-or-later
#include "navigate_film.hpp"

#include "angio/base/formatted.hpp"
#include "angio/registration/registration.hpp"
#include "angio/vessel/tree_map.hpp"

namespace angio {
namespace {

constexpr int kTimesFaster = 3;

LiveScene sceneOf(const NavigateMoment& m, std::int64_t frame, ModelId model_id) {
  LiveScene scene{{m.input.time_us, frame, m.image, m.pose.camera}, {}, {}, {}, {}, {}, {}};
  RegistrationMessage registered;
  registered.model_id = model_id;
  registered.status_text = statusName(RegistrationStatus::kConverged);
  registered.T_camera_model = m.pose.T_camera_model;
  scene.registration = registered;
  ServoStatus status;
  const bool stands = m.answer.state == NavigationState::kWaiting || m.answer.state == NavigationState::kGivenUp;
  status.state = stands ? ServoState::kHold : ServoState::kServo;
  status.reason = m.answer.why;
  scene.status = status;
  if (m.trace) scene.device_px = m.trace->seen.points_px;
  if (m.input.belief) {
    CatheterTip tip;
    tip.model_id = model_id;
    tip.status = CatheterTipStatus::kLocated;
    tip.tip_model = m.input.belief->tip.tip_model;
    tip.branch = m.input.belief->tip.chain;
    tip.arc_length_m = m.input.belief->tip.path_m;
    scene.tip = tip;
  }
  scene.title = formatted("%.0f s: %s", m.time_s, stateName(m.answer.state));
  return scene;
}

}  // namespace

NavigateFilm::NavigateFilm(const std::string& path, const VesselTree& tree, const TreePlace& target,
                           double frame_rate_hz)
    : film_(path, frame_rate_hz), model_id_(modelId(tree)), overlay_(tree), target_(TreeMap(tree).point(target)) {}

void NavigateFilm::show(const NavigateMoment& moment) {
  if (frames_++ % kTimesFaster != 0 || moment.image.empty()) return;
  LiveScene scene = sceneOf(moment, frames_, model_id_);
  scene.target_model = target_;
  film_.write(overlay_.draw(scene));
}

}  // namespace angio
