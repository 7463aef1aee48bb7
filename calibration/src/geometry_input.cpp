// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <functional>
#include <set>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/calibration/geometry_calibration.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/yaml.hpp"

namespace angio::calibration {
namespace {

// Of fx, fy, cx, cy; a camera with square pixels has one focal length for both.
std::optional<Eigen::Matrix4d> cameraCovariance(const std::vector<CalibrationRecord>& records) {
  for (const auto& record : records) {
    if (record.kind != "camera") continue;
    const auto placeOf = [&](const char* name) { return static_cast<int>(record.placeOf(name).value_or(-1)); };
    const int f = placeOf("f_px");
    const std::vector<int> places{f >= 0 ? f : placeOf("fx_px"), f >= 0 ? f : placeOf("fy_px"), placeOf("cx_px"),
                                  placeOf("cy_px")};
    if (*std::min_element(places.begin(), places.end()) < 0) continue;
    Eigen::Matrix4d covariance = record.covariance(places, places);
    // One focal length leaves the difference of two no variance, and a prior needs some.
    covariance.diagonal() *= 1 + 1e-6;
    return covariance;
  }
  return std::nullopt;
}

// What views say beside the camera's file.
struct ViewsOfCamera {
  std::optional<double> pixel_spacing_m;
  std::optional<double> only_distance_m;  // The one that all were taken at.
};

ViewsOfCamera cameraInViews(const ViewSet& set) {
  ViewsOfCamera says{set.pixel_spacing_m, std::nullopt};
  std::set<double> distances;
  for (const auto& view : set.views) {
    if (view.source_detector_distance_m) distances.insert(*view.source_detector_distance_m);
  }
  if (distances.size() == 1) says.only_distance_m = *distances.begin();
  return says;
}

GeometryCamera cameraOf(const std::string& path, const CameraFile& file, const ViewsOfCamera& views) {
  const auto& p = file.camera.parameters();
  const auto spacing = p.pixel_spacing_m ? p.pixel_spacing_m : views.pixel_spacing_m;
  if (!spacing) throw InputError(path, "pixel_spacing_mm", "", "is missing: the arm's lengths need it");
  // The distance by the encoder that the camera's values hold at.
  const auto distance = p.source_detector_distance_m ? p.source_detector_distance_m : views.only_distance_m;
  if (!distance) {
    throw InputError(path, "source_detector_distance_mm", "", "is missing: the arm's lengths need it");
  }
  GeometryCamera camera{p, std::nullopt};
  camera.pixel_spacing_m = spacing;
  camera.source_detector_distance_m = distance;
  if (file.distance_law) camera.principal_point_slope_px_per_m = file.distance_law->principal_point_slope_px_per_m;
  return camera;
}

void requireImageSize(const std::string& path, const CameraFile& file, const DetectorOfViews& detector) {
  const auto& p = file.camera.parameters();
  if (p.width_px == detector.width_px && p.height_px == detector.height_px) return;
  throw InputError(
      path, "image_size_px", std::to_string(p.width_px) + " x " + std::to_string(p.height_px),
      "must be that of the views, " + std::to_string(detector.width_px) + " x " + std::to_string(detector.height_px));
}

bool holdsPoses(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "views or poses");
  return map.find("poses") && !map.find("views");
}

GeometryInput readPoses(const std::string& path, const std::string& camera_path) {
  const CameraFile file = readCameraFile(camera_path);
  GeometryInput input;
  input.path = path;
  input.records = readRecords(camera_path);
  input.camera = cameraOf(camera_path, file, {});
  const CArmGeometry any;  // Angles are all that is wanted of the hands.
  input.poses = readPoseSet(path, &any);
  input.machine = input.poses->machine;
  for (const std::string& read : input.poses->input_paths) input.inputs.push_back(hashedInput(read));
  input.inputs.push_back(hashedInput(camera_path));
  return input;
}

}  // namespace

GeometryInput readGeometryInput(const std::string& views_path, const std::string& camera_path,
                                const BeadDetectionSettings& detection,
                                const std::function<void(int done, int total)>& tell) {
  if (holdsPoses(views_path)) return readPoses(views_path, camera_path);
  const ViewSet set = readViewSet(views_path);
  if (set.pattern) {
    throw InputError(views_path, "phantom", "", "is missing: the geometry needs views of beads, or registered poses");
  }
  for (const auto& view : set.views) {
    if (!view.joints) {
      throw InputError(views_path, view.name + ".primary_deg", "",
                       "is missing: the geometry needs every view's angles");
    }
  }
  GeometryInput input;
  input.path = views_path;
  input.machine = set.machine;
  input.phantom = readBeadPhantom(set.phantom_path);
  const CameraFile file = readCameraFile(camera_path);
  input.records = readRecords(camera_path);
  const bool stretched = file.distortion && file.distortion->model != DetectorDistortion::Model::kRadial;
  const BeadDetectionSettings shadows = stretched ? detection.throughIntensifier() : detection;
  const SeenViewSet seen = seenViews(set, input.phantom, shadows, [&](int done) {
    if (tell) tell(done, static_cast<int>(set.views.size()));
  });
  requireImageSize(camera_path, file, seen.detector);
  input.camera = cameraOf(camera_path, file, cameraInViews(set));
  input.camera.covariance = cameraCovariance(input.records);
  for (const std::string& path : {views_path, set.phantom_path, camera_path}) input.inputs.push_back(hashedInput(path));
  input.inputs.insert(input.inputs.end(), seen.inputs.begin(), seen.inputs.end());
  input.views = seen.views;
  for (BeadView& view : input.views) {
    const bool follows = file.distortion && file.distance_law && view.source_detector_distance_m &&
                         file.camera.parameters().source_detector_distance_m;
    const auto distortion = follows ? file.at(*view.source_detector_distance_m).distortion : file.distortion;
    if (!distortion) continue;
    std::vector<SeenBead> pinhole;
    for (SeenBead bead : view.beads) {
      const auto px = distortion->undistorted(bead.center_px);
      if (!px) continue;
      bead.center_px = *px;
      pinhole.push_back(bead);
    }
    view.beads = std::move(pinhole);
  }
  return input;
}

}  // namespace angio::calibration
