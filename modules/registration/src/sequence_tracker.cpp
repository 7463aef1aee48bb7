// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/sequence_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace angio::registration {
namespace {

bool converged(const RegistrationResult& result) { return result.status == RegistrationStatus::kConverged; }

// Whether there is a pose at all, and a word on how well it is known.
bool usable(const RegistrationResult& result) {
  return result.status != RegistrationStatus::kTooFewPoints && result.T_camera_model.matrix().allFinite() &&
         result.covariance && result.covariance->allFinite() && std::isfinite(result.agreement.image_residual_px);
}

// What a pose is worth where there is none to compare it with.
int rank(const RegistrationResult& result) {
  if (!usable(result)) return 0;
  return converged(result) ? 2 : result.status == RegistrationStatus::kAmbiguous ? 1 : 0;
}

}  // namespace

SequenceTracker::SequenceTracker(Registration& registration, const SequenceTrackerSettings& settings,
                                 const StartSettings& starts)
    : registration_(registration),
      settings_(settings),
      starts_(starts),
      motion_(settings.motion, registration.tree().centroid()) {
  checkSettings("sequence", settings_);
  checkSettings("starts", starts_);
}

void SequenceTracker::reset() {
  motion_.reset();
  track_.reset();
  last_followed_.reset();
  ever_converged_ = false;
}

TrackedFrame SequenceTracker::step(const XrayViews& views, double time_s, const PosePrior& initial) {
  TrackedFrame frame;
  track_ ? follow(views, time_s, initial, frame) : begin(views, time_s, initial, frame);
  return frame;
}

void SequenceTracker::begin(const XrayViews& views, double time_s, const PosePrior& initial, TrackedFrame& frame) {
  RegistrationTimes times;
  Candidate chosen = candidate(search(views, initial, times), PoseSource::kSearched, views, time_s);
  if (last_followed_) {
    Candidate near_last =
        candidate(search(views, {*last_followed_, initial.covariance}, times), PoseSource::kSearched, views, time_s);
    const int more = rank(near_last.result) - rank(chosen.result);
    if (more > 0 || (more == 0 && !clearlyBetter(chosen.fit, near_last.fit))) chosen = std::move(near_last);
  }
  frame.result = chosen.result;
  frame.result.times = times;
  // Here only the status can say whether a pose is one: there is nothing yet to compare with. Where it has been good
  // before, nothing less will do; where it never was, an ambiguous one may be all there is to have.
  if (rank(chosen.result) < (ever_converged_ || !settings_.follow_ambiguous ? 2 : 1)) {
    frame.doubt = "no pose to begin with: " + chosen.result.reason;
    return;
  }
  restart(chosen, time_s);
  frame.followed = true;
}

void SequenceTracker::follow(const XrayViews& views, double time_s, const PosePrior& initial, TrackedFrame& frame) {
  frame.prediction = motion_.predict(time_s);
  const PosePrior& prediction = *frame.prediction;
  const double widening = settings_.prior_widening * settings_.prior_widening;
  const PosePrior prior{prediction.T_camera_model, Matrix6d(widening * *prediction.covariance)};
  const Candidate tracked =
      candidate(registration_.align(views, prior, prediction.T_camera_model), PoseSource::kTracked, views, time_s);
  RegistrationTimes times = tracked.result.times;

  Candidate chosen = tracked;
  frame.doubt = doubtOf(tracked);
  const bool look_afresh = !ever_converged_ && ++track_->frames_since_search >= settings_.frames_between_searches;
  if (!frame.doubt.empty() || look_afresh) {
    // In doubt the prediction is a place to look around, as widely as without it, and no measurement.
    const auto consider = [&](const Pose& around) {
      Candidate other =
          candidate(search(views, {around, initial.covariance}, times), PoseSource::kSearched, views, time_s);
      if (isBetter(other, chosen)) chosen = std::move(other);
    };
    consider(prediction.T_camera_model);
    if (look_afresh) {
      consider(initial.T_camera_model);
      track_->frames_since_search = 0;
    }
  }
  frame.result = chosen.result;
  frame.result.times = times;
  frame.source = chosen.source;
  frame.innovation = chosen.innovation;
  if (chosen.inside && !fallen(chosen.fit)) {
    frame.followed = true;
    motion_.update(chosen.result.T_camera_model, chosen.about_centroid, time_s);
    remember(chosen.result);
  } else if (isJump(chosen, tracked)) {
    frame.followed = true;
    restart(chosen, time_s);
  } else {
    if (frame.doubt.empty()) frame.doubt = doubtOf(chosen);
    miss();
  }
}

RegistrationResult SequenceTracker::search(const XrayViews& views, const PosePrior& prior, RegistrationTimes& times) {
  RegistrationResult result = registration_.search(views, prior, starts_);
  times += result.times;
  return result;
}

SequenceTracker::Candidate SequenceTracker::candidate(RegistrationResult result, PoseSource source,
                                                      const XrayViews& views, double time_s) const {
  Candidate made;
  made.source = source;
  made.usable = usable(result);
  // Without a pose the figures of the fit mean nothing: worse than any.
  made.fit = made.usable ? Fit{result.agreement.score(), result.agreement.image_residual_px}
                         : Fit{0, std::numeric_limits<double>::infinity()};
  if (made.usable) {
    made.about_centroid = covarianceOf(result, views.front().camera);
    made.innovation = motion_.innovation(result.T_camera_model, made.about_centroid, time_s);
    made.inside = made.innovation && made.innovation->squared_mahalanobis <= settings_.gate;
  }
  made.result = std::move(result);
  return made;
}

// A method that pulls a whole tree to a catheter is sure of itself by its many points. Where image and model lie apart,
// no pose is known better than by that distance, at the tree's depth and at its radius.
Matrix6d SequenceTracker::covarianceOf(const RegistrationResult& result, const XrayCamera& camera) const {
  const VesselTree& tree = registration_.tree();
  const double radius_m = std::sqrt((tree.points().colwise() - tree.centroid()).colwise().squaredNorm().mean());
  const double depth_m = std::abs((result.T_camera_model * tree.centroid()).z());
  const double apart_m = result.agreement.image_residual_px * depth_m / camera.parameters().fx_px;
  Vector6d deviation;
  deviation << Eigen::Vector3d::Constant(apart_m), Eigen::Vector3d::Constant(apart_m / radius_m);
  return covarianceAboutCentroid(*result.covariance, result.T_camera_model, tree.centroid()) +
         Matrix6d(deviation.cwiseAbs2().asDiagonal());
}

bool SequenceTracker::fallen(const Fit& fit) const {
  return fit.score < settings_.fallen_share * track_->fit.score &&
         settings_.fallen_share * fit.distance_px > track_->fit.distance_px;
}

bool SequenceTracker::clearlyBetter(const Fit& a, const Fit& b) const {
  return a.score > b.score && a.score >= settings_.clearly_better * b.score &&
         settings_.clearly_better * a.distance_px <= b.distance_px;
}

// One poor frame must not send a track elsewhere: what does not converge has to beat what the track has been as well.
bool SequenceTracker::isJump(const Candidate& there, const Candidate& here) const {
  return there.usable && !there.inside && !fallen(there.fit) && clearlyBetter(there.fit, here.fit) &&
         (converged(there.result) || clearlyBetter(there.fit, track_->fit));
}

bool SequenceTracker::isBetter(const Candidate& other, const Candidate& held) const {
  if (!other.usable || !held.usable) return other.usable;
  if (!other.inside) return isJump(other, held);
  return held.inside ? other.fit.score > held.fit.score : !clearlyBetter(held.fit, other.fit);
}

std::string SequenceTracker::doubtOf(const Candidate& found) const {
  if (!found.usable) return "no pose: " + found.result.reason;
  if (!found.inside) return "moved further than the motion so far allows";
  if (fallen(found.fit)) return "fits clearly worse than the frames before";
  if (track_->converged && !converged(found.result)) return "no longer converged: " + found.result.reason;
  return "";
}

void SequenceTracker::restart(const Candidate& found, double time_s) {
  motion_.reset();
  motion_.update(found.result.T_camera_model, found.about_centroid, time_s);
  track_ = Track();
  remember(found.result);
}

void SequenceTracker::remember(const RegistrationResult& result) {
  track_->missed_in_a_row = 0;
  track_->converged = converged(result);
  ever_converged_ = ever_converged_ || track_->converged;
  last_followed_ = result.T_camera_model;
  // A plain mean at first, then one that forgets.
  ++track_->frames;
  const double gain = std::max(1.0 / track_->frames, 1.0 / settings_.memory_frames);
  track_->fit.score += gain * (result.agreement.score() - track_->fit.score);
  track_->fit.distance_px += gain * (result.agreement.image_residual_px - track_->fit.distance_px);
}

void SequenceTracker::miss() {
  if (++track_->missed_in_a_row < settings_.frames_until_lost) return;
  track_.reset();
  motion_.reset();
}

}  // namespace angio::registration
