// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_equations.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace angio::registration {

constexpr Eigen::Index kPanel = 16;

template <int D>
void DeformationEquations<D>::clear() {
  H.setZero();
  g.setZero();
  mixed.assign(nodes.size(), Eigen::Matrix<double, 6, D>::Zero());
  pull.assign(nodes.size(), Column::Zero());
  own.assign(nodes.size(), Block::Zero());
  along.assign(nodes.edges.size(), Block::Zero());
  weight = squares_px2 = 0;
}

template <int D>
void DeformationEquations<D>::add(const DeformationNodes::Place& place, double w, double r, const Vector6d& J,
                                  const Column& h) {
  const auto [a, b] = nodes.edges[place.edge];
  const double wb = place.weight, wa = 1 - wb;
  const Block hh = w * h * h.transpose();
  const Eigen::Matrix<double, 6, D> Jh = w * J * h.transpose();
  H.noalias() += w * J * J.transpose();
  g.noalias() += w * r * J;
  mixed[a] += wa * Jh;
  mixed[b] += wb * Jh;
  pull[a] += wa * w * r * h;
  pull[b] += wb * w * r * h;
  own[a] += wa * wa * hh;
  own[b] += wb * wb * hh;
  along[place.edge] += wa * wb * hh;
  weight += w;
  squares_px2 += w * r * r;
}

template <int D>
void DeformationEquations<D>::addFieldPull(const DeformedView& view, const OrientedModel& model,
                                           const KernelField& field, const std::vector<HalfPlane>& in_view,
                                           const PullWeight& pull_weight, int stride, double view_weight) {
  const Eigen::Matrix3d R = view.T_view_centered.linear();
  const Eigen::Vector3d t = view.T_view_centered.translation();
  const double inverse_scale2 = 1 / (static_cast<double>(field.scale_px()) * field.scale_px());
  const double reach_px = KernelField::kReach * static_cast<double>(field.scale_px());
  for (int i = (stride - 1) / 2; i < model.size(); i += stride) {
    const auto& place = nodes.place_of_point[i];
    if (place.edge < 0) continue;
    const Eigen::Vector3d p = view.points.col(i), p_view = R * p + t;
    Eigen::Matrix<double, 2, 3> J_view;
    const auto pixel = view.camera.project(p_view, &J_view);
    if (!pixel) continue;
    double to_border_px = reach_px;
    for (const HalfPlane& side : in_view) {
      to_border_px = std::min(to_border_px, side.n_u * pixel->x() + side.n_v * pixel->y() + side.d);
    }
    if (!(to_border_px > 0)) continue;
    const Eigen::Matrix<double, 2, 3> J = J_view * R;
    // Direction of the projected tangent, and how much of its length is left: a vessel seen end-on has none.
    const Eigen::Vector2d tangent = J * Eigen::Vector3d(model.all.tx[i], model.all.ty[i], model.all.tz[i]) *
                                    p_view.z() / view.camera.parameters().fx_px;
    const double length2 = std::max(1e-12, tangent.squaredNorm()), length = std::min(1.0, std::sqrt(length2));
    const double cos2 = (tangent.x() * tangent.x() - tangent.y() * tangent.y()) / length2 * length;
    const double sin2 = 2 * tangent.x() * tangent.y() / length2 * length;
    const KernelField::Value value = field.at(*pixel, cos2, sin2);
    const double F = std::max(0.0, value.F);
    const double w = view_weight * to_border_px / reach_px * model.all.weight[i] * length;
    const double stiffness = w * F / (F + pull_weight.outlier_mass) * inverse_scale2;
    if (!(stiffness > 1e-9 * inverse_scale2)) continue;
    const Eigen::Vector2d gradient = w / (F + pull_weight.outlier_mass) * value.gradient;
    // Two residuals, across the vessel and along it, whose squares have the majoriser's gradient and Hessian.
    const Eigen::Vector2d forwards = tangent / std::sqrt(length2), across(-forwards.y(), forwards.x());
    const double isotropic = 1 - length;  // A vessel seen end-on is stiff both ways.
    const auto addResidual = [&](const Eigen::Vector2d& n, double w_n) {
      const Eigen::Vector3d row = J.transpose() * n;
      Vector6d J6;
      J6 << row, p.cross(row);
      add(place, w_n, -gradient.dot(n) / w_n, J6, directions.transpose() * row);
    };
    addResidual(across, stiffness);
    addResidual(forwards, stiffness * (pull_weight.along + (1 - pull_weight.along) * isotropic));
  }
}

template <int D>
void DeformationEquations<D>::addLinePull(const DeformedView& view, const OrientedModel& model,
                                          const OrientedPoints& image, const LineMatches& matches, double tolerance_px,
                                          double view_weight) {
  const Eigen::Matrix3d R = view.T_view_centered.linear();
  const Eigen::Vector3d t = view.T_view_centered.translation();
  const double inverse = 1 / (2 * tolerance_px * tolerance_px);
  for (std::size_t j = 0; j < matches.of_point.size(); ++j) {
    const auto& match = matches.of_point[j];
    if (match.edge < 0) continue;
    const auto& [parent, child] = model.edges[match.edge];
    const double s = match.along;
    const Eigen::Vector3d p = (1 - s) * view.points.col(parent) + s * view.points.col(child);
    Eigen::Matrix<double, 2, 3> J_view;
    const auto pixel = view.camera.project(R * p + t, &J_view);
    if (!pixel) continue;
    const Eigen::Vector2d n(match.normal_u, match.normal_v);
    const double r = n.x() * (pixel->x() - image.u[j]) + n.y() * (pixel->y() - image.v[j]);
    const Eigen::Vector3d row = (J_view * R).transpose() * n;
    Vector6d J6;
    J6 << row, p.cross(row);
    const auto place = nodes.stretch_of_edge[match.edge].at(s);
    add(place, view_weight * std::exp(-r * r * inverse), r, J6, directions.transpose() * row);
  }
}

template <int D>
std::optional<typename DeformationEquations<D>::Step> DeformationEquations<D>::solveModes(
    const Eigen::MatrixXd& modes, const Eigen::Ref<const Field>& w, const Matrix6d& H_pose,
    const Vector6d& g_pose) const {
  const Eigen::Index K = w.cols(), M = nodes.size();
  const auto U = modes.leftCols(K);
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(6 + D * K, 6 + D * K);  // Lower half.
  Eigen::VectorXd right(6 + D * K);
  system.topLeftCorner<6, 6>() = H_pose;
  right.head<6>() = g_pose;
  Eigen::MatrixXd column(M, 7);
  Eigen::MatrixXd UT = U.transpose(), SUT(K, M);  // Nodes in columns: their modes stand together.
  for (int a = 0; a < D; ++a) {
    for (int b = 0; b <= a; ++b) {
      for (Eigen::Index n = 0; n < M; ++n) SUT.col(n) = own[n](a, b) * UT.col(n);
      for (std::size_t e = 0; e < nodes.edges.size(); ++e) {
        const double s = along[e](a, b);
        if (s == 0) continue;
        const auto [parent, child] = nodes.edges[e];
        SUT.col(parent) += s * UT.col(child);
        SUT.col(child) += s * UT.col(parent);
      }
      // Symmetric, so half of the product is enough: panel by panel, from the diagonal down.
      for (Eigen::Index j = 0; j < K; j += kPanel) {
        const Eigen::Index wide = std::min(kPanel, K - j);
        system.block(6 + a * K + j, 6 + b * K + j, K - j, wide).noalias() =
            UT.bottomRows(K - j) * SUT.middleRows(j, wide).transpose();
      }
      if (a == b) continue;
      for (Eigen::Index j = 0; j < K; ++j) {
        for (Eigen::Index i = 0; i < j; ++i)
          system(6 + a * K + i, 6 + b * K + j) = system(6 + a * K + j, 6 + b * K + i);
      }
    }
    for (Eigen::Index n = 0; n < M; ++n) {
      column.row(n).head<6>() = mixed[n].col(a);
      column(n, 6) = pull[n][a];
    }
    const Eigen::MatrixXd projected = UT * column;
    system.block(6 + a * K, 0, K, 6) = projected.leftCols(6);
    right.segment(6 + a * K, K) = projected.col(6) + w.row(a).transpose();
    system.block(6 + a * K, 6 + a * K, K, K).diagonal().array() += 1;
  }
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(system);  // In place; reads the lower half.
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  const Eigen::VectorXd x = -cholesky.solve(right);
  if (!x.allFinite()) return std::nullopt;
  Step step;
  step.dx = x.head<6>();
  const Eigen::MatrixXd of_pose = Eigen::MatrixXd::Identity(right.size(), 6);
  step.pose_covariance = cholesky.solve(of_pose).topRows<6>();
  step.change.resize(D, K);
  for (int a = 0; a < D; ++a) step.change.row(a) = x.segment(6 + a * K, K).transpose();
  return step;
}

ChainPrior::ChainPrior(const DeformationNodes& nodes, double std_m, double length_m)
    : own(static_cast<std::size_t>(nodes.size()), 0.0), along(nodes.edges.size(), 0.0) {
  const double information = 1 / (std_m * std_m);
  std::vector<char> has_parent(own.size(), 0);
  for (std::size_t e = 0; e < nodes.edges.size(); ++e) {
    const auto [parent, child] = nodes.edges[e];
    const double s = (nodes.points.col(child) - nodes.points.col(parent)).norm();
    const double rho = std::min(0.9999, std::exp(-s / length_m));
    const double given_parent = information / (1 - rho * rho);  // child = rho parent + what is new.
    own[child] += given_parent;
    own[parent] += rho * rho * given_parent;
    along[e] -= rho * given_parent;
    has_parent[child] = 1;
  }
  for (std::size_t n = 0; n < own.size(); ++n) own[n] += has_parent[n] ? 0 : information;
}

template <int D>
typename DeformationEquations<D>::Step DeformationEquations<D>::solveChain(const ChainPrior& prior,
                                                                           const Field& e) const {
  const Block I = Block::Identity();
  std::vector<Block> diagonal = own, coupling = along;
  std::vector<Column> right(diagonal.size());
  for (std::size_t n = 0; n < diagonal.size(); ++n) {
    diagonal[n] += prior.own[n] * I;
    right[n] = -pull[n] - prior.own[n] * e.col(n);
  }
  for (std::size_t k = 0; k < coupling.size(); ++k) {
    coupling[k] += prior.along[k] * I;
    const auto [parent, child] = nodes.edges[k];
    right[parent] -= prior.along[k] * e.col(child);
    right[child] -= prior.along[k] * e.col(parent);
  }
  // A parent comes before its children: from the last edge to the first all that hangs below an edge is done.
  std::vector<Block> factor(coupling.size());
  for (std::size_t k = coupling.size(); k-- > 0;) {
    const auto [parent, child] = nodes.edges[k];
    factor[k] = coupling[k] * diagonal[child].inverse();
    diagonal[parent] -= factor[k] * coupling[k].transpose();
    right[parent] -= factor[k] * right[child];
  }
  Step step;
  step.change.resize(D, nodes.size());
  std::vector<char> done(diagonal.size(), 0);
  for (std::size_t k = 0; k < coupling.size(); ++k) {
    const auto [parent, child] = nodes.edges[k];
    if (!done[parent]) {  // A root.
      step.change.col(parent) = diagonal[parent].inverse() * right[parent];
      done[parent] = 1;
    }
    step.change.col(child) =
        diagonal[child].inverse() * (right[child] - coupling[k].transpose() * step.change.col(parent));
    done[child] = 1;
  }
  return step;
}

template struct DeformationEquations<2>;
template struct DeformationEquations<3>;

}  // namespace angio::registration
