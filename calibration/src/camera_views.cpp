// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/camera_views.hpp"

#include "angio/base/errors.hpp"
#include "angio/calibration/bead_matching.hpp"
#include "angio/calibration/bead_tables.hpp"
#include "angio/io/image_files.hpp"

namespace angio::calibration {
namespace {

std::vector<BeadDetection> beadsOf(const PhantomView& view, const BeadPhantom& phantom,
                                   const BeadDetectionSettings& settings, DetectorOfViews& detector) {
  if (view.is_table) return readBeadTable(view.path);
  if (!phantom.isCoded()) {
    throw InputError(view.path, "image", "", "must be a table: the phantom " + phantom.name + " is a grid of marks");
  }
  const cv::Mat image = readXrayImage(view.path);
  if (detector.width_px == 0) {
    detector.width_px = image.cols;
    detector.height_px = image.rows;
  }
  if (image.cols != detector.width_px || image.rows != detector.height_px) {
    throw InputError(view.path, "image_size_px", std::to_string(image.cols) + " x " + std::to_string(image.rows),
                     "must be " + std::to_string(detector.width_px) + " x " + std::to_string(detector.height_px) +
                         " as the view set or its first image says");
  }
  return detectBeads(image, settings);
}

}  // namespace

SeenViewSet seenViews(const ViewSet& set, const BeadPhantom& phantom, const BeadDetectionSettings& settings,
                      const std::function<void(int done)>& progress) {
  SeenViewSet seen;
  seen.inputs = hashedViews(set);
  seen.detector = {set.image_width_px, set.image_height_px, set.pixel_spacing_m};
  std::vector<Eigen::Matrix3d> likely;
  for (const PhantomView& view : set.views) {
    std::vector<BeadDetection> beads = beadsOf(view, phantom, settings, seen.detector);
    BeadView labelled{view.name, {}, view.source_detector_distance_m, view.held_out};
    if (beads.empty() || !beads.front().bead) {
      if (!phantom.isCoded()) {
        throw InputError(view.path, "bead", "", "is missing: marks of " + phantom.name + " have no sizes to tell by");
      }
      const BeadMatch match = matchBeads(view.path, phantom, beads, likely);
      likely.insert(likely.begin(), match.R_camera_phantom);
      for (std::size_t i = 0; i < beads.size(); ++i) beads[i].bead = match.bead[i];
    }
    for (const BeadDetection& bead : beads) {
      if (bead.bead) labelled.beads.push_back({*bead.bead, bead.center_px, bead.std_px});
    }
    seen.unmatched.push_back(static_cast<int>(beads.size() - labelled.beads.size()));
    seen.views.push_back(std::move(labelled));
    if (progress) progress(static_cast<int>(seen.views.size()));
  }
  return seen;
}

}  // namespace angio::calibration
