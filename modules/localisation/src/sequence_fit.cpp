// SPDX-License-Identifier: GPL-2.0-or-later
#include "sequence_fit.hpp"
#include "angio/geometry/decompositions.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "place_grid.hpp"

namespace angio::localisation {
namespace {

/// Displacements of the vessels that a catheter lies in, as a Gaussian process along the tree: known at some places,
/// linear between them, and fading beyond.
///
/// Ornstein and Uhlenbeck's: of two nodes that are d apart the further one is exp(-d/length) of the nearer one, give or
/// take std sqrt(1 - exp(-2 d/length)); on a tree that is a chain of independent steps.
class PlaceField {
 public:
  /// A node's place and its nearest node towards the root.
  struct Node {
    int place = 0;
    int parent = -1;  ///< Index of a node; -1 at the root.
  };
  /// A place between two nodes: (1 - weight) of a and weight of b.
  struct Between {
    int a = 0, b = 0;
    double weight = 0;
  };

  /// Nodes about every `step_m` along the routes from `tips` to their roots.
  PlaceField(const PlaceGrid& grid, const std::vector<int>& tips, double step_m)
      : grid_(grid), node_below_(grid.size(), -1) {
    std::vector<int> uses(grid.size(), 0);  // How many used children a place has, plus one for being used.
    for (const int tip : tips) {
      if (uses[tip] == 0) uses[tip] = 1;
      for (int at = tip; grid.parent[at] >= 0; at = grid.parent[at]) {
        const bool known = uses[grid.parent[at]] > 0 && node_below_[at] == -2;
        if (known) break;
        node_below_[at] = -2;  // The edge above has been counted.
        uses[grid.parent[at]] += uses[grid.parent[at]] == 0 ? 2 : 1;
      }
    }
    // Parents first: nodes at roots, forks, ends, and where the last one is a step away.
    std::vector<int> node_above(grid.size(), -1);
    for (int i = 0; i < grid.size(); ++i) {
      node_below_[i] = -1;
      if (uses[i] == 0) continue;
      const int above = grid.parent[i] >= 0 ? node_above[grid.parent[i]] : -1;
      const bool far = above < 0 || grid.path_m[i] - grid.path_m[nodes_[above].place] >= step_m;
      node_above[i] = above;
      if (!far && uses[i] == 2) continue;
      node_above[i] = static_cast<int>(nodes_.size());
      nodes_.push_back({i, above});
    }
    for (int i = grid.size() - 1; i >= 0; --i) {
      if (uses[i] == 0) continue;
      if (nodes_[node_above[i]].place == i) node_below_[i] = node_above[i];
      const int parent = grid.parent[i];
      if (parent >= 0 && nodes_[node_above[parent]].place != parent) node_below_[parent] = node_below_[i];
    }
  }

  const std::vector<Node>& nodes() const { return nodes_; }

  /// Where a place of the routes lies; nothing for other places.
  std::optional<Between> at(int place) const {
    const int below = node_below_[place];
    if (below < 0) return std::nullopt;
    const int above = nodes_[below].parent;
    if (above < 0) return Between{below, below, 0};
    const double from = grid_.path_m[nodes_[above].place], to = grid_.path_m[nodes_[below].place];
    return Between{above, below, to > from ? (grid_.path_m[place] - from) / (to - from) : 1};
  }

  /// Displacements of all places (3 x N [m]) from the nodes' (3 x M [m]).
  Eigen::Matrix3Xd spread(const Eigen::Matrix3Xd& of_nodes_m, double length_m) const {
    Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, grid_.size());
    for (int i = 0; i < grid_.size(); ++i) {
      const int parent = grid_.parent[i];
      if (const auto between = at(i)) {
        result.col(i) =
            (1 - between->weight) * of_nodes_m.col(between->a) + between->weight * of_nodes_m.col(between->b);
      } else if (parent >= 0) {
        result.col(i) = std::exp((grid_.path_m[parent] - grid_.path_m[i]) / length_m) * result.col(parent);
      }
    }
    return result;
  }

 private:
  const PlaceGrid& grid_;
  std::vector<Node> nodes_;
  std::vector<int> node_below_;  // Of each place: the node at it or the next one towards the tip; -1 off the routes.
};

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

// One frame's equations with its shift eliminated, and the back substitution of the shift.
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
    const Eigen::VectorXd x = -solveSymmetric(system.H, system.g);
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
