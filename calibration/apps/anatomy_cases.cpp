// SPDX-License-Identifier: GPL-2.0-or-later
#include "anatomy_cases.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"

namespace angio::apps {
namespace {

AnatomyAngleSet anglesOf(const AnatomyAsked& asked, const CaseSet& set, std::vector<std::string>& input_paths) {
  const auto beside = std::filesystem::path(asked.cases).parent_path() / "angles.yaml";
  if (!asked.angles.empty() || std::filesystem::exists(beside)) {
    input_paths.push_back(asked.angles.empty() ? beside.string() : asked.angles);
    return readAnatomyAngles(input_paths.back());
  }
  AnatomyAngleSet angles;
  for (const Case& one : set.cases) {
    const auto& image = one.views.front().image_path;
    if (!image || !isDicom(*image)) {
      throw InputError(asked.cases, "cases", one.name,
                       "has no angles: --angles, angles.yaml beside the case set, or a DICOM image");
    }
    angles.views.push_back(dicomAngles(one.name, *image));
    input_paths.push_back(*image);
  }
  return angles;
}

AnatomyView viewOf(const AnatomyCases& cases, const CaseOutcome& outcome) {
  const auto& all = cases.angles.views;
  const AnatomyAngles& angles =
      *std::find_if(all.begin(), all.end(), [&](const auto& view) { return view.name == outcome.name; });
  CArmGeometry carm = cases.carm ? cases.carm->carm : CArmGeometry();
  if (angles.source_isocenter_distance_m) {
    carm.source_isocenter_distance_m = *angles.source_isocenter_distance_m;
  } else if (!cases.carm) {
    throw InputError(cases.input_paths[1], "source_isocentre_distance_mm", outcome.name,
                     "is missing; --carm would tell");
  }
  AnatomyView view;
  view.name = outcome.name;
  view.run = angles.run;
  view.T_camera_patient = carm.T_camera_patient(angles.joints);
  CArmJoints at_zero = angles.joints;
  at_zero.tail<3>().setZero();
  view.isocenter_camera_m = carm.T_camera_patient(at_zero).translation();
  view.T_camera_model = outcome.result.T_camera_model;
  view.covariance = *outcome.result.covariance;
  return view;
}

SeenAnatomy seenIn(const View& view) {
  if (view.centerline_path) return {readCenterline(*view.centerline_path), view.camera};
  const cv::Mat image = readXrayImage(*view.image_path, view.camera);
  return {vesselsToMatch(makeExtractor(ExtractorSettings())->extract(image)), view.camera};
}

// T_dsa_cb, the shifts of the runs and the record, where there is no C-arm file.
void writePatientFile(const std::string& path, const Pose& T_dsa_cb, const AnatomyResult& result,
                      const CalibrationRecord& record) {
  nlohmann::ordered_json file;
  if (!record.machine.empty()) file["machine"] = record.machine;
  file["T_dsa_cb"] = poseAsJson(T_dsa_cb, result.covariance);
  for (const RunShift& run : result.runs) {
    nlohmann::ordered_json shift = nlohmann::ordered_json::array(), sigma = nlohmann::ordered_json::array();
    for (int k = 0; k < 3; ++k) {
      shift.push_back(1e3 * run.shift_m[k]);
      sigma.push_back(1e3 * std::sqrt(run.covariance(k, k)));
    }
    file["runs"].push_back({{"name", run.run}, {"shift_mm", shift}, {"std_mm", sigma}});
  }
  file["calibration"][record.kind] = recordAsJson(record);
  writeWholeFile(path, asYaml(file));
}

}  // namespace

AnatomyCases readAnatomyCases(const AnatomyAsked& asked) {
  CaseSet set = readCaseSet(asked.cases);
  std::vector<std::string> input_paths{asked.cases};
  AnatomyAngleSet angles = anglesOf(asked, set, input_paths);
  std::optional<CArmFile> carm;
  if (!asked.carm.empty()) {
    carm = readCArmFile(asked.carm);
    input_paths.push_back(asked.carm);
  }
  const std::string tree_path = set.cases.front().tree_path;
  for (const Case& one : set.cases) {
    if (one.tree_path != tree_path) throw InputError(asked.cases, "tree", one.name, "must be the same in all cases");
    const auto& views = angles.views;
    if (std::none_of(views.begin(), views.end(), [&](const auto& view) { return view.name == one.name; })) {
      throw InputError(input_paths[1], "views", one.name, "is missing: every case must have its angles");
    }
  }
  input_paths.push_back(tree_path);
  return {std::move(set), readVesselTree(tree_path), std::move(angles), std::move(carm), std::move(input_paths)};
}

RegisteredAnatomy registerViews(const AnatomyCases& cases, const AnatomyAsked& asked, const Progress& progress) {
  CaseRunSettings how;
  how.registration = registrationSettingsNamed(asked.method);
  how.starts.count = startsOfPreset(asked.method);
  how.starts.box_rotation_deg = asked.search_rotation_deg;
  how.starts.box_translation_mm = asked.search_translation_mm;
  RegisteredAnatomy found;
  found.outcomes = runCases(cases.set, how, progress);
  for (std::size_t i = 0; i < found.outcomes.size(); ++i) {
    const CaseOutcome& outcome = found.outcomes[i];
    if (!outcome.result.covariance || outcome.result.status == RegistrationStatus::kDiverged) {
      found.left_out += (found.left_out.empty() ? "" : ", ") + outcome.name + " (" + outcome.result.reason + ")";
      continue;
    }
    const View& view = cases.set.cases[i].views.front();
    found.seen.views.push_back(viewOf(cases, outcome));
    found.seen.seen.push_back(seenIn(view));
    found.seen.image_paths.push_back(view.image_path);
  }
  return found;
}

AnatomyResult anatomyOf(const SeenViews& seen, const VesselTree& tree, const AnatomyAsked& asked) {
  const AnatomyResult result = registerAnatomy(seen.views, tree.centroid(), asked.settings);
  return asked.refine ? refineAnatomy(result, seen.views, seen.seen, tree, asked.settings) : result;
}

std::vector<LeftOutView> leaveOneOut(const AnatomyResult& all, const SeenViews& seen, const VesselTree& tree,
                                     const AnatomyAsked& asked) {
  std::vector<LeftOutView> left_out;
  for (std::size_t i = 0; i < seen.views.size(); ++i) {
    SeenViews others = seen;
    others.views.erase(others.views.begin() + i);
    others.seen.erase(others.seen.begin() + i);
    const AnatomyResult result = anatomyOf(others, tree, asked);
    const AnatomyView& view = seen.views[i];
    const Eigen::Matrix3d predicted = view.T_camera_patient.linear() * result.T_dsa_cb.linear();
    left_out.push_back({view.name, rotationAngle(view.T_camera_model.linear() * predicted.transpose()),
                        rotationAngle(result.T_dsa_cb.linear() * all.T_dsa_cb.linear().transpose())});
  }
  return left_out;
}

Pose patientOf(const AnatomyResult& result, const AnatomyAsked& asked) {
  if (asked.run.empty()) return result.T_dsa_cb;
  for (const RunShift& shift : result.runs) {
    if (shift.run == asked.run) return Eigen::Translation3d(shift.shift_m) * result.T_dsa_cb;
  }
  throw InputError("", "run", asked.run, "must be one of the angles' runs");
}

void writeAnatomy(const std::string& path, const AnatomyCases& cases, const AnatomyAsked& asked,
                  const AnatomyResult& result) {
  const CalibrationRecord record = anatomyRecord(result, cases.angles.machine, cases.input_paths);
  const Pose T_dsa_cb = patientOf(result, asked);
  if (!cases.carm) return writePatientFile(path, T_dsa_cb, result, record);
  const std::string& machine = cases.carm->machine;
  if (!machine.empty() && !record.machine.empty() && machine != record.machine) {
    throw InputError(asked.carm, "machine", machine, "must be the angles' machine, " + record.machine);
  }
  writeCArmFile(path, withPatient(*cases.carm, T_dsa_cb, record, modelId(cases.tree)));
}

}  // namespace angio::apps
