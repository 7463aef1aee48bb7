// SPDX-License-Identifier: GPL-2.0-or-later
#include "value_checks.hpp"
#include "angio/test/namespace.hpp"

#include <cmath>

#include "readers.hpp"

namespace angio::test {
namespace {

void checkPositive(const Eigen::VectorXd& values, int points) {
  if (values.size() == 0) return;
  promised(values.size() == points, "as many values as points");
  promised(values.allFinite() && (values.array() > 0).all(), "values are positive");
}

}  // namespace

void checkTree(const VesselTree& tree) {
  promised(!VesselTree::findDefect(tree.points(), tree.parents(), tree.radii()), "a tree is sound");
  promised(std::isfinite(tree.length()) && tree.tangents().allFinite(), "a tree is finite");
}

void checkCenterline(const Centerline2d& line) {
  const int n = line.size();
  promised(n >= 1, "a centreline has a point");
  promised(line.points_px.allFinite(), "points are finite");
  promised(line.tangent_rad.size() == n && line.tangent_rad.allFinite(), "each point has a tangent");
  promised((line.tangent_rad.array() >= -kPi / 2).all() && (line.tangent_rad.array() < kPi / 2).all(),
           "tangents are undirected");
  promised(line.branch.empty() || line.branch.size() == static_cast<std::size_t>(n), "each point has a branch");
  promised(line.kind.empty() || line.kind.size() == static_cast<std::size_t>(n), "each point has a kind");
  promised(line.contrast.size() == 0 || (line.contrast.size() == n && line.contrast.allFinite()), "contrast is finite");
  checkPositive(line.radius_px, n);
  checkPositive(line.std_px, n);
}

void checkCamera(const XrayCamera& camera) {
  const XrayCamera again(camera.parameters());  // Checks them all.
  promised(again.ray({0, 0}).allFinite(), "a camera has rays");
}

void checkPose(const Pose& pose) {
  promised(pose.matrix().allFinite(), "a pose is finite");
  promised(rotationDefect(pose.linear()) < 1e-9, "a rotation is made exact");
}

void checkFrame(const cv::Mat& frame) {
  promised(!frame.empty() && frame.rows <= 8192 && frame.cols <= 8192, "a frame has pixels, and not too many");
  promised(frame.type() == CV_8UC1 || frame.type() == CV_16UC1, "a frame is grey, of 8 or 16 bits");
}

}  // namespace angio::test
