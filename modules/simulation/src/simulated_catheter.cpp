// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_catheter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/base/checked.hpp"
#include "angio/base/errors.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/simulation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "catheter_body.hpp"
#include "elastic_catheter.hpp"
#include "kinematic_catheter.hpp"

namespace angio::simulation {
namespace {

constexpr std::int64_t kStepUs = 5'000;
constexpr double kPlausibleEnd_m = 0.6e-3;  // Radius where the tree ends, if it does not say: the renderer's default.
constexpr double kNoEnd = std::numeric_limits<double>::infinity();  // Of roll.

}  // namespace

std::unique_ptr<CatheterBody> makeCatheterBody(const VesselTree& tree, const CatheterSettings& settings,
                                               const TreeLocation& start) {
  if (settings.elastic) return std::make_unique<ElasticCatheter>(tree, settings, start);
  return std::make_unique<KinematicCatheter>(tree, settings, start);
}

SimulatedCatheter::SimulatedCatheter(const VesselTree& tree, const CatheterSettings& settings,
                                     const TreeLocation& start, std::int64_t now_us, const ReceiverSettings& receiver)
    : CommandReceiver(receiver),
      settings_(checked("catheter", settings)),
      tree_(withPlausibleRadii(tree, kPlausibleEnd_m)),
      now_us_(now_us),
      settled_us_(now_us - now_us % kStepUs),
      stop_us_(now_us) {
  const TreeTopology map(tree_);
  if (start.branch < 0 || start.branch >= map.branchCount()) {
    throw InputError("catheter start", "chain", std::to_string(start.branch),
                     "must be one of the tree's " + std::to_string(map.branchCount()) + " branches");
  }
  requireBetween("catheter start", "arc_m", start.arc_m, 0, map.length_m(start.branch));
  const double tip_m = map.start_m(start.branch) + start.arc_m;
  requireBetween("catheter start", "path_m", tip_m, 0, 1e-3 * settings_.length_mm);
  body_ = makeCatheterBody(tree_, settings_, start);
  origin_ = settled_ = Base(tip_m, 0, 0);
}

SimulatedCatheter::SimulatedCatheter(SimulatedCatheter&&) noexcept = default;
SimulatedCatheter& SimulatedCatheter::operator=(SimulatedCatheter&&) noexcept = default;
SimulatedCatheter::~SimulatedCatheter() = default;

void SimulatedCatheter::obey(const CatheterCommand& command, std::int64_t now_us, const std::string& sender) {
  advance(now_us);
  const Base most(1e-3 * settings_.max_insertion_speed_mm_per_s, degToRad(settings_.max_roll_speed_deg_per_s),
                  degToRad(settings_.max_bend_speed_deg_per_s));
  const Base wanted(command.insertion_speed_m_per_s, command.roll_speed_rad_per_s, command.bend_speed_rad_per_s);
  if (!takes(command, wanted.cwiseQuotient(most), now_us_, sender)) return;
  origin_ = baseAt(now_us_);
  command_us_ = now_us_;
  stop_us_ = now_us_ + std::clamp<std::int64_t>(command.valid_for_us, 0, kMaxValidity_us);
  speeds_ = wanted.cwiseMax(-most).cwiseMin(most);
}

void SimulatedCatheter::advance(std::int64_t now_us) {
  if (now_us <= now_us_) return;
  while (now_us - settled_us_ >= kStepUs) {
    settled_us_ += kStepUs;
    const Base base = baseAt(settled_us_);
    const bool still = base == settled_;
    settled_ = base;
    const bool moves = body_->settle(base);
    // Nothing moves and nothing will: the rest of the time passes at once.
    if (still && !moves && settled_us_ >= stop_us_) settled_us_ = now_us - now_us % kStepUs;
  }
  now_us_ = now_us;
}

SimulatedCatheter::Base SimulatedCatheter::nearest() const { return {body_->minInsertion_m(), -kNoEnd, 0}; }

SimulatedCatheter::Base SimulatedCatheter::furthest() const {
  return {1e-3 * settings_.length_mm, kNoEnd, degToRad(settings_.max_bend_deg)};
}

SimulatedCatheter::Base SimulatedCatheter::baseAt(std::int64_t time_us) const {
  const double passed_s = 1e-6 * static_cast<double>(std::min(time_us, stop_us_) - command_us_);
  return (origin_ + speeds_ * passed_s).cwiseMax(nearest()).cwiseMin(furthest());
}

CatheterState SimulatedCatheter::state() const {
  CatheterState state;
  state.time_us = now_us_;
  const Base base = baseAt(now_us_), near = nearest(), far = furthest();
  state.insertion_m = base[0];
  state.roll_rad = base[1];
  state.bend_rad = base[2];
  if (now_us_ < stop_us_) {
    const auto speed = [&](int i) {
      const bool at_end = (speeds_[i] > 0 && base[i] >= far[i]) || (speeds_[i] < 0 && base[i] <= near[i]);
      return at_end ? 0.0 : speeds_[i];
    };
    state.insertion_speed_m_per_s = speed(0);
    state.roll_speed_rad_per_s = speed(1);
    state.bend_speed_rad_per_s = speed(2);
  }
  state.insertion_force_n = body_->insertionForce_n();
  return state;
}

CatheterTruth SimulatedCatheter::truth() const { return body_->truth(); }

Device SimulatedCatheter::device(const Eigen::Matrix3Xd& points) const {
  Device device;
  device.diameter_m = 1e-3 * settings_.diameter_mm;
  device.attenuation_per_m = settings_.attenuation_per_m;
  device.marker_length_m = 1e-3 * settings_.marker_length_mm;
  device.marker_attenuation_per_m = settings_.marker_length_mm > 0 ? 4000 : 0;
  device.points = body_->line(points);
  return device;
}

}  // namespace angio::simulation
