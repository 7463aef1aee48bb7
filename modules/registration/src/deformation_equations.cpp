// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_equations.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {

template <int D>
void DeformationEquations<D>::clear(const DeformationNodes& nodes) {
  H.setZero();
  g.setZero();
  mixed.assign(static_cast<std::size_t>(nodes.size()), Eigen::Matrix<double, 6, D>::Zero());
  pull.assign(static_cast<std::size_t>(nodes.size()), Column::Zero());
  own.assign(static_cast<std::size_t>(nodes.size()), Block::Zero());
  along.assign(nodes.edges.size(), Block::Zero());
  weight = squares_px2 = 0;
}

template <int D>
void DeformationEquations<D>::add(const DeformationNodes& nodes, const DeformationNodes::Place& place, double w,
                                  double r, const Vector6d& J, const Column& h) {
  const auto edge = static_cast<std::size_t>(place.edge);
  const auto a = static_cast<std::size_t>(nodes.edges[edge].first),
             b = static_cast<std::size_t>(nodes.edges[edge].second);
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
  along[edge] += wa * wb * hh;
  weight += w;
  squares_px2 += w * r * r;
}

template <int D>
void addFieldPull(const DeformedView& view, const OrientedModel& model, const DeformationNodes& nodes,
                  const Eigen::Matrix<double, 3, D>& directions, const KernelField& field,
                  const std::vector<HalfPlane>& in_view, const PullWeight& pull, int stride, double weight,
                  DeformationEquations<D>& to) {
  const Eigen::Matrix3d R = view.T_view_centered.linear();
  const Eigen::Vector3d t = view.T_view_centered.translation();
  const double inverse_scale2 = 1 / (static_cast<double>(field.scale_px()) * field.scale_px());
  for (int i = (stride - 1) / 2; i < model.size(); i += stride) {
    const auto k = static_cast<std::size_t>(i);
    const auto& place = nodes.place_of_point[k];
    if (place.edge < 0) continue;
    const Eigen::Vector3d p = view.points.col(i), p_view = R * p + t;
    Eigen::Matrix<double, 2, 3> J_view;
    const auto pixel = view.camera.project(p_view, &J_view);
    if (!pixel || !std::all_of(in_view.begin(), in_view.end(), [&](const HalfPlane& side) {
          return side.n_u * pixel->x() + side.n_v * pixel->y() + side.d >= 0;
        })) {
      continue;
    }
    const Eigen::Matrix<double, 2, 3> J = J_view * R;
    // Direction of the projected tangent, and how much of its length is left: a vessel seen end-on has none.
    const Eigen::Vector2d tangent = J * Eigen::Vector3d(model.all.tx[k], model.all.ty[k], model.all.tz[k]) *
                                    p_view.z() / view.camera.parameters().fx_px;
    const double length2 = std::max(1e-12, tangent.squaredNorm()), length = std::min(1.0, std::sqrt(length2));
    const double cos2 = (tangent.x() * tangent.x() - tangent.y() * tangent.y()) / length2 * length;
    const double sin2 = 2 * tangent.x() * tangent.y() / length2 * length;
    const KernelField::Value value = field.at(*pixel, cos2, sin2);
    const double F = std::max(0.0, value.F);
    const double w = weight * model.all.weight[k] * length;
    const double stiffness = w * F / (F + pull.outlier_mass) * inverse_scale2;
    if (!(stiffness > 1e-9 * inverse_scale2)) continue;
    const Eigen::Vector2d gradient = w / (F + pull.outlier_mass) * value.gradient;
    // Two residuals, across the vessel and along it, whose squares have the majoriser's gradient and Hessian.
    const Eigen::Vector2d forwards = tangent / std::sqrt(length2), across(-forwards.y(), forwards.x());
    const double isotropic = 1 - length;  // A vessel seen end-on is stiff both ways.
    const auto addResidual = [&](const Eigen::Vector2d& n, double w_n) {
      const Eigen::Vector3d row = J.transpose() * n;
      Vector6d J6;
      J6 << row, p.cross(row);
      to.add(nodes, place, w_n, -gradient.dot(n) / w_n, J6, directions.transpose() * row);
    };
    addResidual(across, stiffness);
    addResidual(forwards, stiffness * (pull.along + (1 - pull.along) * isotropic));
  }
}

template <int D>
void addLinePull(const DeformedView& view, const OrientedModel& model, const DeformationNodes& nodes,
                 const Eigen::Matrix<double, 3, D>& directions, const OrientedPoints& image, const LineMatches& matches,
                 double tolerance_px, double weight, DeformationEquations<D>& to) {
  const Eigen::Matrix3d R = view.T_view_centered.linear();
  const Eigen::Vector3d t = view.T_view_centered.translation();
  const double inverse = 1 / (2 * tolerance_px * tolerance_px);
  for (std::size_t j = 0; j < matches.of_point.size(); ++j) {
    const auto& match = matches.of_point[j];
    if (match.edge < 0) continue;
    const auto& [parent, child] = model.edges[static_cast<std::size_t>(match.edge)];
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
    const auto place = nodes.stretch_of_edge[static_cast<std::size_t>(match.edge)].at(s);
    to.add(nodes, place, weight * std::exp(-r * r * inverse), r, J6, directions.transpose() * row);
  }
}

template struct DeformationEquations<2>;
template struct DeformationEquations<3>;
template void addFieldPull<2>(const DeformedView&, const OrientedModel&, const DeformationNodes&,
                              const Eigen::Matrix<double, 3, 2>&, const KernelField&, const std::vector<HalfPlane>&,
                              const PullWeight&, int, double, DeformationEquations<2>&);
template void addFieldPull<3>(const DeformedView&, const OrientedModel&, const DeformationNodes&,
                              const Eigen::Matrix<double, 3, 3>&, const KernelField&, const std::vector<HalfPlane>&,
                              const PullWeight&, int, double, DeformationEquations<3>&);
template void addLinePull<2>(const DeformedView&, const OrientedModel&, const DeformationNodes&,
                             const Eigen::Matrix<double, 3, 2>&, const OrientedPoints&, const LineMatches&, double,
                             double, DeformationEquations<2>&);
template void addLinePull<3>(const DeformedView&, const OrientedModel&, const DeformationNodes&,
                             const Eigen::Matrix<double, 3, 3>&, const OrientedPoints&, const LineMatches&, double,
                             double, DeformationEquations<3>&);

}  // namespace angio::registration
