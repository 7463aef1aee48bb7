// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/anatomy_pictures.hpp"

#include <algorithm>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/overlay.hpp"
#include "bar_chart.hpp"

namespace angio::calibration {
namespace {

const AnatomyViewFit* fitOf(const AnatomyResult& result, const std::string& name) {
  const auto fit =
      std::find_if(result.views.begin(), result.views.end(), [&](const auto& one) { return one.name == name; });
  return fit == result.views.end() ? nullptr : &*fit;
}

Pose jointPose(const AnatomyResult& result, const AnatomyView& view) {
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  for (const RunShift& run : result.runs) {
    if (run.run == view.run) shift_m = run.shift_m;
  }
  return view.T_camera_patient * Eigen::Translation3d(shift_m) * result.T_dsa_cb;
}

}  // namespace

cv::Mat anatomyOverlay(const AnatomyResult& result, const AnatomyView& view, const SeenAnatomy& seen,
                       const VesselTree& tree, const cv::Mat& image) {
  OverlayScene scene;
  scene.image = image;
  scene.centerline = &seen.centerline;
  scene.trees = {{view.T_camera_model, {}, kStartColor, "registered in this view alone"},
                 {jointPose(result, view), {}, kModelColor, "by all views together"}};
  scene.caption = view.name;
  if (const AnatomyViewFit* fit = fitOf(result, view.name)) {
    scene.caption += formatted(": %.2f deg, %.1f mm apart", radToDeg(fit->rotation_rad), 1e3 * fit->translation_m);
    if (fit->outlier) scene.caption += " - OUTLIER, left out";
  }
  return drawOverlay(scene, tree, seen.camera);
}

cv::Mat anatomyResiduals(const AnatomyResult& result) {
  BarChart turns{"Turn between a view's own registration and all views' [deg]", "deg"},
      places{"The same of its place, at the model's centre [mm]", "mm"};
  for (const AnatomyViewFit& view : result.views) {
    turns.add(view.name, radToDeg(view.rotation_rad), view.outlier);
    places.add(view.name, 1e3 * view.translation_m, view.outlier);
  }
  return drawPlots({turns.plot, places.plot}, 720, 270);
}

}  // namespace angio::calibration
