// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/nodes.hpp"

#include <cmath>

#include "angio/base/errors.hpp"

namespace angio::lab {
namespace {

const CArmGeometry& checkedCArm(const CArmGeometry& carm) {
  carm.check();
  return carm;
}

}  // namespace

SimulatedXrayNode::SimulatedXrayNode(const VesselTree& tree, const SimulatedPatientSettings& settings,
                                     const CArmGeometry& carm, const Pose& T_patient_model,
                                     const std::optional<XrayCamera>& claimed_camera)
    : patient_(tree, settings, {T_patient_model.linear(), {}}),  // The patient frame has the axes L, P, S.
      carm_(checkedCArm(carm)),
      T_patient_model_(T_patient_model),
      camera_(carm_.camera()),
      claimed_camera_(claimed_camera.value_or(camera_)) {}

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

}  // namespace angio::lab
