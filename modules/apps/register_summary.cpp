// SPDX-License-Identifier: GPL-2.0-or-later
#include "register_summary.hpp"

#include <nlohmann/json.hpp>
#include <vector>

#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "angio/results/overlay.hpp"

namespace angio::apps {
namespace {

// The likeliest first. What has been tried is not told again.
std::vector<std::string> nextSteps(const RegistrationResult& result, const RegistrationTry& tried) {
  std::vector<std::string> steps;
  const bool few = result.status == RegistrationStatus::kTooFewPoints;
  if (tried.matching) steps.push_back(std::string("the image matches when ") + nameOf(*tried.matching));
  if (!few && !(tried.starts.box_rotation_deg >= 180)) {
    steps.push_back("--search-rotation-deg 180 --search-translation-mm 60");
  }
  if (tried.from_image) {
    steps.push_back(tried.extractor == "ridge" ? "--extractor otsu" : "--extractor ridge");
    steps.push_back("--polarity bright where vessels are brighter than their surroundings");
  }
  if (!few && tried.views < 2) steps.push_back("a second view of the same moment");
  if (result.status == RegistrationStatus::kDiverged && !tried.nonrigid) {
    steps.push_back("--nonrigid where the vessels may have deformed");
  }
  return steps;
}

}  // namespace

std::string captionOf(const CaseOutcome& outcome) {
  const RegistrationResult& r = outcome.result;
  if (r.status == RegistrationStatus::kTooFewPoints) return statusName(r.status);
  return formatted("%s: %s, %.1f ms", statusName(r.status).c_str(), alignmentInWords(r.alignment).c_str(),
                   1e3 * (outcome.image_s + r.times.total_s));
}

std::string summaryOf(const CaseOutcome& outcome, const RegistrationTry& tried) {
  const RegistrationResult& r = outcome.result;
  std::string line = captionOf(outcome);
  if (r.status == RegistrationStatus::kConverged) {
    if (const auto& half = outcome.interval_90) {
      line += formatted("; 90 %% intervals +-%.2g mm on each axis across the beam, +-%.2g mm in depth",
                        1e3 * half->across_beam_m, 1e3 * half->depth_m);
    }
    return line +
           (outcome.usable_for.empty() ? "; too unsure for any task" : "; usable for " + joined(outcome.usable_for));
  }
  if (!r.reason.empty()) line += "; " + r.reason;
  const std::vector<std::string> steps = nextSteps(r, tried);
  return line + ". Not to be trusted" + (steps.empty() ? "" : ". To try next: " + joined(steps, steps.size(), "; "));
}

std::optional<ImageReading> matchingReading(Registration& registration, const XrayView& seen, const PosePrior& prior,
                                            const StartSettings& starts) {
  std::optional<ImageReading> best;
  double best_score = 0;
  for (const ImageReading reading : otherReadings(seen.camera)) {
    const Centerline2d read = readAs(reading, seen.centerline, seen.camera);
    const RegistrationResult result = registration.search({XrayView{read, seen.camera}}, prior, starts);
    if (result.status != RegistrationStatus::kConverged || result.alignment.score() <= best_score) continue;
    best_score = result.alignment.score();
    best = reading;
  }
  return best;
}

}  // namespace angio::apps
