// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>

#include "angio/evaluation/simulation_run.hpp"
#include "outcome_figures.hpp"

namespace angio::evaluation {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kGrossFailure_mm = 5;

bool succeeded(const CaseOutcome& o) { return o.error && o.error->mtre_m < kSuccessMtre_m; }

// The farthest good bin; with `unbroken` only up to the first bad one.
std::optional<double> farthest(const CaptureBins& bins, bool unbroken) {
  std::optional<double> edge_mm;
  for (int b = 0; b < CaptureBins::kBins; ++b) {
    const int trials = bins.trials[static_cast<std::size_t>(b)];
    if (trials < CaptureBins::kFewestTrials) continue;
    const bool good = bins.successes[static_cast<std::size_t>(b)] >= CaptureBins::kSuccess * trials;
    if (good) edge_mm = b + 1;
    if (!good && unbroken) break;
  }
  return edge_mm;
}

Json orNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

}  // namespace

CaptureBins captureBins(const std::vector<CaseOutcome>& outcomes) {
  CaptureBins bins;
  for (const auto& o : outcomes) {
    if (!o.start_error) continue;
    const double start_mm = 1e3 * o.start_error->mtre_m;
    if (!(start_mm < CaptureBins::kBins)) continue;
    const auto b = static_cast<std::size_t>(start_mm);
    ++bins.trials[b];
    bins.successes[b] += succeeded(o);
  }
  return bins;
}

std::optional<double> CaptureBins::range_mm() const { return farthest(*this, false); }
std::optional<double> CaptureBins::unbroken_range_mm() const { return farthest(*this, true); }

ShareBounds shareBounds(int successes, int trials) {
  if (trials <= 0) return {};
  constexpr double kZ = 1.959964;  // 97.5 % of the normal distribution.
  const double n = trials, share = successes / n, z2 = kZ * kZ;
  const double middle = (share + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kZ / (1 + z2 / n) * std::sqrt(share * (1 - share) / n + z2 / (4 * n * n));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

Json simulationSummary(const std::vector<CaseOutcome>& outcomes, std::optional<double> pixel_spacing_m) {
  Json summary = summaryOf(outcomes);
  std::vector<CaseOutcome> known, projected;
  for (const auto& o : outcomes) {
    if (o.error && o.start_error) known.push_back(o);
    if (o.error && o.error->mpd_px) projected.push_back(o);
  }
  summary["start_mtre_mm"] = spreadOf(known, [](const CaseOutcome& o) { return 1e3 * o.start_error->mtre_m; });
  summary["depth_mm"] = spreadOf(known, [](const CaseOutcome& o) { return 1e3 * o.error->depth_m; });
  summary["in_plane_mm"] = spreadOf(known, [](const CaseOutcome& o) { return 1e3 * o.error->in_plane_m; });
  if (pixel_spacing_m) {
    summary["mpd_detector_mm"] =
        spreadOf(projected, [&](const CaseOutcome& o) { return 1e3 * *pixel_spacing_m * *o.error->mpd_px; });
  }
  summary["mpd_isocentre_mm"] =
      spreadOf(projected, [](const CaseOutcome& o) { return 1e3 * *o.error->mpd_isocenter_m; });
  summary["gfr_true_isocentre_5mm_percent"] = percentOf(known, [](const CaseOutcome& o) {
    return !(o.error->mpd_isocenter_m && 1e3 * *o.error->mpd_isocenter_m <= kGrossFailure_mm);
  });
  summary["gfr_nearest_isocentre_5mm_percent"] = percentOf(outcomes, [](const CaseOutcome& o) {
    return !(1e3 * o.pixel_at_isocenter_m * o.result.agreement.model_residual_px <= kGrossFailure_mm);
  });
  const auto successes = static_cast<int>(std::count_if(known.begin(), known.end(), succeeded));
  const ShareBounds bounds = shareBounds(successes, static_cast<int>(known.size()));
  summary["success_mtre_2mm_bounds_percent"] = {100 * bounds.low, 100 * bounds.high};
  summary["in_plane_below_2mm_percent"] =
      percentOf(known, [](const CaseOutcome& o) { return o.error->in_plane_m < kSuccessMtre_m; });
  const CaptureBins bins = captureBins(known);
  summary["capture_range_mm"] = orNull(bins.range_mm());
  summary["capture_range_unbroken_mm"] = orNull(bins.unbroken_range_mm());
  summary["capture_bins_1mm"] = {{"trials", bins.trials}, {"successes", bins.successes}};
  return summary;
}

Json simulationSummaries(const std::vector<EntrantRun>& runs, std::optional<double> pixel_spacing_m,
                         const std::string& reference) {
  Json summaries = Json::object();
  for (const auto& run : runs) summaries[run.name] = simulationSummary(run.outcomes, pixel_spacing_m);
  if (runs.empty()) return summaries;
  const std::string base = summaries.contains(reference) ? reference : runs.front().name;
  const double base_ms = summaries[base]["time_ms"]["total"]["p50"];
  for (auto& summary : summaries) {
    if (base_ms > 0) {
      summary["time_p50_relative"] = {{"to", base},
                                      {"ratio", summary["time_ms"]["total"]["p50"].get<double>() / base_ms}};
    }
  }
  return summaries;
}

std::string simulationTable(const Json& summaries) {
  const std::string start = summaries.empty() ? ""
                                              : figureOf(summaries.front(), "start_mtre_mm/median",
                                                         "Starts are off by %.1f mm mTRE (median).\n\n");
  return start +
         figureTable("method", summaries,
                     {{"success, mTRE < 2 mm", "success_mtre_2mm_percent", "%.0f %%"},
                      {"in-plane < 2 mm", "in_plane_below_2mm_percent", "%.0f %%"},
                      {"pose ok", "pose_ok_percent", "%.0f %%"},
                      {"GFR > 5 px (true)", "gfr_true_5px_percent", "%.0f %%"},
                      {"GFR > 5 mm (true)", "gfr_true_isocentre_5mm_percent", "%.0f %%"},
                      {"capture range", "capture_range_mm", "%.0f mm"},
                      {"unbroken", "capture_range_unbroken_mm", "%.0f mm"},
                      {"failed, noticed", "failed_and_noticed_percent", "%.0f %%"},
                      {"failed, trusted", "failed_and_trusted_percent", "%.0f %%"}}) +
         "\n" +
         figureTable("method", summaries,
                     {{"mTRE", "mtre_mm/median", "%.3f mm"},
                      {"p95", "mtre_mm/p95", "%.3f mm"},
                      {"depth", "depth_mm/median", "%.3f mm"},
                      {"in-plane", "in_plane_mm/median", "%.3f mm"},
                      {"mPD", "mpd_px/median", "%.3f px"},
                      {"at the detector", "mpd_detector_mm/median", "%.3f mm"},
                      {"at the isocentre", "mpd_isocentre_mm/median", "%.3f mm"},
                      {"rotation", "rotation_deg/median", "%.4f deg"},
                      {"centroid", "centroid_mm/median", "%.3f mm"},
                      {"nearest residual", "mean_projection_residual_px/median", "%.2f px"}}) +
         "\n" +
         figureTable("method", summaries,
                     {{"ms p50", "time_ms/total/p50", "%.2f"},
                      {"p99", "time_ms/total/p99", "%.2f"},
                      {"max", "time_ms/total/max", "%.2f"},
                      {"p50 relative", "time_p50_relative/ratio", "%.2f"}}) +
         "\nMedians over the trials; \"pose ok\" is within 0.1 deg and 1 mm of the truth at the tree's centroid. "
         "Trusted "
         "is what the method itself calls converged.\n";
}

}  // namespace angio::evaluation
