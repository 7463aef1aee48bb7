// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/nodes.hpp"

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/types/channels.hpp"

namespace angio::lab {
namespace {

const CArmGeometry& checked(const CArmGeometry& carm) {
  carm.check();
  return carm;
}

// A session first: a command that is as new is one of its own, or one that it ends.
template <typename Command, typename Machine>
void obeyAll(HeardMessages<ServoSession>& sessions, HeardMessages<Command>& commands, Machine& machine,
             std::int64_t now_us) {
  for (const auto& [session, sender] : sessions.take()) machine.begin(session, now_us, sender);
  for (const auto& [command, sender] : commands.take()) machine.obey(command, now_us, sender);
}

}  // namespace

SimulatedCArmNode::SimulatedCArmNode(Bus& bus, const CArmLimits& limits, const CArmJoints& start, std::int64_t now_us)
    : bus_(bus),
      commands_(bus, kCArmCommandChannel),
      sessions_(bus, kServoSessionChannel),
      arm_(limits, start, now_us) {}

void SimulatedCArmNode::listen(std::int64_t now_us) { obeyAll(sessions_, commands_, arm_, now_us); }

void SimulatedCArmNode::report(std::int64_t now_us) {
  arm_.advance(now_us);
  CArmState state = arm_.state();
  state.sequence = ++sequence_;
  publish(bus_, kCArmStateChannel, state);
}

SimulatedXrayNode::SimulatedXrayNode(Bus& bus, const VesselTree& tree, const SimulatedPatientSettings& settings,
                                     const CArmGeometry& carm, const Pose& T_patient_model,
                                     const std::optional<XrayCamera>& claimed_camera)
    : bus_(bus),
      states_(bus, kCArmStateChannel),
      patient_(tree, settings, {T_patient_model.linear(), {}}),  // The patient frame has the axes L, P, S.
      carm_(checked(carm)),
      T_patient_model_(T_patient_model),
      camera_(carm_.camera()),
      claimed_camera_(claimed_camera.value_or(camera_)) {}

std::optional<XrayFrame> SimulatedXrayNode::expose(std::int64_t now_us) {
  const auto& state = states_.peek();
  if (!state) return std::nullopt;
  return expose(now_us, state->joints);
}

XrayFrame SimulatedXrayNode::expose(std::int64_t now_us, const CArmJoints& joints) {
  XrayFrame frame = render(now_us, joints);
  publish(bus_, kXrayFrameChannel, frame);
  return frame;
}

XrayFrame SimulatedXrayNode::blank(std::int64_t now_us) {
  if (!first_us_) first_us_ = now_us;
  return {now_us, ++sequence_, {}, claimed_camera_};
}

XrayFrame SimulatedXrayNode::render(std::int64_t now_us, const CArmJoints& joints) {
  XrayFrame frame = blank(now_us);
  XrayScene scene = patient_.scene(T_camera_model(joints), patientTime_s(now_us));
  if (device_) scene.devices.push_back(device_(scene.pointsOf(patient_.tree())));
  frame.image = patient_.render(camera_, scene, static_cast<std::uint64_t>(sequence_));
  return frame;
}

Eigen::Vector3d SimulatedXrayNode::inCamera(const Eigen::Vector3d& p_model, const CArmJoints& joints,
                                            std::int64_t now_us) const {
  return T_camera_model(joints) * patient_.moved(p_model, patientTime_s(now_us));
}

double SimulatedXrayNode::patientTime_s(std::int64_t now_us) const {
  return 1e-6 * static_cast<double>(now_us - first_us_.value_or(now_us));
}

SimulatedInjector::SimulatedInjector(Bus& bus, double after_s)
    : requests_(bus, kViewRequestChannel), statuses_(bus, kServoStatusChannel) {
  requireBetween("injector", "after_s", after_s, 0, 3600);
  after_us_ = std::llround(1e6 * after_s);
}

bool SimulatedInjector::injects(std::int64_t now_us) {
  if (const auto request = requests_.take(); request && request->time_us != request_us_) {
    request_us_ = request->time_us;
    reached_us_.reset();
  }
  const auto status = statuses_.take();
  if (request_us_ == 0) return false;
  if (!reached_us_ && status && status->view_reached_us == request_us_) reached_us_ = now_us;
  return !reached_us_ || now_us - *reached_us_ < after_us_;
}

SimulatedCatheterNode::SimulatedCatheterNode(Bus& bus, const VesselTree& tree, const CatheterSettings& settings,
                                             const TreeLocation& start, std::int64_t now_us)
    : bus_(bus),
      commands_(bus, kCatheterCommandChannel),
      sessions_(bus, kCatheterSessionChannel),
      catheter_(tree, settings, start, now_us) {}

void SimulatedCatheterNode::listen(std::int64_t now_us) { obeyAll(sessions_, commands_, catheter_, now_us); }

void SimulatedCatheterNode::report(std::int64_t now_us) {
  catheter_.advance(now_us);
  CatheterState state = catheter_.state();
  state.sequence = ++sequence_;
  publish(bus_, kCatheterStateChannel, state);
}

}  // namespace angio::lab
