// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate hand-eye: where the camera sits on the machine, and the object (or the patient's model) in its frame.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/carm_files.hpp"
#include "angio/calibration/hand_eye_simulation.hpp"
#include "angio/calibration/pose_pictures.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"
#include "angio/results/statistics.hpp"
#include "calibrate.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct HandEyeOptions {
  std::string poses, carm, out, moveit, visp, setup = "eye_in_hand", board = "9x6", write_poses, reference, report;
  double square_mm = 23.6;
  bool known_mount = false, compare = false, reprojection = false;
  HandEyeSettings settings;
  int trials = 0, seed = 1;
  OrbitSettings orbit;
};

Chessboard boardOf(const HandEyeOptions& o) {
  Chessboard board;
  char end = 0;
  if (std::sscanf(o.board.c_str(), "%dx%d%c", &board.columns, &board.rows, &end) != 2 || board.columns < 3 ||
      board.rows < 3 || board.columns > 100 || board.rows > 100) {
    throw InputError("", "board", o.board, "must be inner corners in a row x in a column, each 3 to 100: 9x6");
  }
  board.square_m = 1e-3 * o.square_mm;
  return board;
}

PoseSet posesOf(const HandEyeOptions& o, const std::optional<CArmFile>& carm) {
  if (!o.moveit.empty()) {
    return readMoveItSamples(o.moveit, o.setup == "eye_to_hand" ? HandEyeSetup::kEyeToHand : HandEyeSetup::kEyeInHand);
  }
  if (!o.visp.empty()) return readVispFolder(o.visp, boardOf(o));
  if (o.poses.empty())
    throw InputError("", "POSES", "", "is missing: a pose set, --moveit, --visp or --simulate-trials");
  return readPoseSet(o.poses, carm ? &carm->carm : nullptr);
}

std::string residualsText(const HandEyeResiduals& r) {
  return formatted("%.4f deg, %.3f mm", radToDeg(r.rotation_rad), 1e3 * r.translation_m);
}

// Of the poses that have points, hands taken as exact.
std::string reprojectionText(const HandEyeResult& result) {
  double squares = 0, poses = 0;
  for (const HandEyePoseFit& pose : result.poses) {
    if (pose.outlier || pose.reprojection_px == 0) continue;
    squares += pose.reprojection_px * pose.reprojection_px;
    ++poses;
  }
  return poses > 0 ? formatted(", %.2f px", std::sqrt(squares / poses)) : "";
}

// How far two poses are apart.
struct Apart {
  double rotation_deg, translation_mm;
};
Apart apart(const Pose& a, const Pose& b) {
  return {radToDeg(rotationAngle(a.linear() * b.linear().transpose())),
          1e3 * (a.translation() - b.translation()).norm()};
}

// For a person: values with sigmas, residuals, condition, weak directions, outliers.
std::string handEyeTable(const PoseSet& set, const HandEyeSettings& settings, const HandEyeResult& result,
                         bool patient) {
  const auto [X, Z] = transformNames(set.setup);
  const Eigen::Index size = result.covariance.rows();
  std::string table;
  if (settings.mount == HandEyeMount::kUnknown) {
    table += transformRow(X, result.transforms.X, result.covariance.topLeftCorner<6, 6>());
  }
  table +=
      transformRow(patient ? "T_dsa_cb" : Z, result.transforms.Z, result.covariance.block(size - 6, size - 6, 6, 6));
  table += formatted("poses           %zu, %d outliers", set.poses.size(), result.outliers());
  for (const HandEyePoseFit& pose : result.poses) {
    if (!pose.outlier) continue;
    table +=
        formatted("; %s (%.2f deg, %.2f mm)", pose.name.c_str(), radToDeg(pose.rotation_rad), 1e3 * pose.translation_m);
  }
  table += "\nresidual, rms   " + residualsText(result.residuals) + reprojectionText(result) + "\n";
  if (result.held_out) table += "held out, rms   " + residualsText(*result.held_out) + "\n";
  table += formatted("noise           %s: %.4f deg, %.3f mm per axis; chi2 per degree of freedom %.2f\n",
                     result.noise_given ? "given, and seen" : "measured", radToDeg(result.noise.rotation_rad),
                     1e3 * result.noise.translation_m, result.chi2_per_freedom);
  if (result.scale)
    table += formatted("scale           %.4f +- %.4f of the camera's translations against the hands'\n",
                       result.scale->value, result.scale->sigma);
  const CalibrationRecord record = handEyeRecord(set, settings, result);
  table += formatted("condition       %.3g\n", record.condition);
  for (const WeakDirection& weak : record.weak_directions) {
    table += formatted("weak            %s: +- %.3g %s\n", weak.name.c_str(), weak.sigma, weak.unit.c_str());
  }
  return table;
}

// X against a pose of a file.
std::string referenceTable(const std::string& path, HandEyeSetup setup, const HandEyeResult& result) {
  const Pose reference = readPose(path).T_camera_model;
  const Apart off = apart(result.transforms.X, reference);
  return formatted("reference       %s is %.3f mm (%.2f %% of its length) and %.4f deg (%.2f %% of its angle) off\n",
                   transformNames(setup).first.c_str(), off.translation_mm,
                   0.1 * off.translation_mm / reference.translation().norm(), off.rotation_deg,
                   100 * off.rotation_deg / radToDeg(rotationAngle(reference.linear())));
}

// Other solvers' residuals on the same poses, and how far their X is from the result.
std::string comparisonTable(const PoseSet& set, const HandEyeResult& result) {
  HandEyeEquations equations;
  const HandEyeEquations all = handEyeEquations(set);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!result.poses[i].outlier) equations.add(all.hands[i], all.cameras[i]);
  }
  std::string table = "\nsolver               residual [deg]  residual [mm]  both [rad, m]  X from ours [deg]  [mm]\n";
  const auto row = [&](const std::string& name, const HandEyeTransforms& t) {
    const HandEyeResiduals r = handEyeResiduals(equations, t);
    const Apart off = apart(t.X, result.transforms.X);
    table += formatted("%-20s %14.4f %14.3f %14.6f %18.4f %5.2f\n", name.c_str(), radToDeg(r.rotation_rad),
                       1e3 * r.translation_m,
                       std::sqrt((r.rotation_rad * r.rotation_rad + r.translation_m * r.translation_m) / 2),
                       off.rotation_deg, off.translation_mm);
  };
  row("angio", result.transforms);
  for (const ComparedSolver& other : compareSolvers(equations)) {
    if (other.transforms) {
      row(other.name, *other.transforms);
    } else {
      table += formatted("%-20s %s\n", other.name.c_str(), other.failure.c_str());
    }
  }
  return table;
}

// Both transforms and the record, for set-ups that are no C-arm.
void writeHandEyeFile(const std::string& path, const PoseSet& set, const HandEyeSettings& settings,
                      const HandEyeResult& result, const CalibrationRecord& record) {
  const auto [X, Z] = transformNames(set.setup);
  nlohmann::ordered_json file = {{"setup", setupName(set.setup)}};
  if (!set.machine.empty()) file["machine"] = set.machine;
  if (settings.mount == HandEyeMount::kUnknown) {
    file[X] = poseAsJson(result.transforms.X, Matrix6d(result.covariance.topLeftCorner<6, 6>()));
  }
  file[Z] = poseAsJson(result.transforms.Z, Matrix6d(result.covariance.bottomRightCorner<6, 6>()));
  file["calibration"][record.kind] = recordAsJson(record);
  writeWholeFile(path, asYaml(file));
}

void writeHandEyeReport(const std::string& folder, const PoseSet& set, const HandEyeResult& result,
                        const std::string& table) {
  writeReport(folder, "Hand-eye calibration", set.path,
              {{"Pictures",
                "",
                {{"residuals.png", "Each pose against its prediction", poseResiduals(result)},
                 {"axes.png", "Axes that the hand turned about between any two poses: a calibration wants them spread",
                  turnAxes(set)},
                 {"covariance.png", "Axes of the covariance's ellipsoids and their directions in the parent frame",
                  covarianceBars(set, result)}}},
               {"Numbers", printed(table), {}}});
}

void writeResult(const HandEyeOptions& o, const std::optional<CArmFile>& carm, const PoseSet& set,
                 const HandEyeResult& result) {
  CalibrationRecord record = handEyeRecord(set, o.settings, result);
  if (!carm) {
    writeHandEyeFile(o.out, set, o.settings, result, record);
    return;
  }
  record.inputs.push_back(hashedInput(o.carm));
  writeCArmFile(o.out, withPatient(*carm, result.transforms.Z, record));
}

// Errors of many trials, as a row of a table.
struct Errors {
  std::vector<double> X_deg, X_mm, Z_deg, Z_mm;

  void add(const Eigen::Matrix<double, 12, 1>& error) {
    X_mm.push_back(1e3 * error.segment<3>(0).norm());
    X_deg.push_back(radToDeg(error.segment<3>(3).norm()));
    Z_mm.push_back(1e3 * error.segment<3>(6).norm());
    Z_deg.push_back(radToDeg(error.segment<3>(9).norm()));
  }
  std::string row(const std::string& name) const {
    const auto both = [](const std::vector<double>& v) {
      return formatted("  %8.4f (%8.4f)", percentile(v, 0.5), percentile(v, 0.95));
    };
    if (Z_mm.empty()) return formatted("%-24s  fails\n", name.c_str());
    return formatted("%-24s", name.c_str()) + both(Z_deg) + both(Z_mm) + both(X_deg) + both(X_mm) + "\n";
  }
};

// Our row, and whether the covariance says how far off it is.
std::pair<std::string, std::string> trialsWith(HandEyeMount mount, const std::string& name, const CArmGeometry& carm,
                                               const HandEyeOptions& o) {
  HandEyeSettings settings = o.settings;
  settings.mount = mount;
  ProgressBar bar("calibrating", o.trials);
  Errors errors;
  double nees = 0;
  for (const HandEyeTrial& trial :
       handEyeTrials(carm, o.orbit, settings, o.trials, o.seed, [&](int done) { bar.show(done, name); })) {
    errors.add(trial.error);
    nees += trial.nees / o.trials;
  }
  const double freedom = mount == HandEyeMount::kUnknown ? 12 : 6;
  const double band = 1.96 * std::sqrt(2 * freedom / o.trials);
  return {errors.row(name), formatted("NEES, %s: %.2f, %.0f by theory (95 %% band %.2f to %.2f)\n", name.c_str(), nees,
                                      freedom, freedom - band, freedom + band)};
}

std::string otherSolvers(const CArmGeometry& carm, const HandEyeOptions& o) {
  ProgressBar bar("other solvers", o.trials);
  std::vector<std::pair<std::string, Errors>> others;
  for (int trial = 0; trial < o.trials; ++trial) {
    const SimulatedPoseSet simulated = simulatedOrbit(carm, o.orbit, o.seed + trial);
    for (const ComparedSolver& other : compareSolvers(handEyeEquations(simulated.set))) {
      auto at =
          std::find_if(others.begin(), others.end(), [&](const auto& entry) { return entry.first == other.name; });
      if (at == others.end()) at = others.insert(others.end(), {other.name, {}});
      if (other.transforms) at->second.add(errorOf(*other.transforms, simulated.truth));
    }
    bar.show(trial + 1);
  }
  std::string rows;
  for (const auto& [name, errors] : others) rows += errors.row(name);
  return rows;
}

// Errors over simulated trials, and with --compare those of the other solvers.
int simulateHandEye(const HandEyeOptions& o, const CArmGeometry& carm) {
  const auto known = trialsWith(HandEyeMount::kIdentity, "angio, mount known", carm, o);
  std::pair<std::string, std::string> unknown;
  if (o.settings.mount == HandEyeMount::kUnknown) {
    unknown = trialsWith(HandEyeMount::kUnknown, "angio, mount estimated", carm, o);
  }
  std::cout << formatted(
                   "%d trials of %d poses, LAO/RAO %g deg + CRA/CAU %g deg, noise %g deg, %g mm per axis; median (95th "
                   "percentile)\n",
                   o.trials, o.orbit.poses, o.orbit.max_primary_deg, o.orbit.max_secondary_deg,
                   o.orbit.camera_noise_deg, o.orbit.camera_noise_mm)
            << formatted("%-24s  %-19s  %-19s  %-19s  %-19s\n", "solver", "T_dsa_cb [deg]", "T_dsa_cb [mm]",
                         "mount [deg]", "mount [mm]")
            << known.first << unknown.first << (o.compare ? otherSolvers(carm, o) : "") << known.second
            << unknown.second;
  return 0;
}

int runHandEye(HandEyeOptions o) {
  const ClaimedOutputs claimed(o.out, o.report);
  requireFolderOf(o.write_poses);
  if (o.known_mount) o.settings.mount = HandEyeMount::kIdentity;
  if (o.reprojection) o.settings.residual = HandEyeResidual::kReprojection;
  std::optional<CArmFile> carm;
  if (!o.carm.empty()) carm = readCArmFile(o.carm);
  if (o.trials > 0) return simulateHandEye(o, carm ? carm->carm : CArmGeometry());
  const PoseSet set = posesOf(o, carm);
  if (carm) requirePosesOf(set, o.carm, *carm);
  if (!o.write_poses.empty()) writePoseSet(o.write_poses, set);
  const HandEyeResult result = carm ? calibratePatient(set, o.settings) : calibrateHandEye(set, o.settings);
  if (!o.out.empty()) writeResult(o, carm, set, result);
  const std::string table = handEyeTable(set, o.settings, result, carm.has_value());
  if (!o.report.empty()) writeHandEyeReport(o.report, set, result, table);
  std::cout << table;
  if (!o.reference.empty()) std::cout << referenceTable(o.reference, set.setup, result);
  if (o.compare) std::cout << comparisonTable(set, result);
  for (const std::string& warning : result.warnings)
    std::cerr << "angio-calibrate: warning: " << set.path << ": " << warning << "\n";
  return 0;
}

void addSimulation(cli::Command& command, HandEyeOptions& o) {
  auto* group = command.addGroup("Simulation", "Instead of poses: a C-arm's orbit LAO/RAO + CRA/CAU");
  group->addOption("--simulate-trials", o.trials, "So many simulated sets; prints errors against the truth")
      ->check(cli::wholeBetween(0, 100000));
  group->addOption("--simulate-poses", o.orbit.poses, "Poses of each")->check(cli::wholeBetween(1, 1000));
  group->addOption("--noise-deg", o.orbit.camera_noise_deg, "Of the camera's poses, per axis")->check(between(0, 45));
  group->addOption("--noise-mm", o.orbit.camera_noise_mm, "Of the camera's poses, per axis")->check(between(0, 1000));
  group->addOption("--hand-noise-deg", o.orbit.hand_noise_deg, "Of the C-arm's angles")->check(between(0, 45));
  group->addOption("--hand-noise-mm", o.orbit.hand_noise_mm, "Of the C-arm's place")->check(between(0, 1000));
  group->addOption("--lao-deg", o.orbit.max_primary_deg, "The orbit goes to LAO and RAO of this")
      ->check(between(0, 120));
  group->addOption("--cra-deg", o.orbit.max_secondary_deg, "and to CRA and CAU of this; 0: a single axis")
      ->check(between(0, 60));
}

}  // namespace

void addCalibrateHandEye(cli::Command& app, Work& work) {
  const auto o = std::make_shared<HandEyeOptions>();
  auto* command =
      app.addSubcommand("hand-eye", "Where the camera sits on the machine, and the model in the patient's frame");
  command->footer(
      "Examples:\n  angio-calibrate hand-eye poses.yaml --carm carm.yaml --out lab.yaml\n"
      "  angio-calibrate hand-eye poses.yaml --compare\n"
      "  angio-calibrate hand-eye --simulate-trials 200");
  command->addOption("poses", o->poses, "Pose set (poses.yaml)");
  command->addOption("--carm", o->carm,
                     "C-arm file (.yaml): hands may be angles, and the result is this file with T_dsa_cb");
  command->addOption("--out", o->out, "Result (.yaml)");
  command->addOption("--report", o->report, "Folder for pictures and a page (index.html)");
  command->addFlag("--known-mount", o->known_mount,
                   "The hand is the camera, as the C-arm file has it: one pose is enough");
  command->addFlag("--reprojection", o->reprojection, "Refine on the object's points in the images");
  command->addFlag("--compare", o->compare, "Also what OpenCV's and ViSP's solvers say of the same poses");
  command->addOption("--reference", o->reference,
                     "Pose (.yaml: rotation, translation_mm) to compare the camera's place with");
  command->addOption("--min-turn-deg", o->settings.min_turn_deg, "Turns about a second axis (rms) below this are none")
      ->check(between(1e-6, 90));
  command->addOption("--outlier-gate", o->settings.outlier_gate, "Poses further off than so many sigma are left out")
      ->check(between(2, 100));
  command->addOption("--seed", o->seed, "Of all draws")->check(cli::wholeBetween(0, 1000000000));
  auto* imports = command->addGroup("Imports", "Poses of other programs; --write-poses makes a pose set of them");
  imports->addOption("--moveit", o->moveit, "Samples of MoveIt's calibration (.json)");
  imports->addOption("--setup", o->setup, "of these: eye_in_hand or eye_to_hand")
      ->check(cli::oneOf({"eye_in_hand", "eye_to_hand"}));
  imports->addOption("--visp", o->visp, "Folder of ViSP's eye-in-hand data: franka_image-1.png, ...");
  imports->addOption("--board", o->board, "Inner corners of its chessboard");
  imports->addOption("--square-mm", o->square_mm, "Side of its squares")->check(between(0.01, 1000));
  imports->addOption("--write-poses", o->write_poses, "Pose set (.yaml) of what was read");
  addSimulation(*command, *o);
  command->onChosen([o, &work] {
    o->settings.seed = o->seed;
    work = [o] { return runHandEye(*o); };
  });
}

}  // namespace angio::apps
