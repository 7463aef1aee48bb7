// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "angio/base/formatted.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/calibration_simulation.hpp"
#include "angio/calibration/pose_set.hpp"
#include "angio/geometry/distortion.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/claimed_folder.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/simulation/fluoroscopy.hpp"

namespace angio::calibration {
namespace {

constexpr double kSteel_per_m = 950;  // Linear attenuation at 60 keV, NIST XCOM.

// The renderer wants a tree: one so short that nobody sees it, and without contrast agent.
VesselTree noVessel(const Eigen::Vector3d& place) {
  Eigen::Matrix3Xd points(3, 2);
  points << place, place + Eigen::Vector3d(1e-4, 0, 0);
  return VesselTree(points, {-1, 0}, {1e-4, 1e-4});
}

FluoroscopySettings look(int seed) {
  FluoroscopySettings settings;
  settings.seed = seed;
  settings.contrast_attenuation_per_mm = 0;
  settings.anatomy.region = Region::kNone;
  settings.background_strength = 0.05;  // The phantom's body and the table are uneven.
  settings.photons_per_pixel = 5000;    // As for a single exposure.
  return settings;
}

// Each pixel of the image shows what a flat detector sees elsewhere.
cv::Mat distortedImage(const cv::Mat& flat, const DetectorDistortion& distortion) {
  cv::Mat from_x(flat.size(), CV_32FC1), from_y(flat.size(), CV_32FC1);
  for (int y = 0; y < flat.rows; ++y) {
    for (int x = 0; x < flat.cols; ++x) {
      const auto from = distortion.undistorted(Eigen::Vector2d(x, y));
      from_x.at<float>(y, x) = from ? static_cast<float>(from->x()) : -1.0F;
      from_y.at<float>(y, x) = from ? static_cast<float>(from->y()) : -1.0F;
    }
  }
  cv::Mat image;
  cv::remap(flat, image, from_x, from_y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return image;
}

// X-ray images of steel balls in a body of plastic: scatter, blur, quantum noise, and shadows that overlap.
class PhantomRenderer {
 public:
  PhantomRenderer(const BeadPhantom& phantom, int seed)
      : phantom_(phantom), renderer_(noVessel(phantom.center_m()), look(seed)) {}

  // The image, CV_16UC1, of those beads that are `shown`. The same seed and frame give the same image.
  cv::Mat render(const XrayCamera& camera, const Pose& T_camera_phantom, const std::vector<int>& shown,
                 const std::optional<DetectorDistortion>& distortion, std::uint64_t frame) {
    XrayScene scene;
    scene.T_camera_model = T_camera_phantom;
    for (const int i : shown) {
      const Bead& bead = phantom_.beads[i];
      Device ball;  // A line of no length with round ends.
      ball.points.resize(3, 2);
      ball.points << bead.position_m, bead.position_m + Eigen::Vector3d(1e-7, 0, 0);
      ball.diameter_m = 2 * bead.radius_m;
      ball.attenuation_per_m = kSteel_per_m;
      scene.devices.push_back(ball);
    }
    const cv::Mat flat = renderer_.render(camera, scene, frame);
    return distortion ? distortedImage(flat, *distortion) : flat;
  }

 private:
  BeadPhantom phantom_;
  FluoroscopyRenderer renderer_;
};

using Json = nlohmann::ordered_json;

// Labels of two beads, one for the other: as a slip in a table has them.
int labelOf(int bead, HostileData hostile) {
  constexpr int kFirst = 20, kSecond = 61;
  if (hostile != HostileData::kSwappedBeads) return bead;
  return bead == kFirst ? kSecond : bead == kSecond ? kFirst : bead;
}

std::string tableOfBeads(const SimulatedBeadView& view, const SimulatedDevice& machine,
                         const CalibrationSimulationSettings& s, Draws& draws) {
  std::string table = "x_px,y_px,sigma_px,bead\n";
  for (std::size_t i = 0; i < view.shown.size(); ++i) {
    const Eigen::Vector2d pixel = view.pixels_px.col(i);
    Eigen::Vector2d seen_px = machine.distortion ? machine.distortion->distorted(pixel) : pixel;
    seen_px += s.bead_noise_px * draws.vector(1).head<2>();
    table += exact(seen_px.x()) + "," + exact(seen_px.y()) + "," + exact(std::max(s.bead_noise_px, 1e-3)) + "," +
             std::to_string(labelOf(view.shown[i], s.hostile)) + "\n";
  }
  return table;
}

struct ViewFolder {
  std::string folder;
  bool images;
  bool has_joints;
};

// Writes one set of views, each by the machine that took it.
class ViewWriter {
 public:
  ViewWriter(const ViewFolder& to, const BeadPhantom& phantom, const CalibrationSimulationSettings& settings)
      : to_(to),
        settings_(settings),
        renderer_(to.images ? std::optional<PhantomRenderer>(std::in_place, phantom, settings.seed) : std::nullopt),
        draws_(static_cast<std::uint64_t>(settings.seed) * 7919 + (to.has_joints ? 1 : 0)),
        claimed_(to.folder) {}

  void write(const SimulatedDevice& machine, const SimulatedBeadView& view) {
    const int index = static_cast<int>(views_.size()) + 1;
    const std::string name = formatted("%04d", index);
    Json entry{{"name", name}};
    if (to_.images) {
      const XrayCamera camera = machine.truth.carm.camera(view.source_detector_distance_m);
      writeImage(to_.folder + "/v" + name + ".png",
                 renderer_->render(camera, view.T_camera_phantom, view.shown, machine.distortion,
                                   static_cast<std::uint64_t>(index)));
      entry["image"] = "v" + name + ".png";
    } else {
      writeWholeFile(to_.folder + "/v" + name + ".csv", tableOfBeads(view, machine, settings_, draws_));
      entry["beads"] = "v" + name + ".csv";
    }
    entry["source_detector_distance_mm"] = 1e3 * view.source_detector_distance_m;
    if (to_.has_joints) {
      entry["primary_deg"] = radToDeg(view.said[0]);
      entry["secondary_deg"] = radToDeg(view.said[1]);
      entry["table_mm"] = {1e3 * view.said[2], 1e3 * view.said[3], 1e3 * view.said[4]};
    }
    if (view.held_out) entry["held_out"] = true;
    views_.push_back(entry);
  }

  void finish(const CArmCalibration& truth) const {
    const CArmGeometry& carm = truth.carm;
    const Json set{{"machine", truth.machine},
                   {"phantom", "../phantom.yaml"},
                   {"image_size_px", {carm.image_width_px, carm.image_height_px}},
                   {"pixel_spacing_mm", 1e3 * carm.pixel_spacing_m},
                   {"views", views_}};
    writeWholeFile(to_.folder + "/views.yaml", asYaml(set));
  }

 private:
  ViewFolder to_;
  const CalibrationSimulationSettings& settings_;
  std::optional<PhantomRenderer> renderer_;
  Draws draws_;
  ClaimedFolder claimed_;
  Json views_ = Json::array();
};

// The phantom's file as a user might have it: right, in micrometres, or with x the other way.
BeadPhantom filed(BeadPhantom phantom, HostileData hostile) {
  for (Bead& bead : phantom.beads) {
    if (hostile == HostileData::kWrongUnits) {
      bead.position_m *= 1000;
      bead.radius_m *= 1000;
    }
    if (hostile == HostileData::kMirroredPhantom) bead.position_m.x() *= -1;
  }
  return phantom;
}

PoseSet posesOf(const SimulatedDevice& machine, const SimulatedDevice& other, const CalibrationSimulationSettings& s) {
  Draws draws(static_cast<std::uint64_t>(s.seed) * 7919 + 2);
  PoseSet set;
  set.machine = machine.truth.machine;
  set.camera_std = PoseSigma{degToRad(s.pose_noise_deg), 1e-3 * s.pose_noise_mm};
  for (int i = 0; i < s.hand_eye_poses; ++i) {
    const int half = (s.hand_eye_poses + 1) / 2, place = i % half;
    const double part = half > 1 ? 2.0 * place / (half - 1) - 1 : 0;
    CArmJoints joints = CArmJoints::Zero();
    // LAO to RAO, then CRA to CAU, as an operator turns the arm.
    joints[0] = i < half ? degToRad(45) * part : degToRad(10);
    joints[1] = i < half ? 0 : degToRad(30) * part;
    const bool copies = s.hostile == HostileData::kDuplicatePoses;
    if (copies) joints << degToRad(20), degToRad(10), 0, 0, 0;
    const SimulatedDevice& at = s.hostile == HostileData::kOtherMachine && i % 2 == 1 ? other : machine;
    HandEyePose pose;
    pose.name = formatted("%04d", i + 1);
    pose.joints = joints;
    pose.T_camera_object = at.truth.carm.T_camera_patient(joints) * at.truth.T_dsa_cb;
    if (!copies) {
      const Twist noise = draws.twist(1e-3 * s.pose_noise_mm, degToRad(s.pose_noise_deg));
      pose.T_camera_object.translation() += noise.head<3>();
      pose.T_camera_object.linear() = expSO3(noise.tail<3>()) * pose.T_camera_object.linear();
    }
    if (s.hostile == HostileData::kWrongUnits) pose.T_camera_object.translation() *= 1e-3;
    if (s.hostile == HostileData::kMirroredPhantom) pose.T_camera_object.linear().col(0) *= -1;
    set.poses.push_back(pose);
  }
  return set;
}

Json truthOf(const SimulatedDevice& machine, const CalibrationSimulationSettings& settings) {
  const auto camera = machine.truth.carm.camera().parameters();
  Json json{
      {"machine", machine.truth.machine},
      {"camera", {{"fx_px", camera.fx_px}, {"fy_px", camera.fy_px}, {"cx_px", camera.cx_px}, {"cy_px", camera.cy_px}}}};
  if (machine.distortion) {
    const DetectorDistortion& d = *machine.distortion;
    json["camera"]["distortion"] = {{"model", d.model == DetectorDistortion::Model::kRadial ? "radial" : "intensifier"},
                                    {"k1", d.bend.k1},
                                    {"k2", d.bend.k2},
                                    {"s1_deg", radToDeg(d.bend.s1_rad)},
                                    {"s2_deg", radToDeg(d.bend.s2_rad)}};
  }
  const auto numbers = machine.truth.carm.poseParameters();
  for (std::size_t k = 0; k < kCArmPoseParameters; ++k) {
    const CArmParameter& parameter = kCArmPoseParameterNames[k];
    json["geometry"][parameter.name] = numbers[k] / parameter.unit;
  }
  json["settings"] = settingsAsJson(settings);
  return json;
}

void duplicate(std::vector<SimulatedBeadView>& views) {
  for (SimulatedBeadView& view : views) {
    const bool held_out = view.held_out;
    view = views.front();
    view.held_out = held_out;
  }
}

}  // namespace

void writeCalibrationData(const std::string& folder, const CArmCalibration& nominal,
                          const Eigen::Vector3d& center_model, const CalibrationSimulationSettings& s,
                          SimulatedImages images, const std::function<void(int done, int total)>& tell) {
  const ClaimedFolder claimed(folder), truth(folder + "/truth"), hand_eye(folder + "/hand-eye");
  const SimulatedDevice machine = simulatedMachine(nominal, center_model, s), other = otherMachine(machine, s);
  const BeadPhantom phantom = helixPhantom();
  std::vector<SimulatedBeadView> camera_views = simulatedCameraViews(machine, phantom, s),
                                 geometry_views = simulatedGeometryViews(machine, phantom, s);
  const bool two = s.hostile == HostileData::kOtherMachine;
  const std::vector<SimulatedBeadView> others_camera = simulatedCameraViews(other, phantom, s),
                                       others_geometry = simulatedGeometryViews(other, phantom, s);
  if (s.hostile == HostileData::kDuplicatePoses) {
    duplicate(camera_views);
    duplicate(geometry_views);
  }
  // A slip in labels needs labels.
  const bool labelled = s.hostile == HostileData::kSwappedBeads;

  writeBeadPhantom(folder + "/phantom.yaml", filed(phantom, s.hostile));
  writeCArmCalibration(folder + "/truth/carm.yaml", machine.truth);
  writeWholeFile(folder + "/truth.json", truthOf(machine, s).dump(2) + "\n");
  const int total = static_cast<int>(camera_views.size() + geometry_views.size());
  int done = 0;
  const auto writeViews = [&](const ViewFolder& to, const std::vector<SimulatedBeadView>& views,
                              const std::vector<SimulatedBeadView>& others) {
    ViewWriter writer(to, phantom, s);
    for (std::size_t i = 0; i < views.size(); ++i) {
      const bool foreign = two && i % 2 == 1;
      writer.write(foreign ? other : machine, foreign ? others[i] : views[i]);
      if (tell) tell(++done, total);
    }
    writer.finish(machine.truth);
  };
  writeViews({folder + "/camera", images != SimulatedImages::kNone && !labelled, false}, camera_views, others_camera);
  writeViews({folder + "/geometry", images == SimulatedImages::kAll && !labelled, true}, geometry_views,
             others_geometry);
  writePoseSet(folder + "/hand-eye/poses.yaml", posesOf(machine, other, s));
}

}  // namespace angio::calibration
