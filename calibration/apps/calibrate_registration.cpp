// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate registration: T_dsa_cb from the anatomy itself, registered in several views.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/carm_files.hpp"
#include "angio/calibration/pose_pictures.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/results/case_run.hpp"
#include "calibrate.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct RegistrationOptions {
  std::string cases, angles, carm, out, run, report, method = OrientedKernelSettings::kName;
  double search_rotation_deg = 10, search_translation_mm = 30;
  bool leave_one_out = false, refine = true;
  AnatomyRegistrationSettings settings;
};

// A case set with what the C-arm said of its views.
struct AnatomyCases {
  CaseSet set;
  AnatomyAngleSet angles;
  std::optional<CArmFile> carm;
  std::vector<std::string> input_paths;
};

AnatomyAngleSet anglesOf(const RegistrationOptions& o, const CaseSet& set, std::vector<std::string>& input_paths) {
  const auto beside = std::filesystem::path(o.cases).parent_path() / "angles.yaml";
  if (!o.angles.empty() || std::filesystem::exists(beside)) {
    input_paths.push_back(o.angles.empty() ? beside.string() : o.angles);
    return readAnatomyAngles(input_paths.back());
  }
  AnatomyAngleSet angles;
  for (const Case& one : set.cases) {
    const auto& image = one.views.front().image_path;
    if (!image || !isDicom(*image)) {
      throw InputError(o.cases, "cases", one.name,
                       "has no angles: --angles, angles.yaml beside the case set, or a DICOM image");
    }
    angles.views.push_back(dicomAngles(one.name, *image));
    input_paths.push_back(*image);
  }
  return angles;
}

AnatomyCases readAnatomyCases(const RegistrationOptions& o) {
  AnatomyCases cases;
  cases.set = readCaseSet(o.cases);
  cases.input_paths.push_back(o.cases);
  cases.angles = anglesOf(o, cases.set, cases.input_paths);
  if (!o.carm.empty()) {
    cases.carm = readCArmFile(o.carm);
    cases.input_paths.push_back(o.carm);
  }
  for (const Case& one : cases.set.cases) {
    if (one.tree_path != cases.set.cases.front().tree_path)
      throw InputError(o.cases, "tree", one.name, "must be the same in all cases");
    const auto& views = cases.angles.views;
    if (std::none_of(views.begin(), views.end(), [&](const auto& view) { return view.name == one.name; })) {
      throw InputError(cases.input_paths[1], "views", one.name, "is missing: every case must have its angles");
    }
  }
  cases.input_paths.push_back(cases.set.cases.front().tree_path);
  return cases;
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

// The views that took part, in one order; a view from a centreline has no image.
struct SeenViews {
  std::vector<AnatomyView> views;
  std::vector<SeenAnatomy> seen;
  std::vector<std::optional<std::string>> image_paths;
};

AnatomyResult anatomyOf(const SeenViews& seen, const VesselTree& tree, const RegistrationOptions& o) {
  const AnatomyResult result = registerAnatomy(seen.views, tree.centroid(), o.settings);
  return o.refine ? refineAnatomy(result, seen.views, seen.seen, tree, o.settings) : result;
}

// For each view: T_dsa_cb made of the others alone, and what it says of this one.
std::string leaveOneOutTable(const AnatomyResult& all, const SeenViews& seen, const VesselTree& tree,
                             const RegistrationOptions& o) {
  std::string table = "\nleft out    predicted rotation off [deg]   T_dsa_cb of the others moves by [deg]\n";
  for (std::size_t i = 0; i < seen.views.size(); ++i) {
    SeenViews others = seen;
    others.views.erase(others.views.begin() + i);
    others.seen.erase(others.seen.begin() + i);
    const AnatomyResult result = anatomyOf(others, tree, o);
    const AnatomyView& view = seen.views[i];
    const Eigen::Matrix3d predicted = view.T_camera_patient.linear() * result.T_dsa_cb.linear();
    table += formatted("%-10s  %28.3f  %38.3f\n", view.name.c_str(),
                       radToDeg(rotationAngle(view.T_camera_model.linear() * predicted.transpose())),
                       radToDeg(rotationAngle(result.T_dsa_cb.linear() * all.T_dsa_cb.linear().transpose())));
  }
  return table;
}

Pose patientOfRun(const AnatomyResult& result, const std::string& run) {
  if (run.empty()) return result.T_dsa_cb;
  for (const RunShift& shift : result.runs) {
    if (shift.run == run) return Eigen::Translation3d(shift.shift_m) * result.T_dsa_cb;
  }
  throw InputError("", "run", run, "must be one of the angles' runs");
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

void writeAnatomy(const RegistrationOptions& o, const AnatomyCases& cases, const VesselTree& tree,
                  const AnatomyResult& result) {
  const CalibrationRecord record = anatomyRecord(result, cases.angles.machine, cases.input_paths);
  const Pose T_dsa_cb = patientOfRun(result, o.run);
  if (!cases.carm) return writePatientFile(o.out, T_dsa_cb, result, record);
  const std::string& machine = cases.carm->machine;
  if (!machine.empty() && !record.machine.empty() && machine != record.machine) {
    throw InputError(o.carm, "machine", machine, "must be the angles' machine, " + record.machine);
  }
  writeCArmFile(o.out, withPatient(*cases.carm, T_dsa_cb, record, modelId(tree)));
}

// For a person: T_dsa_cb, the runs' shifts, each view against the others. `left_out` names those that were not
// registered.
std::string anatomyTable(const AnatomyResult& result, const std::vector<CaseOutcome>& outcomes,
                         const std::string& left_out) {
  std::string table = transformRow("T_dsa_cb", result.T_dsa_cb, result.covariance);
  for (const RunShift& run : result.runs) {
    const Eigen::Vector3d s = run.covariance.diagonal().cwiseSqrt();
    table += formatted("shift of %-6s", run.run.c_str());
    for (int k = 0; k < 3; ++k) table += formatted("  %9.3f +- %-7.3f", 1e3 * run.shift_m[k], 1e3 * s[k]);
    table += " mm\n";
  }
  table += "\nview        registered   by the angles off [deg]  [mm]     sigmas   by the other views off [deg]\n";
  for (const AnatomyViewFit& view : result.views) {
    const auto outcome =
        std::find_if(outcomes.begin(), outcomes.end(), [&](const auto& o) { return o.name == view.name; });
    table += formatted("%-10s  %-10s  %22.3f  %8.3f  %5.2f   ", view.name.c_str(),
                       statusName(outcome->result.status).c_str(), radToDeg(view.rotation_rad),
                       1e3 * view.translation_m, view.sigmas);
    table += view.outlier                 ? "outlier"
             : view.held_out_rotation_rad ? formatted("%.3f", radToDeg(*view.held_out_rotation_rad))
                                          : "-";
    table += "\n";
  }
  if (!left_out.empty()) table += "left out        " + left_out + "\n";
  if (result.held_out_rotation_rms_rad) {
    table += formatted("held out, rms   %.3f deg\n", radToDeg(*result.held_out_rotation_rms_rad));
  }
  return table + formatted("chi2 per degree of freedom %.2f\n", result.chi2_per_freedom);
}

// Each view's overlay and how far it is from the others, as pictures and a page with `table`.
void writeAnatomyReport(const std::string& folder, const std::string& cases_path, const AnatomyResult& result,
                        const SeenViews& anatomy, const VesselTree& tree, const std::string& table) {
  std::vector<ReportPicture> overlays;
  constexpr std::size_t kShown = 4;  // In the overview.
  for (std::size_t i = 0; i < anatomy.views.size(); ++i) {
    const auto& path = anatomy.image_paths[i];
    overlays.push_back(
        {formatted("view-%03zu.png", i + 1), anatomy.views[i].name,
         anatomyOverlay(result, anatomy.views[i], anatomy.seen[i], tree, path ? readXrayImage(*path) : cv::Mat()),
         i < kShown});
  }
  writeReport(folder, "T_dsa_cb from the anatomy", cases_path,
              {{"Views against each other",
                "",
                {{"residuals.png", "A view's own registration against that of all views", anatomyResiduals(result)}}},
               {"Views", "", overlays},
               {"Numbers", printed(table), {}}});
}

int runRegistration(const RegistrationOptions& o) {
  const ClaimedOutputs claimed(o.out, o.report);
  const AnatomyCases cases = readAnatomyCases(o);
  ProgressBar bar("registering", static_cast<int>(cases.set.cases.size()));
  CaseRunSettings how;
  how.registration = registrationSettingsNamed(o.method);
  how.starts.count = startsOfPreset(o.method);
  how.starts.box_rotation_deg = o.search_rotation_deg;
  how.starts.box_translation_mm = o.search_translation_mm;
  const auto outcomes = runCases(cases.set, how, [&](int done) { bar.show(done); });
  SeenViews seen;
  std::string left_out;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    if (!outcomes[i].result.covariance || outcomes[i].result.status == RegistrationStatus::kDiverged) {
      left_out += (left_out.empty() ? "" : ", ") + outcomes[i].name + " (" + outcomes[i].result.reason + ")";
      continue;
    }
    const View& view = cases.set.cases[i].views.front();
    seen.views.push_back(viewOf(cases, outcomes[i]));
    seen.seen.push_back(seenIn(view));
    seen.image_paths.push_back(view.image_path);
  }
  const VesselTree tree = readVesselTree(cases.set.cases.front().tree_path);
  const AnatomyResult result = anatomyOf(seen, tree, o);
  if (!o.out.empty()) writeAnatomy(o, cases, tree, result);
  const std::string table = anatomyTable(result, outcomes, left_out);
  if (!o.report.empty()) writeAnatomyReport(o.report, o.cases, result, seen, tree, table);
  std::cout << table;
  if (o.leave_one_out) std::cout << leaveOneOutTable(result, seen, tree, o);
  return 0;
}

}  // namespace

void addCalibrateRegistration(cli::Command& app, Work& work) {
  const auto o = std::make_shared<RegistrationOptions>();
  auto* command =
      app.addSubcommand("registration", "T_dsa_cb and a shift per run from the anatomy, registered in several views");
  command->footer(
      "Examples:\n  angio-calibrate registration cases.yaml --carm carm.yaml --out lab.yaml\n"
      "  angio-calibrate registration examples/data/static-phantom/cases.yaml --leave-one-out");
  command->addOption("cases", o->cases, "Case set (cases.yaml) of one tree; each case's first view is used")
      ->required();
  command->addOption("--angles", o->angles,
                     "The C-arm's angles (.yaml); otherwise angles.yaml beside the case set, or those of DICOM images");
  command->addOption("--carm", o->carm, "C-arm file (.yaml): the result is this file with T_dsa_cb");
  command->addOption("--out", o->out, "Result (.yaml)");
  command->addOption("--report", o->report, "Folder for pictures and a page (index.html)");
  command->addOption("--run", o->run, "T_dsa_cb of this run, its shift included, instead of the runs' mean");
  command->addOption("--method", o->method, "Registration method");
  command
      ->addOption("--search-rotation-deg", o->search_rotation_deg, "Poses are searched so far about the initial ones")
      ->check(between(0, 180));
  command->addOption("--search-translation-mm", o->search_translation_mm, "and so far along each axis")
      ->check(between(0, 1000));
  command->addOption("--angle-sigma-deg", o->settings.angle_std_deg, "Errors of the C-arm's angles")
      ->check(between(1e-4, 30));
  command
      ->addOption("--shift-sigma-mm", o->settings.shift_std_mm,
                  "The isocentre moves so much from run to run; 0: not at all")
      ->check(between(0, 1000));
  command->addOption("--outlier-gate", o->settings.outlier_gate, "Views further off than so many sigma are left out")
      ->check(between(2, 100));
  command->addFlag("--refine,!--no-refine", o->refine, "Refine jointly on the image points of all views");
  command->addFlag("--leave-one-out", o->leave_one_out, "Also each view's rotation as the others alone predict it");
  command->onChosen([o, &work] { work = [o] { return runRegistration(*o); }; });
}

}  // namespace angio::apps
