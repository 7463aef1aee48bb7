// SPDX-License-Identifier: GPL-2.0-or-later
#include "run_files.hpp"

#include <nlohmann/json.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/experiments/closed_loop.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/claimed_folder.hpp"
#include "angio/io/displacement_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/registration/starts.hpp"

namespace angio::apps {
namespace {

std::string numbered(const char* name, int frame, const char* extension) {
  return formatted("%s%04d%s", name, frame, extension);
}

// Writes the frames of a run one after the other, and remembers their cases.
class RunWriter {
 public:
  RunWriter(const VesselTree& tree, const CArmCalibration& calibration, const SimulatedPatientSettings& settings,
            const RunOptions& options)
      : calibration_(calibration),
        options_(options),
        shuttered_(settings.fluoroscopy.collimator.shutter != Shutter::kOpen),
        camera_(calibration.carm.camera()),
        // The patient frame has the axes L, P, S.
        patient_(tree, settings, {calibration.T_dsa_cb.linear(), {}}),
        T_true_calibrated_(drawnPose(Pose::Identity(), patient_.tree().centroid(), degToRad(options.start_rotation_deg),
                                     options.start_translation_mm * 1e-3, settings.fluoroscopy.seed, 0)) {
    writeVesselTree(path("tree.csv"), patient_.tree());
    by_image_.frame_period_s = by_centerline_.frame_period_s = 1 / options.frame_rate_hz;
  }

  void write(int i) {
    const double time_s = i / options_.frame_rate_hz;
    const double part = options_.frames > 1 ? static_cast<double>(i) / (options_.frames - 1) : 0;
    const ViewAngles& from = options_.from;
    const ViewAngles& to = options_.to;
    const ViewAngles angles{from.primary_rad + part * (to.primary_rad - from.primary_rad),
                            from.secondary_rad + part * (to.secondary_rad - from.secondary_rad)};
    const Eigen::Vector3d target = calibration_.T_dsa_cb * patient_.tree().centroid();
    const CArmJoints joints = calibration_.carm.jointsFor(angles, target);
    const Pose T_camera_rest = calibration_.carm.T_camera_patient(joints) * calibration_.T_dsa_cb;
    const XrayScene scene = patient_.scene(T_camera_rest, time_s);
    const FrameTruth truth = patient_.truth(camera_, scene);

    // One error of the calibration for the whole run.
    const Pose start = T_camera_rest * T_true_calibrated_;
    Case one{numbered("", i, ""),
             path("tree.csv"),
             {{camera_, {}, {}, Pose::Identity(), {}}},
             start,
             scene.T_camera_model,
             {}};
    if (shuttered_) one.views[0].collimator_px = truth.collimator_opening_px;
    if (scene.displacements_m) {
      one.truth_displacements_path = path(numbered("displacements", i, ".csv"));
      writeDisplacements(*one.truth_displacements_path, *scene.displacements_m);
    }
    writeFrame(i, scene, one);
    writeCenterlines(i, truth, one);
    table_ += formatted("%d,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f\n", i, time_s, radToDeg(joints[0]), radToDeg(joints[1]),
                        1e3 * joints[2], 1e3 * joints[3], 1e3 * joints[4]);
  }

  void finish(const SimulatedPatientSettings& settings) {
    if (options_.format == FrameFormat::kRun) writeImageSequence(path("frames.tif"), frames_);
    writeWholeFile(path("frames.csv"), table_);
    writeWholeFile(path("settings.json"), settingsAsJson(settings).dump(2) + "\n");
    if (!by_centerline_.cases.empty()) writeCaseSet(path("centerlines.yaml"), by_centerline_);
    if (!by_image_.cases.empty()) writeCaseSet(path("cases.yaml"), by_image_);
  }

 private:
  std::string path(const std::string& name) const { return options_.folder + "/" + name; }

  void writeFrame(int i, const XrayScene& scene, Case one) {
    const cv::Mat image = patient_.render(camera_, scene, static_cast<std::uint64_t>(i));
    if (options_.format == FrameFormat::kRun) {
      frames_.push_back(image);
      return;
    }
    one.views[0].image_path = path(numbered("frame", i, options_.format == FrameFormat::kPng ? ".png" : ".tif"));
    writeImage(*one.views[0].image_path, image);
    by_image_.cases.push_back(std::move(one));
  }

  void writeCenterlines(int i, const FrameTruth& truth, Case one) {
    const Centerline2d vessels = ofKind(truth.centerline, CurveKind::kVessel);
    const Centerline2d devices = ofKind(truth.centerline, CurveKind::kDevice);
    if (devices.size() > 0) writeCenterline(path(numbered("device", i, ".csv")), devices);
    if (vessels.size() == 0) return;  // Before the contrast agent comes, and after it has gone.
    one.views[0].centerline_path = path(numbered("centerline", i, ".csv"));
    writeCenterline(*one.views[0].centerline_path, vessels);
    by_centerline_.cases.push_back(std::move(one));
  }

  const CArmCalibration& calibration_;
  const RunOptions& options_;
  bool shuttered_;
  XrayCamera camera_;
  SimulatedPatient patient_;
  Pose T_true_calibrated_;
  std::vector<cv::Mat> frames_;
  CaseSet by_image_{true, {}, {}}, by_centerline_{true, {}, {}};
  std::string table_ = "frame,time_s,primary_deg,secondary_deg,table_x_mm,table_y_mm,table_z_mm\n";
};

}  // namespace

void writeRun(const VesselTree& tree, const CArmCalibration& calibration, const SimulatedPatientSettings& settings,
              const RunOptions& options, const std::function<void(int done)>& progress) {
  const ClaimedFolder claimed(options.folder);
  RunWriter writer(tree, calibration, settings, options);
  for (int i = 0; i < options.frames; ++i) {
    writer.write(i);
    progress(i + 1);
  }
  writer.finish(settings);
}

}  // namespace angio::apps
