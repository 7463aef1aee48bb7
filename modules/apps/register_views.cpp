// SPDX-License-Identifier: GPL-2.0-or-later
#include "register_views.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <set>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/calibration_records/centered_carm.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/imaging/collimator_opening.hpp"
#include "angio/imaging/subtraction.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/vessel/undistort.hpp"
#include "angle_signs_option.hpp"

namespace angio::apps {
namespace {

// Files of these kinds have no camera of their own; one without a name's ending may be a DICOM run.
bool isPlainPicture(const std::string& path) {
  static const std::set<std::string> kEndings = {".png", ".tif", ".tiff", ".jpg", ".jpeg"};
  return kEndings.count(extensionOf(path)) > 0;
}

int frameOf(const std::vector<int>& frames, std::size_t view) {
  return frames.empty() ? 0 : frames[std::min(view, frames.size() - 1)];
}

// The run's geometry at a view's frame, where something is asked of it that no other file says.
std::optional<XaGeometry> geometryOf(const ViewFiles& files, std::size_t view) {
  if (!files.cameras.empty() && !(view == 0 && files.initial_pose.empty())) return std::nullopt;
  return XaRun(files.images[view], files.angle_signs).geometry(frameOf(files.frames, view));
}

const Pose& poseByAngles(const std::optional<XaGeometry>& geometry, const std::string& image, const char* option) {
  if (geometry && geometry->T_camera_patient) return *geometry->T_camera_patient;
  throw InputError(image.empty() ? option : image, "pose", "",
                   std::string(option) + " is needed: there is no image with angles and a distance to the isocentre");
}

// Where the tree lies in the patient's axes, with the isocentre as origin.
Pose treeInPatient(const ViewFiles& files, const VesselTree& tree, std::vector<std::string>& assumed) {
  if (!files.t_dsa_cb.empty() && files.t_dsa_cb != kCentered) return readViewPose(files.t_dsa_cb);
  assumed.push_back(kCenteredAssumption);
  return centeredInPatient(tree.centroid());
}

// A frame as seen from the source.
cv::Mat frameSeen(const ViewFiles& files, std::size_t view, const XrayCamera& camera, const std::vector<int>& frames) {
  cv::Mat image = readXrayImage(files.images[view], camera, frameOf(frames, view));
  if (files.flip != "none") cv::flip(image, image, files.flip == "left-right" ? 1 : files.flip == "up-down" ? 0 : -1);
  return image;
}

cv::Mat imageOf(const ViewFiles& files, std::size_t view, const XrayCamera& camera) {
  if (files.images.empty()) return {};
  const cv::Mat image = frameSeen(files, view, camera, files.frames);
  return files.mask_frames.empty() ? image : subtracted(image, frameSeen(files, view, camera, files.mask_frames));
}

// The centreline and the open field of an image; the shutters are where they are, also when a mask was subtracted.
void look(const ViewFiles& files, std::size_t index, CenterlineExtractor& extractor, SeenView& view) {
  view.centerline = vesselsToMatch(extractor.extract(view.image));
  const bool whole = files.mask_frames.empty();
  const cv::Mat plain = whole ? view.image : frameSeen(files, index, view.camera, files.frames);
  view.collimator_px = findOpenField(plain).polygon_px;
}

// The image as the pinhole camera would have shown it; black where the detector did not reach.
cv::Mat undistorted(const cv::Mat& image, const DetectorDistortion& distortion) {
  if (image.empty()) return image;
  cv::Mat_<cv::Vec2f> from(image.size());
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector2f at = distortion.distorted(Eigen::Vector2d(x, y)).cast<float>();
      from(y, x) = {at.x(), at.y()};
    }
  }
  cv::Mat result;
  cv::remap(image, result, from, cv::noArray(), cv::INTER_LINEAR);
  return result;
}

// What was seen, moved to where the view's pinhole camera sees it: all that a registration takes.
void undistort(SeenView& view, const DetectorDistortion& distortion) {
  view.centerline = undistorted(view.centerline, distortion);
  view.image = undistorted(view.image, distortion);
  std::vector<Eigen::Vector2d> corners;
  for (const auto& corner : view.collimator_px) {
    if (const auto moved = distortion.undistorted(corner)) corners.push_back(*moved);
  }
  view.collimator_px = std::move(corners);
}

}  // namespace

void addReadingOptions(cli::Command& app, ViewFiles& files) {
  addAngleSignsOption(app, files.angle_signs)->group(cli::kFurtherOptions);
  app.addOption("--flip", files.flip,
                "How images have to be flipped to be the ones as seen from the source, of which the cameras are: where "
                "they were stored as a display showed them")
      ->check(cli::oneOf({"none", "left-right", "up-down", "both"}))
      ->group(cli::kFurtherOptions);
}

void ViewFiles::check() const {
  const std::size_t views = cameras.empty() ? images.size() : cameras.size();
  const auto check = [](const char* option, std::size_t given, std::size_t wanted, const char* rule) {
    if (given == wanted) return;
    cli::refuseValue(option, std::to_string(given) + " given, must be " + std::to_string(wanted) + ": " + rule);
  };
  const bool plain = images.empty() || std::any_of(images.begin(), images.end(), isPlainPicture);
  if (cameras.empty() && plain) cli::refuseValue("--camera", "is needed: only DICOM runs bring theirs");
  if (initial_pose.empty() && (images.empty() || isPlainPicture(images.front()))) {
    cli::refuseValue("--initial-pose", "is needed: only DICOM runs have angles");
  }
  if (!initial_pose.empty() && !t_dsa_cb.empty()) {
    cli::refuseValue("--t-dsa-cb", "must not stand beside --initial-pose, which it is there to find");
  }
  if (!centerlines.empty()) check("--centerline", centerlines.size(), views, "one for each camera");
  if (!images.empty()) check("--image", images.size(), views, "one for each camera");
  if (frames.size() > 1) check("--frame", frames.size(), views, "one for all images, or one for each");
  if (mask_frames.size() > 1) check("--mask-frame", mask_frames.size(), views, "one for all images, or one for each");
  if (!mask_frames.empty() && images.empty()) cli::refuseValue("--mask-frame", "is of --image");
  if (!view_poses.empty() || !cameras.empty()) {
    check("--view-pose", view_poses.size(), views - 1, "one for each camera but the first");
  }
}

SeenViews readViews(const ViewFiles& files, const VesselTree& tree, CenterlineExtractor& extractor) {
  SeenViews seen;
  std::optional<Pose> T_first_patient;
  const std::size_t count = files.cameras.empty() ? files.images.size() : files.cameras.size();
  for (std::size_t v = 0; v < count; ++v) {
    const auto geometry = geometryOf(files, v);
    const std::string image = files.images.empty() ? "" : files.images[v];
    const CameraFile camera =
        files.cameras.empty() ? CameraFile{geometry->camera, {}, {}} : readCameraFile(files.cameras[v]);
    SeenView view{camera.camera, Pose::Identity(), {}, {}, {}};
    if (v == 0 && geometry) T_first_patient = geometry->T_camera_patient;
    if (v == 0) {
      seen.T_camera_model = files.initial_pose.empty() ? poseByAngles(geometry, image, "--initial-pose") *
                                                             treeInPatient(files, tree, seen.assumed)
                                                       : readPose(files.initial_pose).T_camera_model;
    } else if (!files.view_poses.empty()) {
      view.T_view_first = readViewPose(files.view_poses[v - 1]);
    } else {
      if (!T_first_patient) poseByAngles(std::nullopt, files.images.front(), "--view-pose");
      view.T_view_first = poseByAngles(geometry, image, "--view-pose") * T_first_patient->inverse();
      seen.assumed.push_back(image + ": stands against the first view by the angles, with one isocentre for both");
    }
    if (T_first_patient) view.R_camera_lps = (view.T_view_first * *T_first_patient).linear();
    view.image = imageOf(files, v, view.camera);
    if (files.centerlines.empty()) {
      const Stopwatch stage;
      look(files, v, extractor, view);
      seen.image_s += stage.seconds();
    } else {
      view.centerline = readCenterline(files.centerlines[v]);
    }
    if (camera.distortion) undistort(view, *camera.distortion);
    if (geometry) {
      for (const std::string& line : geometry->assumed) seen.assumed.push_back(image + ": " + line);
    }
    seen.views.push_back(std::move(view));
  }
  return seen;
}

}  // namespace angio::apps
