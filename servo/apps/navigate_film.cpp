// SPDX-License-Identifier: GPL-2.0-or-later
#include "navigate_film.hpp"

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/registration/message_conversion.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::apps {
namespace {

constexpr int kTimesFaster = 3;

LiveScene sceneOf(const NavigateMoment& m, ModelId model_id) {
  LiveScene scene{m.frame, {}, m.status, {}, {}, {}, {}};
  if (m.report.registration) {
    scene.registration = registrationMessage(*m.report.registration, model_id, m.frame.time_us, m.frame.sequence);
  }
  if (m.report.loop.trace) scene.device_px = m.report.loop.trace->seen.points_px;
  if (const auto& belief = m.report.loop.input.belief) {
    CatheterTip tip;
    tip.model_id = model_id;
    tip.status = CatheterTipStatus::kLocated;
    tip.tip_model = belief->tip.tip_model;
    tip.branch = belief->tip.chain;
    tip.arc_length_m = belief->tip.path_m;
    scene.tip = tip;
  }
  scene.title = formatted("%.0f s: %s", m.time_s, stateName(m.report.loop.answer.state));
  return scene;
}

}  // namespace

NavigateFilm::NavigateFilm(const std::string& path, const VesselTree& tree, const TreeLocation& target,
                           double frame_rate_hz)
    : film_(path, frame_rate_hz), model_id_(modelId(tree)), overlay_(tree), target_(TreeTopology(tree).point(target)) {}

void NavigateFilm::show(const NavigateMoment& moment) {
  if (frames_++ % kTimesFaster != 0) return;
  LiveScene scene = sceneOf(moment, model_id_);
  scene.target_model = target_;
  film_.write(overlay_.draw(scene));
}

}  // namespace angio::apps
