// SPDX-License-Identifier: GPL-2.0-or-later
#include "start_draws.hpp"

#include <cmath>

#include "angio/registration/starts.hpp"

namespace angio::registration {

std::vector<Pose> StartDraws::poses(const PosePriorTerm& belief, const StartSettings& starts, int count) {
  if (starts.seed != seed_) unit_draws_.clear();
  seed_ = starts.seed;
  while (static_cast<int>(unit_draws_.size()) < count) {
    unit_draws_.push_back(unitDraw(seed_, static_cast<int>(unit_draws_.size())));
  }
  const Matrix6d L = belief.information.inverse().llt().matrixL().toDenseMatrix();
  Vector6d half_box;
  half_box << Eigen::Vector3d::Constant(1e-3 * starts.box_translation_mm),
      Eigen::Vector3d::Constant(degToRad(starts.box_rotation_deg));
  std::vector<Pose> poses(static_cast<std::size_t>(count), belief.T0_camera_centered);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Vector6d& z = unit_draws_[i];
    Twist xi = L * z;
    if (starts.box()) xi = half_box.cwiseProduct(z.unaryExpr([](double x) { return std::erf(x / std::sqrt(2.0)); }));
    Pose offset = Pose::Identity();
    offset.linear() = expSO3(xi.tail<3>());
    offset.translation() = xi.head<3>();
    poses[i] = belief.T0_camera_centered * offset;
  }
  return poses;
}

std::vector<Pose> StartDraws::withoutShift(const PosePriorTerm& belief, const StartSettings& starts, int count) {
  std::vector<Pose> drawn = poses(belief, starts, count);
  for (Pose& T : drawn) T.translation().head<2>() = belief.T0_camera_centered.translation().head<2>();
  return drawn;
}

double shiftReach_m(const PosePriorTerm& belief, const StartSettings& starts, double standard_deviations) {
  if (starts.box()) return 1e-3 * starts.box_translation_mm;
  return standard_deviations * std::sqrt(belief.information.inverse().topLeftCorner<3, 3>().trace() / 3);
}

}  // namespace angio::registration
