// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_nodes.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "angio/geometry/matern.hpp"

namespace angio::registration {

// Share of the variance at any node that the modes may leave out.
constexpr double kLeftOut = 1e-3;

DeformationNodes::DeformationNodes(const OrientedModel& model, double spacing_m) {
  const VesselTree& tree = model.resampled.tree;
  place_of_point.resize(tree.size());
  std::vector<int> node_of_point(place_of_point.size(), -1);
  std::vector<Eigen::Vector3d> nodes;
  stretch_of_edge.resize(model.edges.size());
  std::vector<int> edge_of_child(place_of_point.size(), -1);
  for (std::size_t e = 0; e < model.edges.size(); ++e) edge_of_child[model.edges[e].second] = static_cast<int>(e);
  for (const auto& branch : tree.branches()) {
    std::vector<double> along(branch.size(), 0);
    for (std::size_t k = 1; k < branch.size(); ++k) {
      along[k] = along[k - 1] + (model.points.col(branch[k]) - model.points.col(branch[k - 1])).norm();
    }
    const int pieces = std::max(1, static_cast<int>(std::lround(along.back() / spacing_m)));
    const double piece_m = std::max(1e-9, along.back() / pieces);
    int& first = node_of_point[branch.front()];
    if (first < 0) {
      first = static_cast<int>(nodes.size());
      nodes.push_back(model.points.col(branch.front()));
    }
    const int first_edge = static_cast<int>(edges.size());
    std::size_t k = 1;
    for (int piece = 1; piece <= pieces; ++piece) {
      edges.emplace_back(piece == 1 ? first : static_cast<int>(nodes.size()) - 1, static_cast<int>(nodes.size()));
      while (k + 1 < branch.size() && along[k] < piece * piece_m) ++k;
      const double step = along[k] - along[k - 1];
      const double w = step > 0 ? std::clamp((piece * piece_m - along[k - 1]) / step, 0.0, 1.0) : 1.0;
      nodes.push_back((1 - w) * model.points.col(branch[k - 1]) + w * model.points.col(branch[k]));
    }
    node_of_point[branch.back()] = static_cast<int>(nodes.size()) - 1;
    for (std::size_t i = 0; i < branch.size(); ++i) {
      const int piece = std::clamp(static_cast<int>(along[i] / piece_m), 0, pieces - 1);
      place_of_point[branch[i]] = {first_edge + piece, std::clamp(along[i] / piece_m - piece, 0.0, 1.0)};
      if (i == 0) continue;
      const double begin = along[i - 1] / piece_m, end = along[i] / piece_m;
      const int on = std::clamp(static_cast<int>(0.5 * (begin + end)), 0, pieces - 1);
      stretch_of_edge[edge_of_child[branch[i]]] = {first_edge + on, std::clamp(begin - on, 0.0, 1.0),
                                                   std::clamp(end - on, 0.0, 1.0)};
    }
  }
  points.resize(3, nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) points.col(i) = nodes[i];
}

Eigen::Matrix3Xd DeformationNodes::atPoints(const Eigen::Matrix3Xd& at_nodes) const {
  Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(place_of_point.size()));
  for (std::size_t i = 0; i < place_of_point.size(); ++i) {
    if (place_of_point[i].edge < 0) {
      result.col(i).setZero();
      continue;
    }
    const auto& [parent, child] = edges[place_of_point[i].edge];
    const double w = place_of_point[i].weight;
    result.col(i) = (1 - w) * at_nodes.col(parent) + w * at_nodes.col(child);
  }
  return result;
}

Eigen::MatrixXd smoothModes(const Eigen::Matrix3Xd& nodes, double std_m, double length_m, int most) {
  const Eigen::Index n = nodes.cols();
  Eigen::MatrixXd factor(n, std::min<Eigen::Index>(n, most));
  Eigen::VectorXd left = Eigen::VectorXd::Ones(n);  // Of the variance, relative.
  Eigen::Index count = 0;
  for (; count < factor.cols(); ++count) {
    Eigen::Index pivot = 0;
    if (!(left.maxCoeff(&pivot) > kLeftOut)) break;
    Eigen::VectorXd column(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      column[i] = maternCorrelation((nodes.col(i) - nodes.col(pivot)).norm() / length_m);
    }
    if (count > 0) column.noalias() -= factor.leftCols(count) * factor.row(pivot).head(count).transpose();
    factor.col(count) = column / std::sqrt(left[pivot]);
    left -= factor.col(count).cwiseAbs2();
  }
  factor.conservativeResize(n, count);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(factor.transpose() * factor);
  return std_m * factor * axes.eigenvectors().rowwise().reverse();
}

}  // namespace angio::registration
