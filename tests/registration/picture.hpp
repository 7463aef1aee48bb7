// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "angio/registration/xray_view.hpp"
#include "angio/test/namespace.hpp"
#include "angio/tubes/tubes.hpp"

namespace angio::test {

/// What an X-ray image of vessels along a centreline looks like, CV_8UC1: dark lines of one width on a grey ground.
inline cv::Mat pictureOf(const Centerline2d& centerline, const XrayCamera& camera) {
  cv::Mat picture(camera.height_px(), camera.width_px(), CV_8UC1, cv::Scalar(200));
  constexpr int kShift = 4, kWidth_px = 7;
  const auto at = [&](int i) {
    const Eigen::Vector2d p = (1 << kShift) * centerline.points_px.col(i);
    return cv::Point(cvRound(p.x()), cvRound(p.y()));
  };
  for (int i = 0; i < centerline.size(); ++i) {
    const bool joined = i > 0 && centerline.ordered() && centerline.branch[i] == centerline.branch[i - 1];
    cv::line(picture, joined ? at(i - 1) : at(i), at(i), cv::Scalar(80), kWidth_px, cv::LINE_AA, kShift);
  }
  cv::GaussianBlur(picture, picture, {}, 1.5);
  return picture;
}

/// A tree with all its radii, alone in the beam, without noise, CV_16UC1: what an X-ray image would ideally be.
inline cv::Mat radiographOf(const VesselTree& tree, const XrayCamera& camera, const Pose& T_camera_model) {
  constexpr double kAttenuation_per_m = 100;  // A vessel of 3 mm takes a quarter.
  PathLengths lengths;
  cv::Mat image;
  cv::exp(-kAttenuation_per_m * lengths.compute(TubeTree(tree).tubes(tree.points(), {}), camera, T_camera_model),
          image);
  image.convertTo(image, CV_16U, 20000);
  return image;
}

/// A tree where the first camera has it.
struct ShownTree {
  const VesselTree& tree;
  Pose T_camera_model;
};

/// Views with X-ray images, of a tree where one is shown and else of their centrelines; or as they are.
class SeenScene {
 public:
  SeenScene(const XrayViews& views, bool images, const std::optional<ShownTree>& shown = std::nullopt) : views_(views) {
    for (XrayView& view : views_) {
      if (!images) continue;
      images_.push_back(shown ? radiographOf(shown->tree, view.camera, view.T_view_first * shown->T_camera_model)
                              : pictureOf(view.centerline, view.camera));
      view.image = &images_.back();
    }
  }
  SeenScene(const SeenScene&) = delete;
  SeenScene& operator=(const SeenScene&) = delete;

  const XrayViews& views() const { return views_; }

 private:
  XrayViews views_;
  std::deque<cv::Mat> images_;  // A deque's elements stay where they are.
};

}  // namespace angio::test
