// SPDX-License-Identifier: GPL-2.0-or-later
#include "phantom_images.hpp"

#include <opencv2/imgproc.hpp>

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

}  // namespace

PhantomRenderer::PhantomRenderer(const BeadPhantom& phantom, int seed)
    : phantom_(phantom), renderer_(noVessel(phantom.center_m()), look(seed)) {}

cv::Mat PhantomRenderer::render(const XrayCamera& camera, const Pose& T_camera_phantom, const std::vector<int>& shown,
                                const std::optional<DetectorDistortion>& distortion, std::uint64_t frame) {
  XrayScene scene;
  scene.T_camera_model = T_camera_phantom;
  for (const int i : shown) {
    const Bead& bead = phantom_.beads[static_cast<std::size_t>(i)];
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

}  // namespace angio::calibration
