// SPDX-License-Identifier: GPL-2.0-or-later
#include "unlikely_lines.hpp"

#include <numeric>

#include "line_evidence.hpp"

namespace angio::imaging {
namespace {

// Log odds of a vessel: the constant, and what each of kEvidenceTerms counts. fit_line_evidence.py prints them but for
// 0.03: these were learnt before catheters were told among what is likely, and a loop follows a liver a little better.
constexpr float kPrior = 0.11f;
constexpr decltype(LineEvidence::terms) kWeights = {1.05f, 1.69f, 0.63f, 0.66f, -0.48f, -0.64f, 1.03f, -0.47f, -0.77f};

// A wide line's place is less sure: among wide ones, or where it is as dark as the strong vessels, it owes less. A step's
// edge has -0.7 and less.
constexpr float kWideOdds = -0.6f;

// Log odds of a vessel where one is expected, over those of one elsewhere. Chosen on simulated livers, seed 11.
constexpr float kExpectedOdds = 2;

// A line of these log odds is no bone, however dilute.
constexpr float kNoBone = 3;

// Edges and overlaps of bones and organs absorb less than this, or than this part of what strong vessels do; a line
// that absorbs more is a vessel, however dilute.
constexpr float kBone = 0.15f, kBonePart = 0.5f;

// A line that stands alone must have this many times the density that the others must.
constexpr float kAloneFactor = 1.37f;

// Contrast grows with the width of what holds contrast agent. A line wider than most vessels that has less than this
// part of their density, and less than that part of the strong ones' contrast, is the edge or the overlap of organs. An
// aorta beside metal has as little density, but two thirds and more of that contrast.
constexpr float kWideDensity = 0.39f, kWidePart = 0.6f;

float logOddsOf(const LineEvidence& evidence) {
  return std::inner_product(kWeights.begin(), kWeights.end(), evidence.terms.begin(), kPrior);
}

bool isDilute(const LineEvidence& evidence, float least_density) {
  if (evidence.contrast >= kBone || evidence.contrast_part >= kBonePart) return false;
  return evidence.density_part < least_density * (evidence.stands_alone ? kAloneFactor : 1);
}

bool owesLess(const LineEvidence& evidence) {
  return evidence.is_wide && (evidence.most_are_wide || evidence.contrast_part > 1);
}

bool isOrgan(const LineEvidence& evidence) {
  return evidence.is_wide && evidence.density_part < kWideDensity && evidence.contrast_part < kWidePart;
}

bool isLikely(const LineEvidence& evidence, float least_density, bool expected) {
  const float log_odds = logOddsOf(evidence) + (expected ? kExpectedOdds : 0);
  if (!(log_odds > (owesLess(evidence) ? kWideOdds : 0))) return false;
  if (!expected && isOrgan(evidence)) return false;
  return expected || log_odds > kNoBone || !isDilute(evidence, least_density);
}

}  // namespace

void dropUnlikely(std::vector<CentreLine>& lines, float side, float least_density) {
  const std::vector<LineEvidence> evidence = evidenceOf(lines, side);
  std::vector<CentreLine> kept;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool keeps = lines[i].kind == CurveKind::kDevice || isLikely(evidence[i], least_density, lines[i].expected);
    if (keeps) kept.push_back(std::move(lines[i]));
  }
  lines = std::move(kept);
}

}  // namespace angio::imaging
