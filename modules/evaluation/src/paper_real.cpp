// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/paper_real.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/registration/starts.hpp"
#include "angio/results/columns.hpp"

namespace angio::evaluation {
namespace {

constexpr double kGrossFailureReal_mm = 5;

// Table II as printed; no time where it prints none.
struct PrintedRealRow {
  const char* name;
  double gfr_percent, median_pr_mm, p95_pr_mm, p75_pr_mm;
  std::optional<double> time_ms;
};
constexpr PrintedRealRow kPrintedTable2[] = {{"AutoMask", 100, 17.01, 29.75, 23.26, 150302.2},
                                             {"Pair-wise DNN", 100, 153.25, 437.24, 168.60, 529.0},
                                             {"RGRB", 100, 5.99, 38.85, 12.16, {}},
                                             {"DT-ICP", 16, 4.68, 31.22, 9.613, 13.2},
                                             {"NICP", 56, 3.49, 37.09, 10.52, 385.1},
                                             {"Iterative PnP", 11, 3.74, 29.92, 10.34, 16.9}};

std::vector<Column<CaseOutcome>> realColumns() {
  using Outcome = const CaseOutcome&;
  const auto answered = [](Outcome o) {
    return o.result.status != RegistrationStatus::kTooFewPoints && o.result.alignment.model_points > 0;
  };
  // Of the projected points on the detector: those beside it have no image.
  const auto pr_mm = [=](Outcome o) {
    return answered(o) ? Json(1e3 * o.pixel_at_isocenter_m * o.result.alignment.model_rms_px) : Json(nullptr);
  };
  const auto image_mm = [=](Outcome o) {
    return answered(o) ? Json(1e3 * o.pixel_at_isocenter_m * o.result.alignment.image_residual_px) : Json(nullptr);
  };
  // A result without an answer is a failure, whatever the field says.
  const auto fails = [](const Json& value_mm) { return value_mm.is_null() || !(value_mm <= kGrossFailureReal_mm); };
  return {
      {"", "gfr_percent", "percent", [=](Outcome o) { return fails(pr_mm(o)); }},
      {"", "median_pr_mm", "median", pr_mm},
      {"", "p75_pr_mm", "p75", pr_mm},
      {"", "p95_pr_mm", "p95", pr_mm},
      {"", "image_gfr_percent", "percent", [=](Outcome o) { return fails(image_mm(o)); }},
      {"", "image_median_mm", "median", image_mm},
      {"", "converged_percent", "percent", [](Outcome o) { return o.result.status == RegistrationStatus::kConverged; }},
      {"", "time_ms", "median", [](Outcome o) { return 1e3 * (o.image_s + o.result.times.total_s); }}};
}

// Only where there is a reference: a figure of nothing would be a zero.
std::vector<Column<CaseOutcome>> referenceColumns() {
  using Outcome = const CaseOutcome&;
  return {{"", "median_in_plane_mm", "median", [](Outcome o) { return 1e3 * o.error->in_plane_m; }},
          {"", "in_plane_ok_percent", "percent", [](Outcome o) { return o.error->in_plane_m < kSuccessMtre_m; }}};
}

}  // namespace

CaseSet withDrawnStarts(const CaseSet& set, double rotation_std_deg, double translation_std_mm, int count, int seed) {
  CaseSet drawn;
  for (const Case& one : set.cases) {
    if (!one.truth_pose) throw InputError("cases", "truth_pose", "", "must be there in " + one.name);
    const Eigen::Vector3d centroid = readVesselTree(one.tree_path).centroid();
    for (int i = 0; i < count; ++i) {
      Case& copy = drawn.cases.emplace_back(one);
      copy.name = one.name + ", " + std::to_string(i + 1);
      const int index = static_cast<int>(drawn.cases.size()) - 1;
      copy.initial_pose =
          drawnPose(*one.truth_pose, centroid, degToRad(rotation_std_deg), 1e-3 * translation_std_mm, seed, index);
    }
  }
  return drawn;
}

CaseSet seenByImages(CaseSet set) {
  for (Case& one : set.cases) {
    for (View& view : one.views) view.centerline_path.reset();
  }
  return set;
}

std::vector<Entrant> ableToRun(const RealCases& cases, const std::vector<Entrant>& entrants) {
  std::vector<Entrant> able;
  for (const Entrant& entrant : entrants) {
    if (cases.has_images || !imageNeeded(entrant.registration)) able.push_back(entrant);
  }
  return able;
}

RealRuns runRealCases(const RealCases& cases, const std::vector<Entrant>& entrants, const ExtractorSettings& extractor,
                      const Progress& progress, Campaign* campaign) {
  CaseSet each = cases.set;
  each.sequence = false;
  RealRuns result{cases.name, {}};
  int done = 0;
  for (const Entrant& entrant : ableToRun(cases, entrants)) {
    CaseRunSettings settings{entrant.registration, entrant.starts, extractor};
    settings.campaign = campaign;
    result.runs.push_back({entrant.name, runCases(each, settings, [&](int) {
                             if (progress) progress(++done);
                           })});
  }
  return result;
}

Json paperTable2AsJson(const std::vector<RealRuns>& all) {
  Json json;
  for (const auto& row : kPrintedTable2) {
    json["paper"][row.name] = {{"gfr_percent", row.gfr_percent},
                               {"median_pr_mm", row.median_pr_mm},
                               {"p95_pr_mm", row.p95_pr_mm},
                               {"p75_pr_mm", row.p75_pr_mm},
                               {"time_ms", row.time_ms ? Json(*row.time_ms) : Json(nullptr)}};
  }
  json["here"] = Json::array();
  for (const RealRuns& set : all) {
    Json methods = Json::object();
    for (const auto& run : set.runs) {
      summarise(run.outcomes, realColumns(), methods[run.name]);
      const bool known = std::all_of(run.outcomes.begin(), run.outcomes.end(),
                                     [](const CaseOutcome& o) { return o.error.has_value(); });
      if (known) summarise(run.outcomes, referenceColumns(), methods[run.name]);
    }
    const std::size_t count = set.runs.empty() ? 0 : set.runs.front().outcomes.size();
    json["here"].push_back({{"name", set.name}, {"registrations", count}, {"methods", methods}});
  }
  return json;
}

std::string paperTable2(const Json& table2) {
  std::string table =
      "Table II: real images. The paper's 278 in-vivo frames are not public; ours are others\n\n"
      "| images | method | GFR, PR > 5 mm | median PR [mm] | 95 % | 75 % | image to model > 5 mm | its median [mm] | "
      "in-plane error, median [mm] | below 2 mm | converged | ms |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const auto& [name, row] : table2["paper"].items()) {
    table += "| the paper's | " + name +
             filled(
                 " | {gfr_percent:%.0f %%} | {median_pr_mm:%.2f} | {p95_pr_mm:%.2f} | {p75_pr_mm:%.2f} | - | - | - | - "
                 "| - | {time_ms:%.1f} |\n",
                 row);
  }
  for (const Json& set : table2["here"]) {
    for (const auto& [name, f] : set["methods"].items()) {
      table += "| " + set["name"].get<std::string>() + " | " + name +
               filled(
                   " | {gfr_percent:%.0f %%} | {median_pr_mm:%.2f} | {p95_pr_mm:%.2f} | {p75_pr_mm:%.2f} | "
                   "{image_gfr_percent:%.0f %%} | {image_median_mm:%.2f} | {median_in_plane_mm:%.2f} | "
                   "{in_plane_ok_percent:%.0f %%} | {converged_percent:%.0f %%} | {time_ms:%.1f} |\n",
                   f);
    }
  }
  return table +
         "PR: rms distance of the projected points on the detector from the nearest image point, at the depth of the "
         "tree. It is small for a wrong pose, and large for a right one where the image shows a part of the tree only: "
         "of a catheter the distance from the image to the model says more. The phantom's tree was made from these "
         "images, so that it fits them better than a CT's would. Its reference poses are fits to them. The clinical "
         "run "
         "has no ground truth.\n";
}

}  // namespace angio::evaluation
