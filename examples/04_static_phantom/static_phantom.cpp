// SPDX-License-Identifier: GPL-2.0-or-later
// How does a method do on real frames, and when it is wrong, does it know? Four runs of a static phantom, each from
// many starts around a reference pose.
//
// There is no truth, but there are the C-arm's angles: the phantom did not turn, so two runs' poses must differ by the
// rotation between their views, and that is how their nominal poses differ. Each run is registered without knowledge of
// the others.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "angio/base/errors.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/registration/starts.hpp"
#include "angio/results/case_run.hpp"
#include "angio/results/statistics.hpp"
#include "angio/vessel/projection.hpp"
#include "angio/vessel/resample.hpp"
#include "program_settings.hpp"

namespace {

// The angles hold to about a degree between the runs, and a pose that is reversed in depth is 3 deg off and more.
constexpr double kRight_deg = 2, kWrong_deg = 3, kGoodResidual_px = 2, kSameDepth_mm = 3;

struct Options {
  std::string cases = angio::cli::exampleDataFile("static-phantom/cases.yaml");
  std::string method = angio::registration::OrientedKernelSettings::kName, settings;
  int starts = 20, seed = 7;
  double rotation_deg = 10, translation_mm = 20;
  bool image = false, nonrigid = false;
};

// One run, and what was found in it from one start.
struct Run {
  angio::io::Case setup;
  angio::vessel::Centerline2d centerline;
  angio::vessel::VesselTree tree,
      fine_tree;  // As it is, and with points so near each other that the nearest one will do.
  double reference_residual_px = 0;
};

struct Found {
  angio::registration::RegistrationStatus status;
  angio::geometry::Pose T_camera_model;
  double residual_px;  // Median, from image points to the projected tree.
  double off_deg;      // From the reference pose.
  double time_s;
  // Of a nonrigid fit: from the rigid one of the same start, and its claim.
  double depth_off_m = 0, depth_std_m = 0;
  bool depth_known = false;  // A loop may move by it: the task `view` takes the result.
  double rotation_off = 0;   // In the standard deviations that it claims.

  bool trusted() const { return status == angio::registration::RegistrationStatus::kConverged; }
};

double angleDegrees(const angio::geometry::Pose& a, const angio::geometry::Pose& b) {
  return angio::geometry::radToDeg(angio::geometry::rotationAngle(a.linear() * b.linear().transpose()));
}

// The rotation from one view to the other, as the poses have it.
angio::geometry::Pose between(const angio::geometry::Pose& T_a_model, const angio::geometry::Pose& T_b_model) {
  return T_b_model * T_a_model.inverse();
}

// How far the tree's centroid, displaced with it, lies from where a rigid fit has it along the beam; and what is
// claimed.
void compareDepth(const Run& run, const angio::registration::RegistrationResult& rigid,
                  const angio::registration::RegistrationResult& r, Found& found) {
  const Eigen::Vector3d centroid = run.tree.centroid();
  Eigen::Vector3d displaced = centroid;
  if (r.displacements_m.cols() > 0) displaced += r.displacements_m.rowwise().mean();
  found.depth_off_m = (r.T_camera_model * displaced - rigid.T_camera_model * centroid).z();
  if (!r.covariance) return;
  const angio::perception::PatientObservation seen{r.T_camera_model, *r.covariance, r.points};
  found.depth_std_m = seen.depthStd_m(centroid);
  angio::results::CaseOutcome outcome;
  outcome.result = r;
  angio::results::addClaims(run.tree, false, outcome);
  const std::vector<std::string>& tasks = outcome.usable_for;
  found.depth_known = std::find(tasks.begin(), tasks.end(), "view") != tasks.end();
  const Eigen::Vector3d w = angio::geometry::logSE3(r.T_camera_model * rigid.T_camera_model.inverse()).tail<3>();
  found.rotation_off = std::sqrt(w.dot(r.covariance->bottomRightCorner<3, 3>().ldlt().solve(w)));
}

double median(const std::vector<double>& values) { return angio::results::percentile(values, 0.5); }
double worst(const std::vector<double>& values) { return angio::results::percentile(values, 1); }

double medianResidual(const Run& run, const angio::vessel::VesselTree& fine_tree,
                      const angio::geometry::Pose& T_camera_model) {
  const auto projected = angio::vessel::projectedCenterline(fine_tree, run.setup.views[0].camera, T_camera_model);
  if (projected.size() == 0) return std::numeric_limits<double>::infinity();
  std::vector<double> distances;
  for (int j = 0; j < run.centerline.size(); ++j) {
    const Eigen::Vector2d q = run.centerline.points_px.col(j);
    distances.push_back(std::sqrt((projected.points_px.colwise() - q).colwise().squaredNorm().minCoeff()));
  }
  return distances.empty() ? std::numeric_limits<double>::infinity() : median(distances);
}

// What is known of a start that is anywhere in the box: the spread of a uniform distribution.
angio::geometry::Matrix6d covarianceOfBox(const Options& o) {
  angio::geometry::Vector6d variance;
  variance.head<3>().setConstant(std::pow(o.translation_mm * 1e-3, 2) / 3);
  variance.tail<3>().setConstant(std::pow(angio::geometry::degToRad(o.rotation_deg), 2) / 3);
  return variance.asDiagonal();
}

angio::vessel::VesselTree fine(const angio::vessel::VesselTree& tree) {
  return angio::vessel::resampled(tree, 0.5e-3, 100000).tree;
}

std::vector<Run> readRuns(const Options& o, const angio::imaging::ExtractorSettings& extractor) {
  std::vector<Run> runs;
  for (angio::io::Case& setup : angio::io::readCaseSet(o.cases).cases) {
    if (!setup.truth_pose) throw angio::base::InputError(o.cases, "truth_pose", "", "every case must have a reference");
    const angio::io::View& view = setup.views[0];
    const auto& path = o.image ? view.image_path : view.centerline_path;
    if (!path)
      throw angio::base::InputError(o.cases, o.image ? "image" : "centerline", "", "is missing in " + setup.name);
    auto seen = o.image
                    ? angio::imaging::makeExtractor(extractor)->extract(angio::io::readXrayImage(*path, view.camera))
                    : angio::io::readCenterline(*path);
    angio::vessel::VesselTree tree = angio::io::readVesselTree(setup.tree_path);
    angio::vessel::VesselTree fine_tree = fine(tree);
    Run& run = runs.emplace_back(Run{std::move(setup), std::move(seen), std::move(tree), std::move(fine_tree)});
    run.reference_residual_px = medianResidual(run, run.fine_tree, *run.setup.truth_pose);
  }
  return runs;
}

// Rows are runs, columns are starts.
std::vector<std::vector<Found>> findAll(const Options& o, const angio::apps::ProgramSettings& settings,
                                        const std::vector<Run>& runs) {
  angio::registration::StartSettings box = settings.starts;
  box.box_rotation_deg = o.rotation_deg;
  box.box_translation_mm = o.translation_mm;
  angio::registration::StartSettings draws = box;
  draws.seed = o.seed;  // Not the search's own draws.
  angio::cli::ProgressBar bar("registering", static_cast<int>(runs.size()) * o.starts);
  std::vector<std::vector<Found>> found;
  for (const Run& run : runs) {
    using angio::registration::Deformation;
    const auto registration = angio::registration::makeRegistration(
        settings.of(o.method, o.nonrigid ? std::optional(Deformation::kNonrigid) : std::nullopt), run.tree);
    const auto rigid = o.nonrigid
                           ? angio::registration::makeRegistration(settings.of(o.method, Deformation::kRigid), run.tree)
                           : nullptr;
    auto& row = found.emplace_back();
    for (int i = 0; i < o.starts; ++i) {
      const int index = static_cast<int>(found.size() - 1) * o.starts + i;
      const angio::geometry::Pose start =
          angio::registration::drawnStart({*run.setup.truth_pose, {}}, run.tree.centroid(), draws, index);
      const auto r = registration->search(run.centerline, run.setup.views[0].camera, {start, covarianceOfBox(o)}, box);
      const angio::vessel::VesselTree found_tree =
          r.displacements_m.cols() > 0 ? fine({run.tree.points() + r.displacements_m, run.tree.parents()})
                                       : run.fine_tree;
      row.push_back({r.status, r.T_camera_model, medianResidual(run, found_tree, r.T_camera_model),
                     angleDegrees(r.T_camera_model, *run.setup.truth_pose), r.times.total_s});
      if (rigid) {
        compareDepth(run, rigid->search(run.centerline, run.setup.views[0].camera, {start, covarianceOfBox(o)}, box), r,
                     row.back());
      }
      bar.show(index + 1);
    }
  }
  return found;
}

void printRuns(const std::vector<Run>& runs, const std::vector<std::vector<Found>>& found) {
  std::printf(
      "| run | right | converged | ambiguous | diverged | trusted and wrong | wrong below %g px | residual [px], "
      "median "
      "(worst) | the reference's | from reference [deg], median (worst) | ms, median |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
      kGoodResidual_px);
  for (std::size_t k = 0; k < runs.size(); ++k) {
    int right = 0, by_status[4] = {}, false_trust = 0, trap = 0;
    std::vector<double> residual_px, off_deg, time_ms;
    for (const Found& f : found[k]) {
      const bool good = f.residual_px<kGoodResidual_px, wrong = f.off_deg> kWrong_deg;
      right += good && f.off_deg <= kRight_deg;
      ++by_status[static_cast<int>(f.status)];
      false_trust += f.trusted() && wrong;
      trap += good && wrong;
      residual_px.push_back(f.residual_px);
      off_deg.push_back(f.off_deg);
      time_ms.push_back(1e3 * f.time_s);
    }
    std::printf("| %s | %d of %zu | %d | %d | %d | %d | %d | %.2f (%.2f) | %.2f | %.2f (%.1f) | %.0f |\n",
                runs[k].setup.name.c_str(), right, found[k].size(), by_status[0], by_status[1],
                by_status[2] + by_status[3], false_trust, trap, median(residual_px), worst(residual_px),
                runs[k].reference_residual_px, median(off_deg), worst(off_deg), median(time_ms));
  }
}

void printPairs(const std::vector<Run>& runs, const std::vector<std::vector<Found>>& found) {
  std::printf(
      "\n| pair | angle by the C-arm [deg] | references off [deg] | found off [deg], median (worst) | within %g deg | "
      "both "
      "trusted | of those within %g deg |\n| --- | --- | --- | --- | --- | --- | --- |\n",
      kRight_deg, kRight_deg);
  for (std::size_t a = 0; a < runs.size(); ++a) {
    for (std::size_t b = a + 1; b < runs.size(); ++b) {
      const angio::geometry::Pose nominal = between(runs[a].setup.initial_pose, runs[b].setup.initial_pose);
      const double reference_deg = angleDegrees(between(*runs[a].setup.truth_pose, *runs[b].setup.truth_pose), nominal);
      int within = 0, trusted = 0, trusted_within = 0;
      std::vector<double> off_deg;
      for (std::size_t i = 0; i < found[a].size(); ++i) {
        off_deg.push_back(angleDegrees(between(found[a][i].T_camera_model, found[b][i].T_camera_model), nominal));
        const bool near = off_deg.back() <= kRight_deg, both = found[a][i].trusted() && found[b][i].trusted();
        within += near;
        trusted += both;
        trusted_within += near && both;
      }
      std::printf("| %s, %s | %.1f | %.2f | %.2f (%.1f) | %d of %zu | %d | %d |\n", runs[a].setup.name.c_str(),
                  runs[b].setup.name.c_str(), angleDegrees(nominal, angio::geometry::Pose::Identity()), reference_deg,
                  median(off_deg), worst(off_deg), within, off_deg.size(), trusted, trusted_within);
    }
  }
}

// The phantom is rigid, and so its depth in a nonrigid fit must be the rigid fit's, or be said to be unknown.
void printDepths(const std::vector<Run>& runs, const std::vector<std::vector<Found>>& found) {
  std::printf(
      "\n| run | depth from the rigid fit's [mm], median (worst) | claimed [mm], median | within %g mm | further, and "
      "said to be unknown: no use for `view` | neither | further, and within 3 of the claimed standard deviations | "
      "rotation from the rigid fit's, in the standard deviations claimed, median (worst) |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- |\n",
      kSameDepth_mm);
  for (std::size_t k = 0; k < runs.size(); ++k) {
    int near = 0, said = 0, wrong = 0, within_claim = 0;
    std::vector<double> off_mm, claimed_mm, rotation_off;
    for (const Found& f : found[k]) {
      off_mm.push_back(1e3 * std::abs(f.depth_off_m));
      claimed_mm.push_back(1e3 * f.depth_std_m);
      rotation_off.push_back(f.rotation_off);
      const bool within = off_mm.back() <= kSameDepth_mm;
      near += within;
      said += !within && !f.depth_known;
      wrong += !within && f.depth_known;
      within_claim += !within && off_mm.back() <= 3 * claimed_mm.back();
    }
    std::printf("| %s | %.2f (%.1f) | %.2f | %d of %zu | %d | %d | %d | %.2f (%.1f) |\n", runs[k].setup.name.c_str(),
                median(off_mm), worst(off_mm), median(claimed_mm), near, off_mm.size(), said, wrong, within_claim,
                median(rotation_off), worst(rotation_off));
  }
}

angio::apps::ProgramSettings settingsOf(const Options& o) {
  angio::apps::ProgramSettings settings;
  const auto data_settings = std::filesystem::path(o.cases).parent_path() / "settings.yaml";  // What suits the frames.
  if (std::filesystem::exists(data_settings)) settings = angio::io::readSettings(data_settings.string(), settings);
  if (!o.settings.empty()) settings = angio::io::readSettings(o.settings, settings);
  return settings;
}

int measure(const Options& o) {
  const angio::apps::ProgramSettings settings = settingsOf(o);
  const std::vector<Run> runs = readRuns(o, settings.extractors.chosen());
  const auto found = findAll(o, settings, runs);
  std::printf("%s, %d starts a run, uniform in +-%g deg and +-%g mm about and along each axis\n\n", o.method.c_str(),
              o.starts, o.rotation_deg, o.translation_mm);
  printRuns(runs, found);
  printPairs(runs, found);
  if (o.nonrigid) printDepths(runs, found);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  angio::cli::Command app("Measures a method on the four runs of the static phantom.", "example-04-static-phantom");
  angio::cli::describeProgram(app, "example-04-static-phantom --method oriented_kernel --starts 20");
  Options o;
  app.addOption("--cases", o.cases,
                "Case set whose nominal poses differ as the C-arm's angles do, with reference poses");
  app.addOption("--method", o.method, "Registration method");
  angio::cli::addSettingsOptions(app, o.settings, "Settings (.yaml) over those beside the case set",
                                 [&o](const std::string&) { return angio::io::settingsAsYaml(settingsOf(o)); });
  app.addOption("--starts", o.starts, "Starts a run")->check(angio::cli::wholeBetween(1, 10000));
  app.addOption("--seed", o.seed, "Seed of the starts")->check(angio::cli::wholeBetween(0, 2147483647));
  app.addOption("--rotation-deg", o.rotation_deg, "Starts lie so far from the reference, per axis")
      ->check(angio::cli::between(0, 180));
  app.addOption("--translation-mm", o.translation_mm, "Starts lie so far from the reference, per axis")
      ->check(angio::cli::between(0, 1000));
  app.addFlag("--nonrigid", o.nonrigid, "Let the tree bend, and say what becomes of the depth");
  app.addFlag("--image", o.image, "Extract the centrelines from the frames");
  return angio::cli::runProgram(app, argc, argv, [&] { return measure(o); });
}
