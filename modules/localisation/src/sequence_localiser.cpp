// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/sequence_localiser.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/vessel/resample.hpp"
#include "sequence_fit.hpp"
#include "tip_filter.hpp"

namespace angio::localisation {
namespace {

/// One frame after the forward pass.
struct ForwardFrame {
  CatheterMotion motion;
  FrameOutcome outcome;
  std::vector<double> probability;    ///< Of each place, by the frames up to this one.
  std::vector<Candidate> candidates;  ///< Empty when the frame was not used.
};

constexpr double kFloor = -1e5;     // Logarithm of what a frame's candidates leave out.
constexpr double kRouteDoubt = 60;  // Nats below the best route that are followed no more.

// Logarithm of the curve's evidence at each place; zero everywhere when the frame said nothing.
std::vector<double> evidenceOf(const ForwardFrame& frame, int places) {
  std::vector<double> result(places, frame.candidates.empty() ? 0.0 : kFloor);
  for (const Candidate& one : frame.candidates) {
    result[one.place] = std::max(result[one.place], one.match.log_evidence);
  }
  return result;
}

// Runs a filter over a sequence from its reset on.
std::vector<ForwardFrame> forwardPass(TipFilter& filter, const std::vector<SequenceFrame>& frames) {
  std::vector<ForwardFrame> result;
  filter.reset();
  for (const SequenceFrame& frame : frames) {
    filter.predict(frame.motion);
    ForwardFrame one;
    one.motion = frame.motion;
    one.outcome = filter.observe(frame.seen, frame.pose);
    one.probability = filter.probability();
    if (one.outcome.used) one.candidates = filter.candidates();
    result.push_back(std::move(one));
  }
  return result;
}

// Probabilities of the places in each frame by all frames (forward-backward; Rabiner, Proc. IEEE 77(2), 1989, eq. 27).
std::vector<std::vector<double>> smoothed(const TipFilter& filter, const std::vector<ForwardFrame>& frames) {
  const int places = filter.grid().size();
  const double jump = filter.settings().jump_probability / places;
  std::vector<std::vector<double>> result(frames.size());
  std::vector<double> later(places, 1.0);  // Of all later frames, given the place in this one.
  for (std::size_t t = frames.size(); t-- > 0;) {
    result[t] = frames[t].probability;
    double sum = 0;
    for (int i = 0; i < places; ++i) sum += result[t][i] *= later[i];
    for (double& p : result[t]) p /= sum;
    if (t == 0) break;
    const std::vector<double> evidence = evidenceOf(frames[t], places);
    const double best = *std::max_element(evidence.begin(), evidence.end());
    std::vector<double> here(places);
    double anywhere = 0;
    for (int i = 0; i < places; ++i) anywhere += jump * (here[i] = std::exp(evidence[i] - best) * later[i]);
    TipMotion motion(filter.settings(), filter.grid(), frames[t].motion);
    double most = 0;
    for (int i = 0; i < places; ++i) {
      later[i] = anywhere;
      if (frames[t - 1].probability[i] < jump * 1e-3) continue;
      for (const Reach& to : motion.from(i)) later[i] += to.probability * here[to.place];
      most = std::max(most, later[i]);
    }
    for (double& l : later) l /= most > 0 ? most : 1;
  }
  return result;
}

// The most probable places of the tip as one route (Viterbi; Rabiner 1989, eq. 30-35).
std::vector<int> mostProbableRoute(const TipFilter& filter, const std::vector<ForwardFrame>& frames) {
  const int places = filter.grid().size();
  const double log_jump = std::log(filter.settings().jump_probability / places);
  std::vector<std::vector<int>> before(frames.size(), std::vector<int>(places, -1));
  std::vector<double> score(places, 0.0), next(places);
  for (std::size_t t = 0; t < frames.size(); ++t) {
    if (t > 0) {
      const int best = static_cast<int>(std::max_element(score.begin(), score.end()) - score.begin());
      std::fill(next.begin(), next.end(), score[best] + log_jump);
      std::fill(before[t].begin(), before[t].end(), best);
      TipMotion motion(filter.settings(), filter.grid(), frames[t].motion);
      for (int i = 0; i < places; ++i) {
        if (score[i] < score[best] - kRouteDoubt) continue;
        for (const Reach& to : motion.from(i)) {
          const double candidate = score[i] + std::log(std::max(to.probability, 1e-300));
          if (candidate > next[to.place]) next[to.place] = candidate, before[t][to.place] = i;
        }
      }
      score.swap(next);
    }
    const std::vector<double> evidence = evidenceOf(frames[t], places);
    for (int i = 0; i < places; ++i) score[i] += evidence[i];
  }
  std::vector<int> route(frames.size());
  int at = static_cast<int>(std::max_element(score.begin(), score.end()) - score.begin());
  for (std::size_t t = frames.size(); t-- > 0;) {
    route[t] = at;
    at = before[t][at];
  }
  return route;
}

constexpr int kRigidRounds = 4;  // Before the vessels may bend: the path must be found first.
constexpr double kSameResidual_px = 0.05;

// The settings of one round: the first looks for the tree under a shift as large as the pose's own doubt, with matches
// as loose; each later one is half as loose, down to what was asked for.
LocaliserSettings settingsOfRound(const SequenceSettings& settings, int round) {
  LocaliserSettings s = settings.localiser;
  const double loose = std::pow(0.5, round);
  const auto atLeast = [&](double& value, double coarse) { value = std::max(value, coarse * loose); };
  if (round == 0) s.shift_time_s = 1000;  // The same in all frames.
  atLeast(s.shift_std_mm, settings.pose_translation_std_mm);
  atLeast(s.model_std_px, 10);
  atLeast(s.outlier_px, 50);
  atLeast(s.lost_px, 100);
  atLeast(s.scale_std_percent, 4);
  atLeast(s.roll_std_deg, settings.pose_rotation_std_deg);
  return s;
}

std::vector<SequenceFrame> corrected(std::vector<SequenceFrame> frames, const Pose& correction) {
  for (SequenceFrame& frame : frames) frame.pose.T_camera_model = frame.pose.T_camera_model * correction;
  return frames;
}

// The grid with its vessels displaced; lengths stay those of the tree.
PlaceGrid displaced(PlaceGrid grid, const Eigen::Matrix3Xd& displacements_m) {
  if (displacements_m.cols() == grid.size()) grid.points_m += displacements_m;
  return grid;
}

Eigen::Matrix2Xd projectionOf(const PlaceGrid& grid, const SeenPose& pose) {
  Eigen::Matrix2Xd result(2, grid.size());
  for (int i = 0; i < grid.size(); ++i) {
    // The filter has seen the frame, so that all of the tree is in front of the source.
    result.col(i) = *pose.camera.project(pose.T_camera_model * grid.points_m.col(i));
  }
  return result;
}

// What one frame's curve says of the pose when its tip is at a candidate's place.
PosedFrame posed(const SequenceFrame& frame, const SeenPose& corrected_pose, const TipFilter& filter,
                 const Candidate& chosen) {
  const LocaliserSettings& s = filter.settings();
  PosedFrame result{frame.pose, chosen.match.misfit.head<2>(), {}};
  const CurveSamples curve = samplesOf(frame.seen, s.step_px, chosen.tip_is_last);
  const Eigen::Matrix2Xd projected = projectionOf(filter.grid(), corrected_pose);
  PathMatcher matcher(s, filter.grid());
  matcher.prepare(projected, curve, 1);
  MisfitPrior found;
  found.mean = chosen.match.misfit;
  found.information = 1e6 * Eigen::Matrix4d::Identity();
  matcher.match(chosen.place, found, 0);
  const double std_px = std::hypot(s.model_std_px, curve.std_px);
  const double share = std::min(1.0, curve.step_px / s.correlation_px) / (std_px * std_px);
  for (const SampleMatch& m : matcher.lastMatches()) {
    result.points.push_back(
        {curve.points_px[m.sample], m.place, m.weight, share * m.trust * m.normal * m.normal.transpose()});
  }
  const double tip_variance = s.tip_std_px * s.tip_std_px + std_px * std_px;
  result.points.push_back({curve.points_px.front(), chosen.place, 0, Eigen::Matrix2d::Identity() / tip_variance});
  return result;
}

// The candidate of a place, or nothing when the frame did not look there.
const Candidate* candidateAt(const ForwardFrame& frame, int place) {
  const Candidate* best = nullptr;
  for (const Candidate& one : frame.candidates) {
    if (one.place == place && (!best || one.match.log_evidence > best->match.log_evidence)) best = &one;
  }
  return best;
}

// The answer of the last round.
void conclude(SequenceResult& result, const TipFilter& filter, const std::vector<ForwardFrame>& forward,
              const std::vector<int>& route) {
  const auto probability = smoothed(filter, forward);
  bool used = false;
  for (std::size_t t = 0; t < forward.size(); ++t) {
    TipBelief belief = filter.summarised(probability[t]);
    belief.why = forward[t].outcome.why;
    belief.status = forward[t].outcome.used ? BeliefStatus::kSeen
                    : used                  ? BeliefStatus::kPredicted
                                            : BeliefStatus::kUnknown;
    if (const Candidate* chosen = candidateAt(forward[t], route[t])) {
      belief.residual_px = chosen->match.residual_px;
      belief.shift_px = chosen->match.misfit.head<2>();
      used = true;
    }
    result.beliefs.push_back(std::move(belief));
    std::vector<double> certain(filter.grid().size(), 0.0);
    certain[route[t]] = 1;
    result.path.push_back(filter.summarised(certain).tip);
  }
}

// What of a round must stay the same for the rounds to end.
struct RoundOutcome {
  std::vector<int> route;
  double residual_px = 0;
  double log_evidence = 0;
};

RoundOutcome outcomeOf(const std::vector<ForwardFrame>& forward, const std::vector<int>& route) {
  RoundOutcome outcome{route, 0, 0};
  int used = 0;
  for (std::size_t t = 0; t < forward.size(); ++t) {
    outcome.log_evidence += forward[t].outcome.log_evidence;
    if (const Candidate* chosen = candidateAt(forward[t], route[t]))
      outcome.residual_px += chosen->match.residual_px, ++used;
  }
  outcome.residual_px /= std::max(used, 1);
  return outcome;
}

// Whether neither the route, but for a place here and there, nor the residual has changed. The correction itself may
// still creep where one view does not hold it: in depth, and along the vessels.
bool atRest(const RoundOutcome& before, const RoundOutcome& now, const PlaceGrid& grid) {
  if (before.route.size() != now.route.size()) return false;
  for (std::size_t t = 0; t < now.route.size(); ++t) {
    const int a = before.route[t], b = now.route[t];
    if (a != b && grid.parent[a] != b && grid.parent[b] != a) return false;
  }
  return std::abs(now.residual_px - before.residual_px) < kSameResidual_px;
}

// Displacements of the tree's points from those of the places.
Eigen::Matrix3Xd ofTreePoints(const VesselTree& tree, const PlaceGrid& grid, const Eigen::Matrix3Xd& of_places_m) {
  Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, tree.size());
  if (of_places_m.cols() != grid.size()) return result;
  for (std::size_t c = 0; c < tree.branches().size(); ++c) {
    const std::vector<int>& points = tree.branches()[c];
    const std::vector<double> arc_m = arcLengths(tree, points);
    for (std::size_t k = 1; k < points.size(); ++k) {
      result.col(points[k]) = of_places_m.col(placeAt(grid, static_cast<int>(c), arc_m[k]));
    }
    int first = grid.last_of_branch[c];
    while (grid.parent[first] >= 0) first = grid.parent[first];
    if (tree.parents()[points.front()] < 0) result.col(points.front()) = of_places_m.col(first);
  }
  return result;
}

}  // namespace

struct SequenceLocaliser::Work {
  Work(std::vector<SequenceFrame> given, const VesselTree& in_tree, const SequenceSettings& asked)
      : frames(std::move(given)),
        tree(in_tree),
        settings(asked),
        grid(makePlaceGrid(in_tree, 1e-3 * asked.localiser.spacing_mm)) {}

  std::vector<SequenceFrame> frames;
  VesselTree tree;
  SequenceSettings settings;
  PlaceGrid grid;
  SharedFit shared;
  RoundOutcome before;
  int round = 0;
  SequenceResult result;

  bool step();
  void correct(const std::vector<SequenceFrame>& now, const TipFilter& filter, const std::vector<ForwardFrame>& forward,
               const std::vector<int>& route);
};

bool SequenceLocaliser::Work::step() {
  TipFilter filter(settingsOfRound(settings, round), displaced(grid, shared.displacements_m), tree.centroid());
  const auto now = corrected(frames, shared.correction);
  const auto forward = forwardPass(filter, now);
  const auto route = mostProbableRoute(filter, forward);
  const RoundOutcome outcome = outcomeOf(forward, route);
  result.converged = round > kRigidRounds + 1 && atRest(before, outcome, grid);
  before = outcome;
  if (result.converged || round >= settings.rounds) {
    conclude(result, filter, forward, route);
    result.residual_px = outcome.residual_px;
    result.log_evidence = outcome.log_evidence;
    result.correction = shared.correction;
    result.displacements_m = ofTreePoints(tree, grid, shared.displacements_m);
    return true;
  }
  correct(now, filter, forward, route);
  ++round;
  return false;
}

// What the frames lack in common, by the route of this round.
void SequenceLocaliser::Work::correct(const std::vector<SequenceFrame>& now, const TipFilter& filter,
                                      const std::vector<ForwardFrame>& forward, const std::vector<int>& route) {
  std::vector<PosedFrame> posed_frames;
  std::vector<int> tips;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    if (const Candidate* chosen = candidateAt(forward[t], route[t])) {
      posed_frames.push_back(posed(frames[t], now[t].pose, filter, *chosen));
      tips.push_back(route[t]);
    }
  }
  if (tips.empty()) return;  // No frame says anything: there is nothing to correct.
  SequenceSettings of_round = settings;
  if (round < kRigidRounds) of_round.deformation_std_mm = 0;
  fitShared(posed_frames, tips, grid, tree.centroid(), of_round, shared);
}

SequenceLocaliser::SequenceLocaliser(std::vector<SequenceFrame> frames, const VesselTree& tree,
                                     const SequenceSettings& settings) {
  checkSettings("sequence localiser", settings);
  if (frames.empty()) throw InputError("sequence localiser", "frames", "0", "there must be one");
  work_ = std::make_unique<Work>(std::move(frames), tree, settings);
}

SequenceLocaliser::~SequenceLocaliser() = default;
SequenceLocaliser::SequenceLocaliser(SequenceLocaliser&&) noexcept = default;
SequenceLocaliser& SequenceLocaliser::operator=(SequenceLocaliser&&) noexcept = default;

bool SequenceLocaliser::step() { return work_->step(); }
const SequenceResult& SequenceLocaliser::result() const { return work_->result; }

SequenceResult localiseSequence(const std::vector<SequenceFrame>& frames, const VesselTree& tree,
                                const SequenceSettings& settings,
                                const std::function<void(int rounds_done)>& progress) {
  SequenceLocaliser localiser(frames, tree, settings);
  for (int done = 1;; ++done) {
    const bool last = localiser.step();
    if (progress) progress(done);
    if (last) return localiser.result();
  }
}

}  // namespace angio::localisation
