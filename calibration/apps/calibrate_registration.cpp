// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate registration: T_dsa_cb from the anatomy itself, registered in several views.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/anatomy_angles.hpp"
#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"
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

// For each view: T_dsa_cb made of the others alone, and what it says of this one.
std::string leaveOneOutTable(const AnatomyResult& all, const std::vector<AnatomyView>& views,
                             const std::vector<SeenAnatomy>& seen, const VesselTree& tree,
                             const RegistrationOptions& o) {
  std::string table = "\nleft out    predicted rotation off [deg]   T_dsa_cb of the others moves by [deg]\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    std::vector<AnatomyView> others = views;
    std::vector<SeenAnatomy> others_seen = seen;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    others_seen.erase(others_seen.begin() + static_cast<std::ptrdiff_t>(i));
    AnatomyResult result = registerAnatomy(others, tree.centroid(), o.settings);
    if (o.refine) result = refineAnatomy(result, others, others_seen, tree, o.settings);
    const Eigen::Matrix3d predicted = views[i].T_camera_patient.linear() * result.T_dsa_cb.linear();
    table += formatted("%-10s  %28.3f  %38.3f\n", views[i].name.c_str(),
                       radToDeg(rotationAngle(views[i].T_camera_model.linear() * predicted.transpose())),
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

void writeAnatomy(const RegistrationOptions& o, const AnatomyCases& cases, const AnatomyResult& result) {
  const CalibrationRecord record = anatomyRecord(result, cases.angles.machine, cases.input_paths);
  const Pose T_dsa_cb = patientOfRun(result, o.run);
  if (cases.carm) {
    CArmFile carm = *cases.carm;
    if (!carm.machine.empty() && !record.machine.empty() && carm.machine != record.machine) {
      throw InputError(o.carm, "machine", carm.machine, "must be the angles' machine, " + record.machine);
    }
    if (carm.machine.empty()) carm.machine = record.machine;
    carm.T_dsa_cb = T_dsa_cb;
    replaceRecord(carm.records, record);
    writeCArmFile(o.out, carm);
    return;
  }
  writePatientFile(o.out, T_dsa_cb, result, record);
}

int calibrate(const RegistrationOptions& o) {
  const AnatomyCases cases = readAnatomyCases(o);
  ProgressBar bar("registering", static_cast<int>(cases.set.cases.size()));
  CaseRunSettings how{registrationSettingsNamed(o.method), {}, {}};
  how.starts.box_rotation_deg = o.search_rotation_deg;
  how.starts.box_translation_mm = o.search_translation_mm;
  const auto outcomes = runCases(cases.set, how, [&](int done) { bar.show(done); });
  std::vector<AnatomyView> views;
  std::vector<SeenAnatomy> seen;
  std::vector<std::optional<std::string>> images;
  std::string left_out;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    if (!outcomes[i].result.covariance || outcomes[i].result.status == RegistrationStatus::kDiverged) {
      left_out += (left_out.empty() ? "" : ", ") + outcomes[i].name + " (" + outcomes[i].result.reason + ")";
      continue;
    }
    views.push_back(viewOf(cases, outcomes[i]));
    seen.push_back(seenIn(cases.set.cases[i].views.front()));
    images.push_back(cases.set.cases[i].views.front().image_path);
  }
  const VesselTree tree = readVesselTree(cases.set.cases.front().tree_path);
  AnatomyResult result = registerAnatomy(views, tree.centroid(), o.settings);
  if (o.refine) result = refineAnatomy(result, views, seen, tree, o.settings);
  if (!o.out.empty()) writeAnatomy(o, cases, result);
  const std::string table = anatomyTable(result, outcomes, left_out);
  if (!o.report.empty()) writeAnatomyReport(o.report, o.cases, result, {views, seen, images, tree}, table);
  std::cout << table;
  if (o.leave_one_out) std::cout << leaveOneOutTable(result, views, seen, tree, o);
  return 0;
}

}  // namespace

void addCalibrateRegistration(CLI::App& app, Work& work) {
  const auto o = std::make_shared<RegistrationOptions>();
  auto* command =
      app.add_subcommand("registration", "T_dsa_cb and a shift per run from the anatomy, registered in several views");
  command->option_defaults()->always_capture_default();
  command->footer(
      "Examples:\n  angio-calibrate registration cases.yaml --carm carm.yaml --out lab.yaml\n"
      "  angio-calibrate registration examples/data/static-phantom/cases.yaml --leave-one-out");
  command->add_option("cases", o->cases, "Case set (cases.yaml) of one tree; each case's first view is used")
      ->required();
  command->add_option(
      "--angles", o->angles,
      "The C-arm's angles (.yaml); otherwise angles.yaml beside the case set, or those of DICOM images");
  command->add_option("--carm", o->carm, "C-arm file (.yaml): the result is this file with T_dsa_cb");
  command->add_option("--out", o->out, "Result (.yaml)");
  command->add_option("--report", o->report, "Folder for pictures and a page (index.html)");
  command->add_option("--run", o->run, "T_dsa_cb of this run, its shift included, instead of the runs' mean");
  command->add_option("--method", o->method, "Registration method");
  command
      ->add_option("--search-rotation-deg", o->search_rotation_deg, "Poses are searched so far about the initial ones")
      ->check(between(0, 180));
  command->add_option("--search-translation-mm", o->search_translation_mm, "and so far along each axis")
      ->check(between(0, 1000));
  command->add_option("--angle-sigma-deg", o->settings.angle_std_deg, "Errors of the C-arm's angles")
      ->check(between(1e-4, 30));
  command
      ->add_option("--shift-sigma-mm", o->settings.shift_std_mm,
                   "The isocentre moves so much from run to run; 0: not at all")
      ->check(between(0, 1000));
  command->add_option("--outlier-gate", o->settings.outlier_gate, "Views further off than so many sigma are left out")
      ->check(between(2, 100));
  command->add_flag("--refine,!--no-refine", o->refine, "Refine jointly on the image points of all views");
  command->add_flag("--leave-one-out", o->leave_one_out, "Also each view's rotation as the others alone predict it");
  command->callback([o, &work] { work = [o] { return calibrate(*o); }; });
}

}  // namespace angio::apps
