// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/evaluation/simulation.hpp"
#include "angio/results/campaign.hpp"
#include "angio/results/case_run.hpp"
#include "angio/results/statistics.hpp"

namespace angio::evaluation {

/// A method as it takes part, under the name it has in results ("iterative_pnp").
struct Entrant {
  std::string name;
  RegistrationSettings registration;
  StartSettings starts;
};

/// What the trials are made of, and who takes part.
struct SimulationSetup {
  std::vector<VesselTree> trees;        ///< At least one. Trial i has tree i modulo their number.
  std::optional<XrayCamera> camera;     ///< Absent: simulatedCamera().
  std::vector<MeasuredMotion> motions;  ///< Of the deformations, in turn from tree to tree; none: waves.
  std::vector<Entrant> entrants;
  ExtractorSettings extractor = RidgeSettings{};  ///< Of trials from images.
  /// Whether every result is certified in a box about its start. Of one view and rigid trees only; takes no part in the
  /// times.
  std::optional<CertificateSettings> certificate = std::nullopt;
  Campaign* campaign = nullptr;  ///< Where trials come from that are not all run here.
};

/// One entrant's outcomes, trial by trial.
struct EntrantRun {
  std::string name;
  std::vector<CaseOutcome> outcomes;
};

/// Runs every entrant on every trial. All see the same trials, one trial after the other, and take turns at being the
/// first on a trial: times of one run can be compared. `progress` counts registrations, of all entrants. Of trials
/// from images the centrelines are extracted once, and the time counts for every entrant.
///
/// Throws InputError for settings out of their range.
std::vector<EntrantRun> runSimulation(const SimulationSetup& setup, const SimulationSettings& settings,
                                      const Progress& progress = {});

/// Success over the distance at which the trials start.
struct CaptureBins {
  static constexpr int kBins = 20;       ///< Of 1 mm mTRE at the start, from 0.
  static constexpr int kMinTrials = 10;  ///< A bin with fewer says nothing.
  static constexpr double kSuccess = 0.95;

  std::vector<int> trials = std::vector<int>(kBins, 0), successes = std::vector<int>(kBins, 0);

  /// Upper edge of the farthest bin with success in 95 % or more of its trials [mm]; nothing when no bin has that, or
  /// none has enough trials.
  std::optional<double> range_mm() const { return farthest_mm(false); }

  /// The same, of the farthest such bin with no worse bin before it: one that luck does not carry.
  std::optional<double> unbroken_range_mm() const { return farthest_mm(true); }

 private:
  std::optional<double> farthest_mm(bool unbroken) const;
};

CaptureBins captureBins(const std::vector<CaseOutcome>& outcomes);

/// Bounds of a share with 95 % confidence (Wilson 1927), for `successes` of `trials`; 0 to 1 for no trials.
struct ShareBounds {
  double low = 0, high = 1;
};
ShareBounds shareBounds(int successes, int trials);

/// What summaryOf says, and what only trials with truth can say: start errors, projection errors in mm, depth and
/// in-plane parts, failure rates in px and mm, capture range, success with its bounds.
///
/// @param pixel_spacing_m  At the detector, when known.
Json simulationSummary(const std::vector<CaseOutcome>& outcomes, std::optional<double> pixel_spacing_m);

/// The summaries of one run by method; each has the ratio of its median time to that of the first entrant named
/// `reference` (or of the first entrant).
Json simulationSummaries(const std::vector<EntrantRun>& runs, std::optional<double> pixel_spacing_m,
                         const std::string& reference = "iterative_pnp");

/// The summaries as tables for people, Markdown.
std::string simulationTable(const Json& summary_by_method);

/// One quantity of the simulation over its range, everything else as it was.
struct Sweep {
  /// One value of the quantity, and the simulation with it.
  struct Point {
    double value = 0;   ///< On the plot's axis.
    std::string label;  ///< For people: "2 deg, 5 mm".
    SimulationSettings settings;
  };
  std::string name, axis;  ///< "noise", "noise of each coordinate [px]".
  std::vector<Point> points;
};

/// The names there are: visible-fraction, noise, spurious, missing, filled, start, focal, calibration, deformation.
std::vector<std::string> sweepNames();

/// The sweep of that name about `base`; `all` of them for "all". A sweep of the calibration needs two views and takes
/// them. Throws InputError that lists the names there are.
std::vector<Sweep> sweepsNamed(const std::string& name, const SimulationSettings& base);

/// Runs a sweep: {"name": ..., "quantity": ..., "points": [{"value": x, "label": ..., "summaries": by method}]}.
Json runSweep(const SimulationSetup& setup, const Sweep& sweep, const Progress& progress = {});

/// For people, Markdown.
std::string sweepTable(const Json& swept);

}  // namespace angio::evaluation
