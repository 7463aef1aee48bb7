// SPDX-License-Identifier: GPL-2.0-or-later
#include "sequence_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace angio::localisation {
namespace {

constexpr int kSteps = 5;  // For one set of matches, which the next round changes anyway.
constexpr double kNodeStep_m = 5e-3;

Pose about(const Twist& twist, const Eigen::Vector3d& center_m) {
  return Pose(Eigen::Translation3d(center_m) * expSE3(twist) * Eigen::Translation3d(-center_m));
}

// The twist about `centre_m` that makes the correction.
Twist twistOf(const Pose& correction, const Eigen::Vector3d& center_m) {
  return logSE3(Pose(Eigen::Translation3d(-center_m) * correction * Eigen::Translation3d(center_m)));
}

// The unknowns: the correction's twist, then three numbers a node.
struct System {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
};

// The correction's prior. Its twist and a step's add up but for second order, which the rounds take away.
void addPosePrior(System& system, const Pose& correction, const Eigen::Vector3d& center_m,
                  const SequenceSettings& settings) {
  Twist information;
  information.head<3>().setConstant(std::pow(1e-3 * settings.pose_translation_std_mm, -2));
  information.tail<3>().setConstant(std::pow(degToRad(settings.pose_rotation_std_deg), -2));
  system.H.topLeftCorner<6, 6>().diagonal() += information;
  system.g.head<6>() += information.cwiseProduct(twistOf(correction, center_m));
}

// The displacements' prior: see PlaceField.
void addFieldPrior(System& system, const PlaceField& field, const PlaceGrid& grid, const Eigen::Matrix3Xd& nodes_m,
                   const SequenceSettings& settings) {
  const double std_m = 1e-3 * settings.deformation_std_mm, length_m = 1e-3 * settings.deformation_length_mm;
  for (std::size_t n = 0; n < field.nodes().size(); ++n) {
    const PlaceField::Node& node = field.nodes()[n];
    const int parent = node.parent;
    const double apart_m = parent < 0 ? 1e9 : grid.path_m[node.place] - grid.path_m[field.nodes()[parent].place];
    const double kept = std::exp(-apart_m / length_m);
    const double information = 1 / (std_m * std_m * std::max(1 - kept * kept, 1e-6));
    for (int axis = 0; axis < 3; ++axis) {
      const int row = 6 + 3 * static_cast<int>(n) + axis;
      const double above_m = parent < 0 ? 0 : nodes_m(axis, parent);
      const double off_m = nodes_m(axis, static_cast<int>(n)) - kept * above_m;
      system.H(row, row) += information;
      system.g[row] += information * off_m;
      if (parent < 0) continue;
      const int other = 6 + 3 * parent + axis;
      system.H(other, other) += kept * kept * information;
      system.H(row, other) -= kept * information;
      system.H(other, row) -= kept * information;
      system.g[other] -= kept * information * off_m;
    }
  }
}

// One frame's equations with its shift eliminated, and the way back to the shift.
struct FrameBlock {
  Eigen::Matrix2d B;
  Eigen::Vector2d b;
  Eigen::Matrix2Xd E;
};

class Fit {
 public:
  Fit(std::vector<PosedFrame>& frames, const PlaceField& field, const PlaceGrid& grid, const Eigen::Vector3d& center_m,
      const SequenceSettings& settings)
      : frames_(frames), field_(field), grid_(grid), center_m_(center_m), settings_(settings) {}

  void step(Pose& correction, Eigen::Matrix3Xd& nodes_m) {
    const int count = 6 + (deforms() ? static_cast<int>(3 * field_.nodes().size()) : 0);
    System system{Eigen::MatrixXd::Zero(count, count), Eigen::VectorXd::Zero(count)};
    addPosePrior(system, correction, center_m_, settings_);
    if (deforms()) addFieldPrior(system, field_, grid_, nodes_m, settings_);
    std::vector<FrameBlock> blocks;
    for (const PosedFrame& frame : frames_) blocks.push_back(addFrame(system, frame, correction, nodes_m));
    const Eigen::VectorXd x = -system.H.ldlt().solve(system.g);
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      frames_[f].shift_px -= blocks[f].B.inverse() * (blocks[f].b + blocks[f].E * x);
    }
    correction = correction * about(x.head<6>(), center_m_);
    if (deforms()) nodes_m += Eigen::Map<const Eigen::Matrix3Xd>(x.data() + 6, 3, (count - 6) / 3);
  }

 private:
  bool deforms() const { return settings_.deformation_std_mm > 0; }

  FrameBlock addFrame(System& system, const PosedFrame& frame, const Pose& correction,
                      const Eigen::Matrix3Xd& nodes_m) const {
    const Pose T = frame.pose.T_camera_model * correction;
    const double px_per_m = frame.pose.camera.parameters().fx_px / (T * center_m_).z();
    // The frames' own shifts stay small even while the common one is looked for.
    const double shift_information = std::pow(1e-3 * settings_.localiser.shift_std_mm * px_per_m, -2);
    FrameBlock block{shift_information * Eigen::Matrix2d::Identity(), shift_information * frame.shift_px,
                     Eigen::Matrix2Xd::Zero(2, system.g.size())};
    for (const PosedPoint& one : frame.points) addPoint(system, block, frame, one, T, nodes_m);
    const Eigen::Matrix2d B_inverse = block.B.inverse();
    system.H.noalias() -= block.E.transpose() * (B_inverse * block.E);
    system.g.noalias() -= block.E.transpose() * (B_inverse * block.b);
    return block;
  }

  void addPoint(System& system, FrameBlock& block, const PosedFrame& frame, const PosedPoint& one, const Pose& T,
                const Eigen::Matrix3Xd& nodes_m) const {
    const int parent = grid_.parent[one.place] >= 0 ? grid_.parent[one.place] : one.place;
    Eigen::Vector3d p = (1 - one.weight) * grid_.points_m.col(one.place) + one.weight * grid_.points_m.col(parent);
    const PlaceField::Between at =
        deforms() ? field_.at(one.place).value_or(PlaceField::Between{}) : PlaceField::Between{};
    if (deforms()) p += (1 - at.weight) * nodes_m.col(at.a) + at.weight * nodes_m.col(at.b);
    Eigen::Matrix<double, 2, 3> P;
    const auto u = frame.pose.camera.project(T * p, &P);
    if (!u) return;
    const Eigen::Matrix<double, 2, 3> dp = P * T.linear();
    Eigen::Matrix<double, 3, 6> moved;  // The correction grows on its right.
    moved << Eigen::Matrix3d::Identity(), -skew(p - center_m_);
    std::vector<std::pair<int, Eigen::Matrix2Xd>> parts;
    parts.emplace_back(0, dp * moved);
    if (deforms()) {
      parts.emplace_back(6 + 3 * at.a, (1 - at.weight) * dp);
      parts.emplace_back(6 + 3 * at.b, at.weight * dp);
    }
    const Eigen::Vector2d Wr = one.information * (*u + frame.shift_px - one.seen_px);
    for (const auto& [row, J] : parts) {
      const Eigen::MatrixXd JtW = J.transpose() * one.information;
      system.g.segment(row, J.cols()) += J.transpose() * Wr;
      block.E.middleCols(row, J.cols()) += JtW.transpose();
      for (const auto& [column, K] : parts) system.H.block(row, column, J.cols(), K.cols()) += JtW * K;
    }
    block.B += one.information;
    block.b += Wr;
  }

  std::vector<PosedFrame>& frames_;
  const PlaceField& field_;
  const PlaceGrid& grid_;
  const Eigen::Vector3d& center_m_;
  const SequenceSettings& settings_;
};

}  // namespace

void fitShared(std::vector<PosedFrame>& frames, const std::vector<int>& tips, const PlaceGrid& grid,
               const Eigen::Vector3d& center_m, const SequenceSettings& settings, SharedFit& shared) {
  const PlaceField field(grid, tips, kNodeStep_m);
  const int nodes = static_cast<int>(field.nodes().size());
  Eigen::Matrix3Xd nodes_m = Eigen::Matrix3Xd::Zero(3, nodes);
  if (shared.displacements_m.cols() == grid.size()) {
    for (int n = 0; n < nodes; ++n) nodes_m.col(n) = shared.displacements_m.col(field.nodes()[n].place);
  }
  Fit fit(frames, field, grid, center_m, settings);
  for (int k = 0; k < kSteps; ++k) fit.step(shared.correction, nodes_m);
  if (settings.deformation_std_mm > 0) {
    shared.displacements_m = field.spread(nodes_m, 1e-3 * settings.deformation_length_mm);
  }
}

}  // namespace angio::localisation
