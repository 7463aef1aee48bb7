// SPDX-License-Identifier: GPL-2.0-or-later
#include "tip_smoother.hpp"

#include <algorithm>
#include <cmath>

namespace angio::localisation {
namespace {

constexpr double kFloor = -1e5;  // Logarithm of what a frame's candidates leave out.
constexpr double kDoubt = 60;    // Nats below the best way that are followed no more.

// Logarithm of the curve's evidence at each place; zero everywhere when the frame said nothing.
std::vector<double> evidenceOf(const ForwardFrame& frame, int places) {
  std::vector<double> result(places, frame.candidates.empty() ? 0.0 : kFloor);
  for (const Candidate& one : frame.candidates) {
    result[one.place] = std::max(result[one.place], one.match.log_evidence);
  }
  return result;
}

}  // namespace

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
        if (score[i] < score[best] - kDoubt) continue;
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
  std::vector<int> way(frames.size());
  int at = static_cast<int>(std::max_element(score.begin(), score.end()) - score.begin());
  for (std::size_t t = frames.size(); t-- > 0;) {
    way[t] = at;
    at = before[t][at];
  }
  return way;
}

}  // namespace angio::localisation
