// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/catheter_runs.hpp"

#include <algorithm>
#include <cmath>

#include "angio/perception/catheter_registration.hpp"
#include "angio/perception/registration_gate.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "simulation_claims.hpp"
#include "simulation_image.hpp"

namespace angio::evaluation {
namespace {

constexpr double kPeriod_s = 0.5, kBreath_s = 4.5;
constexpr double kShortestRoute_m = 80e-3;
constexpr double kStep_m = 0.5e-3;      // Along the vessels.
constexpr double kBeside_m = 25e-3;     // The catheter's way beside the axis goes to and fro with this times 2 pi.
constexpr Eigen::Index kMinPoints = 6;  // A shorter curve is no frame.

// A catheter's way through a tree, and how it lies beside the vessels' axes.
class Way {
 public:
  Way(const TreeTopology& map, int leaf, const Eigen::Vector3d& sine_m, const Eigen::Vector3d& cosine_m)
      : map_(map), path_(map.pathTo(leaf)), sine_m_(sine_m), cosine_m_(cosine_m) {}

  double length_m() const { return map_.start_m(path_.back()) + map_.length_m(path_.back()); }

  // The curve of a catheter whose tip is so far from the root, as far as the detector sees it, root side first.
  Eigen::Matrix2Xd seenTo(double tip_m, const XrayCamera& camera, const Pose& T_camera_model, double spacing_px) const {
    std::vector<Eigen::Vector2d> line;
    for (double at_m = 0; at_m <= tip_m; at_m += kStep_m) {
      const auto pixel = camera.project(T_camera_model * pointAt(at_m));
      if (!pixel || !camera.sees(*pixel)) continue;
      if (line.empty() || (*pixel - line.back()).norm() >= spacing_px) line.push_back(*pixel);
    }
    Eigen::Matrix2Xd result(2, static_cast<Eigen::Index>(line.size()));
    for (std::size_t k = 0; k < line.size(); ++k) result.col(static_cast<Eigen::Index>(k)) = line[k];
    return result;
  }

 private:
  Eigen::Vector3d pointAt(double at_m) const {
    int branch = path_.front();
    for (const int next : path_) {
      if (map_.start_m(next) <= at_m) branch = next;
    }
    const double phase = at_m / kBeside_m;
    return map_.point({branch, at_m - map_.start_m(branch)}) + std::sin(phase) * sine_m_ + std::cos(phase) * cosine_m_;
  }

  const TreeTopology& map_;
  std::vector<int> path_;
  Eigen::Vector3d sine_m_, cosine_m_;
};

std::vector<int> longRoutes(const TreeTopology& map) {
  std::vector<int> leaves;
  for (int branch = 0; branch < map.branchCount(); ++branch) {
    if (map.children(branch).empty() && map.start_m(branch) + map.length_m(branch) >= kShortestRoute_m) {
      leaves.push_back(branch);
    }
  }
  return leaves;
}

Eigen::Matrix3Xd columnsOf(const Eigen::Matrix3Xd& points, const std::vector<int>& which) {
  Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(which.size()));
  for (std::size_t k = 0; k < which.size(); ++k) result.col(static_cast<Eigen::Index>(k)) = points.col(which[k]);
  return result;
}

// Of a 2D normal error, the squares of the distances that 90 and 99.73 % stay within.
constexpr double kAcrossNinety2 = 4.605, kAcrossBeyond2 = 11.83;
constexpr Eigen::Index kEveryPoint = 3;  // That is asked.

// What is claimed of the vessels that the catheter does not lie in.
std::optional<CatheterRunFrame::Beside> besideOf(const RegisteredByCatheter& by, const VesselTree& tree,
                                                 const SimulatedTrial& trial, const Pose& truth) {
  const double enough_m = 1e-3 * RegistrationGateSettings().max_target_std_mm;
  std::vector<bool> of_catheter(static_cast<std::size_t>(tree.size()), false);
  for (const int i : by.tree_points) of_catheter[static_cast<std::size_t>(i)] = true;
  CatheterRunFrame::Beside sum;
  int count = 0;
  for (Eigen::Index i = 0; i < tree.size(); i += kEveryPoint) {
    const Eigen::Vector3d p = tree.points().col(i);
    if (of_catheter[static_cast<std::size_t>(i)]) continue;
    const PatientObservation seen = observationAt(p, by, tree);
    if (!(seen.worstStdAcross_m(p) <= enough_m)) continue;
    const Eigen::Matrix<double, 2, 3> across = acrossRay(seen.placeAt(p));
    const Eigen::Vector2d off = across * (truth * (p + trial.displacements_m.col(i)) - seen.placeAt(p));
    const Eigen::Matrix2d claimed = across * seen.pointCovariance(p) * across.transpose();
    const double squared = off.dot(claimed.inverse() * off);
    sum.plane_in += squared <= kAcrossNinety2;
    sum.beyond += squared > kAcrossBeyond2;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return CatheterRunFrame::Beside{sum.plane_in / count, sum.beyond / count};
}

// What a frame's result says of the vessels that it is of, against the truth.
CatheterRunFrame judged(const RegisteredByCatheter& by, const VesselTree& tree, const SimulatedTrial& trial,
                        const Pose& truth, const XrayCamera& camera) {
  CaseOutcome outcome;
  outcome.result = by.result;
  addClaims(by.vessels, false, outcome);
  CatheterRunFrame frame;
  frame.registered = true;
  frame.converged = isConverged(outcome);
  const auto& uses = outcome.usable_for;
  frame.for_centre = std::find(uses.begin(), uses.end(), "centre") != uses.end();
  if (!frame.converged) return frame;
  // Both as displacements of the vessels as they were given.
  RegistrationResult found = by.result;
  const Eigen::Matrix3Xd given = by.vessels.points();
  found.displacements_m = columnsOf(tree.points() + by.result.displacements_m, by.tree_points) - given;
  SimulatedTrial real;
  real.truth = truth;
  real.displacements_m = columnsOf(tree.points() + trial.displacements_m, by.tree_points) - given;
  outcome.claim = frame.claim = claimOf(by.vessels, found, real);
  frame.wrong = isConvergedAndWrong(outcome);
  frame.beside = besideOf(by, tree, trial, truth);
  frame.across_m =
      poseError(by.vessels, camera, {found.T_camera_model, found.displacements_m}, {real.truth, real.displacements_m})
          .in_plane_m;
  return frame;
}

}  // namespace

std::vector<CatheterRunFrame> catheterRun(const VesselTree& tree, const CatheterRunSettings& settings, int index) {
  SimulationSettings drawn;
  drawn.seed = settings.seed;
  drawn.rotation_std_deg = settings.rotation_std_deg;
  drawn.translation_std_mm = settings.translation_std_mm;
  drawn.deformation_rms_mm = settings.deformation_rms_mm;
  SimulatedTrial trial = simulatedTrial(tree, {}, drawn, index);
  if (trial.displacements_m.cols() == 0) trial.displacements_m.setZero(3, tree.size());
  const TreeTopology map(VesselTree(tree.points() + trial.displacements_m, tree.parents(), tree.radii()));
  const std::vector<int> leaves = longRoutes(map);
  std::vector<CatheterRunFrame> frames;
  if (leaves.empty()) return frames;

  SimulationRandom random(settings.seed, index, DrawFor::kCatheter);
  const int leaf = leaves[static_cast<std::size_t>(random.uniform() * static_cast<double>(leaves.size()))];
  const double beside_m = 1e-3 * settings.beside_mm / std::sqrt(2.0);
  const Eigen::Vector3d sine_m = beside_m * random.normals<3>(), cosine_m = beside_m * random.normals<3>();
  const Way way(map, leaf, sine_m, cosine_m);
  const double first_m = way.length_m() * random.uniform(0.4, 0.6), last_m = 0.98 * way.length_m();
  const double phase = random.uniform(0, 2 * kPi);
  const XrayCamera& camera = trial.cameras.front();
  CatheterRegistration registration({}, tree);
  for (int k = 0; k < settings.frames; ++k) {
    const double share = settings.frames > 1 ? static_cast<double>(k) / (settings.frames - 1) : 0;
    const double breath_m = 1e-3 * settings.breath_mm * std::sin(phase + 2 * kPi * k * kPeriod_s / kBreath_s);
    const Pose truth = trial.truth * Eigen::Translation3d(0, 0, breath_m);
    Eigen::Matrix2Xd seen = way.seenTo(first_m + share * (last_m - first_m), camera, truth, settings.spacing_px);
    for (auto point : seen.colwise()) point += settings.noise_px * random.normals<2>();
    if (seen.cols() < kMinPoints) {
      frames.emplace_back();
      continue;
    }
    const std::vector<int> one_branch(static_cast<std::size_t>(seen.cols()), 0);
    const Centerline2d curve = makeCenterline(seen, one_branch);
    const auto by = registration.observe({curve, camera}, trial.start, std::llround(1e6 * kPeriod_s * k));
    registration.learn();
    frames.push_back(by ? judged(*by, tree, trial, truth, camera) : CatheterRunFrame());
  }
  return frames;
}

}  // namespace angio::evaluation
