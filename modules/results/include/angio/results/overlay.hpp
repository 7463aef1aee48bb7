// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/result.hpp"
#include "angio/results/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::results {

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
  std::string caption;                               ///< Below the legend.
  std::optional<Eigen::Matrix3d> R_camera_lps = {};  ///< Patient axes L, P, S in the camera, where they are known.
};

extern const cv::Scalar kStartColor, kCenterlineColor;  ///< Blue, violet.

/// Colours by status: bluish green, amber and red, which colour-blind readers can tell from each other.
extern const cv::Scalar kConvergedColor, kLimitedColor, kRejectedColor;

/// How a registered tree is shown: in a colour, and with words for the legend.
struct StatusStyle {
  cv::Scalar color_bgr;
  std::string words;
};

/// Returns kConvergedColor for a converged result, kLimitedColor for a converged one that is not usable for every task,
/// kRejectedColor for any other; and the status in words.
///
/// @param usable_for  CaseOutcome::usable_for; nothing where the tasks were not asked for.
StatusStyle statusStyle(RegistrationStatus status,
                        const std::optional<std::vector<std::string>>& usable_for = std::nullopt);

/// Returns how well image and tree agree, in words: the mean distance from what the image shows to the tree, and the
/// share of the tree in view that the image explains. Vessels without contrast agent count in the share alone.
std::string alignmentInWords(const AlignmentScore& alignment);

/// Draws the X-ray with the extracted centreline, the projected trees and, where the patient's axes are known,
/// drawPatientLetters(). CV_8UC3 of the camera's size, without any other text.
cv::Mat drawOverlayImage(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera);

/// The same with legend and caption in a band below it: CV_8UC3 of the camera's width, and higher than it by as many
/// lines as the texts need.
cv::Mat drawOverlay(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera);

/// Draws an X-ray with what was seen in it: vessels in red, devices in blue, and a legend in a band below. CV_8UC3 of
/// the image's width.
cv::Mat drawCenterline(const cv::Mat& image, const Centerline2d& seen);

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

/// Pictures (CV_8UC3), at least one, in rows of `columns`, each in the upper left corner of a cell of the largest width
/// and height, with a gap to the cell's right and below.
cv::Mat tiled(const std::vector<cv::Mat>& pictures, int columns, int gap_px, const cv::Scalar& ground);

/// One picture of a contact sheet: an X-ray with what was seen in it.
struct SheetPicture {
  cv::Mat image;  ///< CV_8UC1 or CV_16UC1.
  Centerline2d centerline;
  std::string caption;
};

/// Pictures in rows of `columns`, each scaled into a square of `side_px` with its caption below: vessels in red,
/// devices in blue. CV_8UC3. Throws InputError without pictures or with columns or side below 1.
cv::Mat contactSheet(const std::vector<SheetPicture>& pictures, int columns, int side_px);

}  // namespace angio::results
