// SPDX-License-Identifier: GPL-2.0-or-later
#include "outputs.hpp"

#include <algorithm>
#include <cmath>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/pose_pictures.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"
#include "report_folder.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

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

}  // namespace

std::string transformRow(const std::string& name, const Pose& T, const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  const Eigen::Vector3d t = 1e3 * T.translation(), w = radToDeg(1) * logSO3(T.linear());
  std::string row = formatted("%-15s", name.c_str());
  for (int k = 0; k < 3; ++k) row += formatted("  %9.3f +- %-7.3f", t[k], 1e3 * sigma[k]);
  row += " mm\n" + std::string(15, ' ');
  for (int k = 0; k < 3; ++k) row += formatted("  %9.4f +- %-7.4f", w[k], radToDeg(sigma[3 + k]));
  return row + " deg (rotation vector; sigma of turns about the parent's axes)\n";
}

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

std::string referenceTable(const std::string& path, HandEyeSetup setup, const HandEyeResult& result) {
  const Pose reference = readPose(path).T_camera_model;
  const Apart off = apart(result.transforms.X, reference);
  return formatted("reference       %s is %.3f mm (%.2f %% of its length) and %.4f deg (%.2f %% of its angle) off\n",
                   transformNames(setup).first.c_str(), off.translation_mm,
                   0.1 * off.translation_mm / reference.translation().norm(), off.rotation_deg,
                   100 * off.rotation_deg / radToDeg(rotationAngle(reference.linear())));
}

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

void writeHandEyeFile(const std::string& path, const PoseSet& set, const HandEyeSettings& settings,
                      const HandEyeResult& result, const CalibrationRecord& record) {
  const auto [X, Z] = transformNames(set.setup);
  Json file = {{"setup", setupName(set.setup)}};
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

void writePatient(const std::string& path, CArmFile carm, const Pose& T_dsa_cb, const CalibrationRecord& record) {
  carm.T_dsa_cb = T_dsa_cb;
  if (carm.machine.empty()) carm.machine = record.machine;
  const auto old = std::find_if(carm.records.begin(), carm.records.end(),
                                [&](const CalibrationRecord& other) { return other.kind == record.kind; });
  if (old != carm.records.end()) {
    *old = record;
  } else {
    carm.records.push_back(record);
  }
  writeCArmFile(path, carm);
}

}  // namespace angio::apps
