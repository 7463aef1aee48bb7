// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/evaluation/namespace.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::evaluation {

/// One thing to look at in an overlay: a tree under a pose, in a colour, with its line in the legend.
struct OverlayTree {
  Pose T_camera_model = Pose::Identity();
  Eigen::Matrix3Xd displacements_m;  ///< 3 x N [m], or empty.
  cv::Scalar color_bgr;
  std::string label;
};

/// What an overlay shows.
struct OverlayScene {
  cv::Mat image;  ///< CV_8UC1 or CV_16UC1, or empty for a dark ground.
  const Centerline2d* centerline = nullptr;
  std::vector<OverlayTree> trees;
  std::string caption;  ///< Line at the bottom.
};

extern const cv::Scalar kStartColor, kModelColor, kCenterlineColor;  ///< Blue, green, red orange.

/// Draws the X-ray with the extracted centreline and projected trees, CV_8UC3 of the camera's size.
cv::Mat drawOverlay(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera);

/// Returns where in the patient a direction (axes L, P, S, of any length) leads, in the letters of DICOM's Patient
/// Orientation (0020,0020): L left, R right, A front, P back, H head, F feet. "LA" for one that leads to the front as
/// well, by more than 20 deg; the larger share stands first.
std::string patientLetters(const Eigen::Vector3d& direction_lps);

/// Writes at the middle of each edge of an X-ray's picture (CV_8UC3) where in the patient that edge is.
///
/// @param R_camera_lps  Patient axes L, P, S in the camera.
void drawPatientLetters(cv::Mat& picture, const Eigen::Matrix3d& R_camera_lps);

/// Pictures of one type from left to right, at least one; lower ones have a dark ground below.
cv::Mat sideBySide(const std::vector<cv::Mat>& pictures);

/// Pictures of one size (CV_8UC3), at least one, in rows of `columns`, each with a gap to its right and below.
cv::Mat tiled(const std::vector<cv::Mat>& pictures, int columns, int gap_px, const cv::Scalar& ground);

/// One picture of a contact sheet: an X-ray with what was seen in it.
struct SheetPicture {
  cv::Mat image;  ///< CV_8UC1 or CV_16UC1.
  Centerline2d centerline;
  std::string caption;
};

/// Pictures in rows of `columns`, each scaled into a square of `side_px`: vessels in red, devices in blue. CV_8UC3.
/// Throws InputError without pictures or with columns or side below 1.
cv::Mat contactSheet(const std::vector<SheetPicture>& pictures, int columns, int side_px);

}  // namespace angio::evaluation
