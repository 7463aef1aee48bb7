// SPDX-License-Identifier: GPL-2.0-or-later
#include "across_beam.hpp"

#include "deformation_equations.hpp"
#include "deformation_posterior.hpp"
#include "pose_prior_term.hpp"
#include "projected_edges.hpp"
#include "residual_groups.hpp"

namespace angio::registration {
namespace {

// The pose is known so well. A round that moves the tree by less (rms) is the last.
constexpr double kPinned_m = 0.1e-3, kPinned_rad = 1e-3, kRefined_m = 0.3e-3;
constexpr int kRefinements = 2;

PosePriorTerm pinnedAt(const Pose& T_camera_centered) {
  PosePriorTerm pinned;
  pinned.T0_camera_centered = T_camera_centered;
  pinned.information.diagonal() << Eigen::Vector3d::Constant(1 / (kPinned_m * kPinned_m)),
      Eigen::Vector3d::Constant(1 / (kPinned_rad * kPinned_rad));
  return pinned;
}

}  // namespace

Eigen::Matrix3Xd refinedAcrossBeam(const OrientedModel& model, const DeformationNodes& nodes, double length_m,
                                   const OrientedFrame& frame, const Pose& T_camera_centered,
                                   Eigen::Matrix3Xd displaced, LineGate gate) {
  const XrayCamera& camera = frame.views().front().camera;
  const OrientedPoints& image = frame.points(0);
  const PosePriorTerm pinned = pinnedAt(T_camera_centered);
  ProjectedEdges projected;
  LineMatches matches;
  DeformationEquations<2> data(nodes, T_camera_centered.linear().topRows<2>().transpose());
  for (int round = 0; round < kRefinements; ++round) {
    projected.project(displaced, model.edges, camera, T_camera_centered);
    if (frame.length_px() < kFewLines * projected.length_px()) break;
    matchLines(image, projected, gate.gate_px, kMinCos2, matches);
    data.clear();
    data.addLinePull({camera, T_camera_centered, displaced}, model, image, matches, gate.tolerance_px, 1);
    if (!(data.weight > 0)) break;
    gate.noise_px = noiseBehind(data.squares_px2 / data.weight, gate.tolerance_px);
    const auto groups = residualGroups({{camera, T_camera_centered, image, matches}}, model, displaced,
                                       gate.tolerance_px, kViewsGroups);
    if (groups.size() < static_cast<std::size_t>(kMinGroups)) break;
    const DeformationPosterior posterior(groups, pinned, T_camera_centered, length_m, kViewsShape);
    if (!posterior.known()) break;
    Eigen::Matrix3Xd places = T_camera_centered * expSE3(posterior.twist()) *
                              (model.points + nodes.atPoints(posterior.displacements(nodes.points)));
    if (!(places.row(2).minCoeff() > 0)) break;
    const Eigen::Matrix3Xd before = T_camera_centered * displaced;
    places.array().rowwise() *= (before.row(2).array() / places.row(2).array()).eval();
    displaced = T_camera_centered.inverse() * places;
    gate.tighten();
    if ((places - before).squaredNorm() < kRefined_m * kRefined_m * static_cast<double>(places.cols())) break;
  }
  return displaced;
}

}  // namespace angio::registration
