// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/simulation_run.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/paper.hpp"
#include "angio/evaluation/simulation_report.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

CaseOutcome trialOutcome(double start_mm, double end_mm, RegistrationStatus status = RegistrationStatus::kConverged) {
  CaseOutcome o;
  o.result.status = status;
  o.start_error = PoseError{};
  o.start_error->mtre_m = 1e-3 * start_mm;
  o.error = PoseError{};
  o.error->mtre_m = 1e-3 * end_mm;
  o.error->mpd_px = 10 * end_mm;
  o.error->mpd_isocenter_m = 2e-3 * end_mm;
  return o;
}

// Of the first entrant, as values: they outlive the runs.
std::vector<CaseOutcome> outcomesOf(const SimulationSetup& setup, const SimulationSettings& settings) {
  return runSimulation(setup, settings).front().outcomes;
}

std::vector<CaseOutcome> inBin(int bin, int good, int bad) {
  std::vector<CaseOutcome> outcomes;
  for (int i = 0; i < good; ++i) outcomes.push_back(trialOutcome(bin + 0.5, 0.1));
  for (int i = 0; i < bad; ++i) outcomes.push_back(trialOutcome(bin + 0.5, 5));
  return outcomes;
}

TEST(CaptureRange, IsTheFarthestBinThatSucceeds) {
  std::vector<CaseOutcome> all;
  const auto add = [&](const std::vector<CaseOutcome>& more) { all.insert(all.end(), more.begin(), more.end()); };
  add(inBin(0, 20, 0));
  add(inBin(3, 19, 1));  // 95 %.
  add(inBin(5, 18, 2));  // 90 %: the first that does not.
  add(inBin(7, 40, 1));
  add(inBin(9, 9, 0));    // Too few to say anything.
  add(inBin(25, 50, 0));  // Beyond what the figure covers.
  const CaptureBins bins = captureBins(all);
  EXPECT_EQ(bins.trials[3], 20);
  EXPECT_EQ(bins.successes[5], 18);
  EXPECT_EQ(bins.range_mm(), 8);
  EXPECT_EQ(bins.unbroken_range_mm(), 4);
  EXPECT_FALSE(captureBins({}).range_mm());
  EXPECT_FALSE(captureBins(inBin(0, 5, 20)).range_mm());
}

// Brown, Cai and DasGupta (2001) and any table: 8 of 10 has 49.0 to 94.3 %.
TEST(ShareBound, IsWilsons) {
  const ShareBounds bounds = shareBounds(8, 10);
  EXPECT_NEAR(bounds.low, 0.4902, 1e-4);
  EXPECT_NEAR(bounds.high, 0.9433, 1e-4);
  EXPECT_NEAR(shareBounds(0, 10).low, 0, 1e-12);
  EXPECT_GT(shareBounds(0, 10).high, 0.2);
  EXPECT_EQ(shareBounds(0, 0).high, 1);
}

TEST(SimulationSummary, HasEveryFigureOfTheTrade) {
  const auto s = simulationSummary(
      {trialOutcome(5, 0.1), trialOutcome(5, 1), trialOutcome(5, 4), trialOutcome(5, 9, RegistrationStatus::kDiverged)},
      0.3e-3);
  EXPECT_EQ(s["success_mtre_2mm_percent"], 50);
  EXPECT_EQ(s["failed_and_trusted_percent"], 25);
  EXPECT_EQ(s["failed_and_noticed_percent"], 25);
  EXPECT_EQ(s["gfr_true_5px_percent"], 75);            // 1, 10, 40 and 90 px.
  EXPECT_EQ(s["gfr_true_isocentre_5mm_percent"], 50);  // 0.2, 2, 8 and 18 mm.
  EXPECT_NEAR(s["mpd_detector_mm"]["max"], 27, 1e-9);  // 90 px of 0.3 mm.
  EXPECT_NEAR(s["mpd_isocentre_mm"]["max"], 18, 1e-9);
  EXPECT_TRUE(s["capture_range_mm"].is_null());
  EXPECT_FALSE(simulationSummary({trialOutcome(5, 0.1)}, {}).contains("mpd_detector_mm"));
}

// What holds on average may fail where fits are poor.
TEST(SimulationSummary, HoldsClaimsAgainstTheTruthInQuartersOfTheFitsScores) {
  std::vector<CaseOutcome> outcomes;
  for (int i = 0; i < 16; ++i) {
    const int turn = i * 5 % 16;  // Not in their order.
    CaseOutcome o = trialOutcome(5, 1);
    o.result.alignment.model_explained = 1 - 0.05 * turn;
    o.result.alignment.image_explained = 1;
    const bool poor = turn >= 12;
    o.claim = CaseOutcome::Claim{};
    o.claim->beyond = turn == 15 ? 0.2 : 0;
    o.claim->depth_in = poor ? 0.5 : 1;
    o.claim->plane_in = 0.9;
    outcomes.push_back(o);
  }
  const auto quarters = simulationSummary(outcomes, {})["claims_by_quarter"];
  ASSERT_EQ(quarters.size(), 4u);
  EXPECT_NEAR(quarters[0]["depth_in_90_percent"], 100, 1e-9);
  EXPECT_NEAR(quarters[2]["lowest_score"], 1 - 0.05 * 11, 1e-9);
  EXPECT_NEAR(quarters[3]["depth_in_90_percent"], 50, 1e-9);
  EXPECT_NEAR(quarters[3]["plane_in_90_percent"], 90, 1e-9);
  EXPECT_NEAR(quarters[2]["converged_and_wrong_percent"], 0, 1e-9);
  EXPECT_NEAR(quarters[3]["converged_and_wrong_percent"], 25, 1e-9);
  outcomes.resize(10);
  EXPECT_TRUE(simulationSummary(outcomes, {})["claims_by_quarter"].is_null()) << "too few";
}

class SimulationRuns : public testing::Test {
 protected:
  SimulationRuns() {
    settings_.trials = 4;
    settings_.rotation_std_deg = 0.5;
    settings_.translation_std_mm = 1;
    IterativePnpSettings prior;
    prior.prior = PriorForm::kCovariance;
    setup_.trees = {test::branchingTree(2), test::branchingTree(9, {0.01, 0.02, 0})};
    setup_.entrants = {{"iterative_pnp", prior, {}}, {"again", prior, {}}};
  }

  SimulationSettings settings_;
  SimulationSetup setup_;
};

TEST_F(SimulationRuns, AllEntrantsSeeTheSameTrials) {
  int done = 0;
  const auto runs = runSimulation(setup_, settings_, [&](int now) { done = now; });
  EXPECT_EQ(done, 8);
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[1].name, "again");
  for (std::size_t i = 0; i < 4; ++i) {
    const CaseOutcome &a = runs[0].outcomes[i], &b = runs[1].outcomes[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.start_error->mtre_m, b.start_error->mtre_m);
    EXPECT_EQ(a.result.T_camera_model.matrix(), b.result.T_camera_model.matrix());
    // From a millimetre or two, clean views: either tree is found at its own truth.
    EXPECT_LT(a.error->mtre_m, kSuccessMtre_m) << i;
  }
  const auto summaries = simulationSummaries(runs, 0.3e-3);
  EXPECT_EQ(summaries["again"]["time_p50_relative"]["to"], "iterative_pnp");
  EXPECT_EQ(summaries["iterative_pnp"]["time_p50_relative"]["ratio"], 1);
  EXPECT_NE(simulationTable(summaries).find("| again | 100 %"), std::string::npos) << simulationTable(summaries);
}

// What is not filled must not draw the search: with half of the tree empty, one territory, all but one or two of 40 are
// found; and none is wrong and trusted.
TEST_F(SimulationRuns, AHalfFilledTreeIsFound) {
  setup_.trees = {test::branchingTree(6), test::branchingTree(9, {0.01, 0.02, 0})};
  setup_.entrants = {{"oriented_kernel", OrientedKernelSettings(), {}}};
  settings_.trials = 40;
  settings_.filled = 0.5;
  settings_.noise_px = 1;
  settings_.spurious = 5;
  settings_.rotation_std_deg = 5;
  settings_.translation_std_mm = 10;
  int found = 0, trusted = 0;
  for (const CaseOutcome& o : outcomesOf(setup_, settings_)) {
    const bool right = o.error->mtre_m < kSuccessMtre_m;
    found += right;
    trusted += !right && o.result.status == RegistrationStatus::kConverged;
  }
  EXPECT_GE(found, 38);
  EXPECT_EQ(trusted, 0);
}

// A part of the liver's tree is in view, and its pose is known to a box only. Poses that have little of the tree in
// view, where the image is dense, would score best if the image's length were not asked for: of these 8 trials 3 were
// lost.
TEST_F(SimulationRuns, APartInViewIsFoundInABox) {
  setup_.trees = {readVesselTree(ANGIO_EXAMPLE_DATA "/hepatic-tace/tree.csv")};
  StartSettings box;
  box.box_rotation_deg = 45;
  box.box_translation_mm = 60;
  setup_.entrants = {{"oriented_kernel", OrientedKernelSettings(), box}};
  settings_.trials = 8;
  settings_.visible_fraction = 0.6;
  settings_.noise_px = 1;
  settings_.spurious = 5;
  settings_.rotation_std_deg = 15;
  settings_.translation_std_mm = 20;
  for (const CaseOutcome& o : outcomesOf(setup_, settings_)) EXPECT_LT(o.error->mtre_m, kSuccessMtre_m);
}

// Share of the tree's points that lie beyond what is claimed, over trials that converged; and how many did.
struct Beyond {
  double mean = 0;
  int converged = 0;
};

Beyond beyond(const SimulationSetup& setup, const SimulationSettings& settings) {
  Beyond found;
  for (const CaseOutcome& o : outcomesOf(setup, settings)) {
    if (o.result.status != RegistrationStatus::kConverged) continue;
    found.mean += o.claim.value().beyond;
    ++found.converged;
  }
  found.mean /= std::max(1, found.converged);
  return found;
}

// The claim of the paper's method, whose covariance knows of no deformation, does not hold for a deformed tree.
TEST_F(SimulationRuns, ClaimsAreHeldAgainstTheTruth) {
  settings_.trials = 8;
  settings_.deformation_rms_mm = 1;
  double sum = 0;
  for (const CaseOutcome& o : outcomesOf(setup_, settings_)) sum += o.claim.value().beyond / 8;
  EXPECT_GT(sum, 0.5);
}

// A rigid fit says how much the tree may be deformed: it converges where the image holds it, and its covariance holds
// for deformed trees as for rigid ones. Of a tree deformed by 3 mm nothing converges that is wrong.
TEST_F(SimulationRuns, ARigidFitOfADeformedTreeSaysSo) {
  setup_.trees = {test::branchingTree(6), test::branchingTree(9, {0.01, 0.02, 0})};
  setup_.entrants = {{"oriented_kernel", OrientedKernelSettings(), {}}};
  settings_.trials = 30;
  settings_.noise_px = 1;
  settings_.spurious = 5;
  const Beyond rigid = beyond(setup_, settings_);
  EXPECT_EQ(rigid.converged, 30);
  EXPECT_LT(rigid.mean, 0.02);
  settings_.deformation_rms_mm = 0.5;
  const Beyond little = beyond(setup_, settings_);
  EXPECT_GE(little.converged, 15);
  EXPECT_LT(little.mean, 0.05);
  settings_.deformation_rms_mm = 3;
  EXPECT_LT(beyond(setup_, settings_).mean, 0.05);
}

TEST_F(SimulationRuns, CertifiedTrialsSayWhatIsProven) {
  setup_.entrants = {{"oriented_kernel", OrientedKernelSettings(), {}}};
  setup_.certificate.emplace();
  setup_.certificate->box_rotation_deg = 10;
  setup_.certificate->box_translation_mm = 15;
  setup_.certificate->seconds = 60;  // Ends after one or two; sanitizers are slow.
  settings_.trials = 2;
  const auto runs = runSimulation(setup_, settings_);
  for (const CaseOutcome& o : runs.front().outcomes) {
    EXPECT_TRUE(o.certificate.value().proven) << o.certificate->reason;
    EXPECT_FALSE(o.certificate_false);
  }
  EXPECT_NE(simulationTable(simulationSummaries(runs, 0.3e-3)).find("certificate proven"), std::string::npos);
  settings_.views = 2;
  EXPECT_NE(test::refusalOf([&] { runSimulation(setup_, settings_); }).find("views = 2"), std::string::npos);
}

TEST_F(SimulationRuns, NoTreeIsRefused) {
  setup_.trees.clear();
  EXPECT_NE(test::refusalOf([&] { runSimulation(setup_, settings_); }).find("trees"), std::string::npos);
}

TEST_F(SimulationRuns, EverySweepChangesWhatItSays) {
  const auto sweeps = sweepsNamed("all", settings_);
  ASSERT_EQ(sweeps.size(), sweepNames().size());
  for (const auto& sweep : sweeps) {
    ASSERT_GE(sweep.points.size(), 5u) << sweep.name;
    for (std::size_t i = 1; i < sweep.points.size(); ++i) {
      const SimulatedTrial a = simulatedTrial(setup_.trees[0], {}, sweep.points[i - 1].settings, 0);
      const SimulatedTrial b = simulatedTrial(setup_.trees[0], {}, sweep.points[i].settings, 0);
      EXPECT_EQ(a.truth.matrix(), b.truth.matrix());
      const bool same_image = a.centerlines[0].points_px.cols() == b.centerlines[0].points_px.cols() &&
                              a.centerlines[0].points_px == b.centerlines[0].points_px;
      EXPECT_FALSE(same_image && a.start.isApprox(b.start) &&
                   a.cameras[0].parameters().fx_px == b.cameras[0].parameters().fx_px &&
                   a.T_view_first.back().isApprox(b.T_view_first.back(), 1e-9))
          << sweep.name << ", " << sweep.points[i].label;
    }
  }
  EXPECT_NE(test::refusalOf([&] { sweepsNamed("luck", settings_); }).find("visible-fraction"), std::string::npos);
}

TEST_F(SimulationRuns, TheReportStandsAlone) {
  settings_.trials = 2;
  setup_.entrants[1].name = "<b> & co";
  const auto runs = runSimulation(setup_, settings_);
  const auto summaries = simulationSummaries(runs, {});
  Sweep sweep = sweepsNamed("noise", settings_)[0];
  sweep.points.resize(2);
  const std::vector<Json> swept = {runSweep(setup_, sweep)};
  const std::string page = simulationReportHtml(
      {setup_, settings_, runs, summaries, swept, {{"simulation", {{"x", 1}}}}, {"a"}, machineAsJson()});
  EXPECT_EQ(page.find("<!DOCTYPE html>"), 0u);
  EXPECT_EQ(page.find("http"), std::string::npos) << "nothing from outside";
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_EQ(page.find("<b>"), std::string::npos);
  EXPECT_NE(page.find("&lt;b&gt; &amp; co"), std::string::npos);
  EXPECT_NE(page.find("data:image/png;base64,iVBORw0KGgo"), std::string::npos);
  const auto& time = summaries.begin().value()["time_ms"]["total"];
  EXPECT_NE(page.find(formatted("%.1f ms median, %.1f ms p99", time["p50"].get<double>(), time["p99"].get<double>())),
            std::string::npos);
  EXPECT_EQ(page.find("nan"), page.find("nance")) << "no figure that is not a number";
  for (const char* tag : {"svg", "figure", "section", "table", "div"}) {
    const auto count = [&](const std::string& what) {
      std::size_t n = 0;
      for (std::size_t at = page.find(what); at != std::string::npos; at = page.find(what, at + 1)) ++n;
      return n;
    };
    EXPECT_EQ(count(std::string("<") + tag + " ") + count(std::string("<") + tag + ">"),
              count(std::string("</") + tag + ">"))
        << tag;
  }
}

TEST(Paper, ATrialWithoutAnAnswerIsAFailure) {
  EntrantRun run{"m", {trialOutcome(5, 0.1), trialOutcome(5, 9, RegistrationStatus::kTooFewPoints)}};
  run.outcomes[0].projection_residual_px = 2;
  const auto paper = paperAsJson({run}, {});
  const auto& f = paper["table1"]["here"]["m"];
  EXPECT_EQ(f["gfr_percent"], 50);
  EXPECT_NEAR(f["mean_pr_mm"], 0.6, 1e-12);  // 2 px of 0.30 mm.
  const std::string table = paperTable1(paper);
  // The paper prints no pose errors there, but in Table III.
  EXPECT_NE(table.find("| paper: Iterative PnP, rigid | 4 % | 0.39 | 0.84 | 0.56 | 16.9 | - | - | - |"),
            std::string::npos)
      << table;
  const std::string table3 = paperTable3(paperAsJson({run}, {{paperTable1Start(), {run}}}));
  EXPECT_NE(table3.find("| paper: Iterative PnP | 0.43 | 0 % | 0.46 deg, 7.09 mm | - | - |"), std::string::npos)
      << table3;
  EXPECT_NE(table.find("| m | 50 % | 0.60 |"), std::string::npos) << table;
}

// Two points 40 px apart, each 5 px from its image point; a third one is off the detector, and counts as well.
TEST(Paper, ResidualIsOfAllProjectedPoints) {
  const XrayCamera camera = test::clinicalCamera();
  const double depth_m = 0.7, pixel_m = depth_m / camera.parameters().fx_px;
  const auto at = [&](double u_px, double v_px) {
    const auto& c = camera.parameters();
    return Eigen::Vector3d((u_px - c.cx_px) * pixel_m, (v_px - c.cy_px) * depth_m / c.fy_px, depth_m);
  };
  Eigen::Matrix3Xd points(3, 3);
  points << at(100, 100), at(140, 100), at(-50, 100);
  Eigen::Matrix2Xd image(2, 2);
  image << 103, 143, 104, 104;
  const Centerline2d centerline = makeCenterline(image, {0, 0});
  const auto residual_px = projectionResidual_px(points, Pose::Identity(), {centerline, camera});
  ASSERT_TRUE(residual_px);
  EXPECT_NEAR(*residual_px, std::sqrt((25 + 25 + 153 * 153 + 16) / 3.0), 1e-9);

  points.col(2).z() = -depth_m;
  EXPECT_FALSE(projectionResidual_px(points, Pose::Identity(), {centerline, camera}));
}

TEST(SvgPlots, SurviveSeriesWithNothingToShow) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const bool log : {false, true}) {
    for (const auto& values :
         std::vector<std::vector<double>>{{}, {3}, {0}, {nan}, {-1, -1}, {inf, nan, 2}, {5e-324, 1}, {1e-300, 1e300}}) {
      Plot plot;
      plot.x.log = plot.y.log = log;
      plot.series.push_back({"s", values, values});
      const std::string svg = svgPlot(plot);
      EXPECT_EQ(svg.find("nan"), std::string::npos) << svg;
      EXPECT_EQ(svg.find("inf"), std::string::npos) << svg;
      EXPECT_LT(svg.size(), 100000u);
    }
  }
}

}  // namespace
}  // namespace angio::test
