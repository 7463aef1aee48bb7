// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::apps {

/// The files of angio-register's views, in their order; each list has one entry for each view or is empty.
struct ViewFiles {
  std::vector<std::string> cameras, view_poses, centerlines, images;
  std::vector<int> frames;       ///< Of the images; one is for all of them.
  std::vector<int> mask_frames;  ///< Without contrast agent, to be subtracted; one is for all images, none for none.
  std::string initial_pose, t_dsa_cb;
  XaAngleSigns angle_signs = XaAngleSigns::kLaoCra;  ///< Of DICOM runs.
  /// What has to be done to every image so that it is the one as seen from the source, of which the cameras are: none,
  /// left-right, up-down or both.
  std::string flip = "none";

  /// Ends as refuseValue() does for what the command line can say wrongly of the views.
  void check() const;
};

/// Adds the options that say how images and angles are to be read: --angle-signs, --flip.
void addReadingOptions(cli::Command& app, ViewFiles& files);

/// One view as its files say it.
struct SeenView {
  XrayCamera camera;
  Pose T_view_first = Pose::Identity();
  cv::Mat image;  ///< Empty when none is given.
  Centerline2d centerline;
  std::vector<Eigen::Vector2d> collimator_px;        ///< The open field that the image shows; empty: all is open.
  std::optional<Eigen::Matrix3d> R_camera_lps = {};  ///< Patient axes L, P, S in the camera, where angles say them.
};

/// All views and where the tree is thought to be.
struct SeenViews {
  std::vector<SeenView> views;
  Pose T_camera_model = Pose::Identity();  ///< In the first view, to start from.
  double image_s = 0;                      ///< Time from images to centrelines [s].
  std::vector<std::string> assumed;        ///< What no file said, one sentence each.
};

/// Reads the views. Without cameras the images are DICOM runs, which bring theirs; without an initial pose the first
/// one's angles give it, and without view poses each one's. Throws InputError for files that cannot be read or that do
/// not say what is needed.
SeenViews readViews(const ViewFiles& files, const VesselTree& tree, CenterlineExtractor& extractor);

}  // namespace angio::apps
