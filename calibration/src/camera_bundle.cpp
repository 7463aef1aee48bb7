// SPDX-License-Identifier: GPL-2.0-or-later
#include "camera_bundle.hpp"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <limits>

#include "angio/base/formatted.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/geometry/distortion.hpp"
#include "angio/geometry/so3.hpp"

namespace angio::calibration {

Eigen::Vector2d LensModel::seen(const LensNumbers& lens, double distance_m, const Eigen::Vector3d& p_camera,
                                Eigen::Matrix<double, 2, 3>* J_point,
                                Eigen::Matrix<double, 2, kLensNumbers>* J_lens) const {
  const double step_m = distance_m - reference_distance_m, length_m = reference_distance_m + lens[kOffset];
  const double stretch = 1 + step_m / length_m, inv_z = 1 / p_camera.z();
  const Eigen::Vector2d f = stretch * lens.segment<2>(kFx);
  const Eigen::Vector2d c = lens.segment<2>(kCx) + step_m * lens.segment<2>(kSlopeX);
  const Eigen::Vector2d tangent = p_camera.head<2>() * inv_z;
  const RadialBend bend{lens[kK1], lens[kK2], lens[kS1], lens[kS2]};
  const bool tube = kind == LensKind::kIntensifier;

  // An intensifier bends what a pinhole would show, about its middle; a lens the ray, before K.
  const Eigen::Vector2d pinhole_px = f.cwiseProduct(tangent) + c;
  const Eigen::Vector2d point = tube ? Eigen::Vector2d((pinhole_px - middle_px) / half_width_px) : tangent;
  Eigen::Matrix2d J_bent = Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 2, 4> J_bend = Eigen::Matrix<double, 2, 4>::Zero();
  const bool derive = J_point || J_lens;
  const Eigen::Vector2d q =
      kind == LensKind::kNone ? point : bend.bent(point, derive ? &J_bent : nullptr, J_lens ? &J_bend : nullptr);
  Eigen::Matrix2d A;
  if (tube) {
    A = half_width_px * Eigen::Matrix2d::Identity();
  } else {
    A << f.x(), lens[kSkew], 0, f.y();
  }
  if (derive) {
    const Eigen::Matrix2d J_tangent = tube ? Eigen::Matrix2d(J_bent * f.asDiagonal()) : Eigen::Matrix2d(A * J_bent);
    if (J_point) {
      J_point->leftCols<2>() = J_tangent * inv_z;
      J_point->col(2) = -J_tangent * tangent * inv_z;
    }
    if (J_lens) {
      J_lens->setZero();
      J_lens->middleCols<4>(kK1) = A * J_bend;
      // By f and c as they are at this distance, then by what makes them so.
      const Eigen::Matrix2d by_f =
          tube ? Eigen::Matrix2d(J_bent * tangent.asDiagonal()) : Eigen::Matrix2d(q.asDiagonal());
      const Eigen::Matrix2d by_c = tube ? J_bent : Eigen::Matrix2d::Identity();
      J_lens->middleCols<2>(kFx) = stretch * by_f;
      J_lens->middleCols<2>(kCx) = by_c;
      if (!tube) J_lens->col(kSkew) = Eigen::Vector2d(q.y(), 0);
      J_lens->col(kOffset) = by_f * lens.segment<2>(kFx) * (-step_m / (length_m * length_m));
      J_lens->middleCols<2>(kSlopeX) = step_m * by_c;
    }
  }
  const Eigen::Vector2d shown_px = tube ? Eigen::Vector2d(middle_px + A * q) : Eigen::Vector2d(c + A * q);
  if (!known) return shown_px;
  Eigen::Matrix2d J_known, J_turn;
  const Eigen::Vector2d image_px = known->distorted(shown_px, derive ? &J_known : nullptr);
  const Eigen::Vector2d turned_px = turn.at((shown_px - known->center_px).cwiseQuotient(known->unit_px), &J_turn);
  if (derive) J_known += lens[kS1] * J_turn * known->unit_px.cwiseInverse().asDiagonal();
  if (J_point) *J_point = J_known * *J_point;
  if (J_lens) {
    *J_lens = J_known * *J_lens;
    J_lens->col(kS1) += turned_px;
  }
  return image_px + lens[kS1] * turned_px;
}

LensParameters freeParameters(const CameraCalibrationSettings& settings, bool several_distances, bool turns_since_map) {
  LensParameters parameters;
  parameters.map.resize(kLensNumbers, 0);
  const auto add = [&](const char* name, std::initializer_list<LensNumber> numbers, double unit = 1) {
    parameters.names.push_back(name);
    parameters.map.conservativeResize(Eigen::NoChange, parameters.map.cols() + 1);
    parameters.map.rightCols<1>().setZero();
    for (const LensNumber number : numbers) parameters.map(number, parameters.map.cols() - 1) = unit;
  };
  if (settings.square_pixels) {
    add("f_px", {kFx, kFy});
  } else {
    add("fx_px", {kFx});
    add("fy_px", {kFy});
  }
  add("cx_px", {kCx});
  add("cy_px", {kCy});
  if (settings.skew && settings.distortion != LensKind::kIntensifier) add("skew_px", {kSkew});
  if (settings.distortion != LensKind::kNone) {
    add("k1", {kK1});
    add("k2", {kK2});
  }
  if (settings.distortion == LensKind::kIntensifier) {
    add("s1_deg", {kS1}, degToRad(1));
    add("s2_deg", {kS2}, degToRad(1));
  }
  if (turns_since_map) add("turn_since_map_deg", {kS1}, degToRad(1));
  if (several_distances) {
    add("source_detector_offset_mm", {kOffset}, 1e-3);
    add("principal_point_slope_x_px_per_mm", {kSlopeX}, 1e3);
    add("principal_point_slope_y_px_per_mm", {kSlopeY}, 1e3);
  }
  return parameters;
}

namespace {

constexpr double kMillimetre = 1e-3;

class BeadCost final : public ceres::CostFunction {
 public:
  BeadCost(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead)
      : model_(bundle.model),
        parameters_(&bundle.parameters),
        distance_m_(view.distance_m),
        R_(view.T_camera_phantom.linear()),
        point_m_(view.points_m.col(bead)),
        shift_(bundle.shiftOf(view, bead)),
        t_m_(view.T_camera_phantom.translation()),
        seen_px_(view.seen_px.col(bead)),
        weight_(1 / view.stds_px[bead]) {
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {static_cast<int>(bundle.values.size()), 6};
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Index n = parameters_->map.cols();
    const LensNumbers lens = parameters_->fixed + parameters_->map * Eigen::Map<const Eigen::VectorXd>(blocks[0], n);
    const Eigen::Map<const Eigen::Vector3d> v(blocks[1]), w(blocks[1] + 3);
    const Eigen::Matrix3d R = expSO3(w) * R_;
    Eigen::Vector3d point_m = point_m_;
    if (shift_) point_m += kMillimetre * Eigen::Map<const Eigen::Vector3d>(blocks[0] + *shift_);
    const Eigen::Vector3d turned_m = R * point_m, p_m = turned_m + t_m_ + v;
    if (!(p_m.z() > 0)) return false;
    Eigen::Matrix<double, 2, 3> J_point;
    Eigen::Matrix<double, 2, kLensNumbers> J_lens;
    const Eigen::Vector2d px = model_.seen(lens, distance_m_, p_m, jacobians ? &J_point : nullptr,
                                           jacobians && jacobians[0] ? &J_lens : nullptr);
    Eigen::Map<Eigen::Vector2d> r(residuals);
    r = weight_ * (px - seen_px_);
    if (!jacobians) return r.allFinite();
    using RowMajor = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;
    if (jacobians[0]) {
      Eigen::Map<RowMajor> J(jacobians[0], 2, n);
      J.noalias() = weight_ * J_lens * parameters_->map;
      if (shift_) J.middleCols<3>(*shift_) += kMillimetre * weight_ * J_point * R;
    }
    if (jacobians[1]) {
      Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> J(jacobians[1]);
      J.leftCols<3>() = weight_ * J_point;
      J.rightCols<3>() = -weight_ * J_point * skew(turned_m) * leftJacobianSO3(w);
    }
    return r.allFinite();
  }

 private:
  const LensModel& model_;
  const LensParameters* parameters_;
  double distance_m_;
  Eigen::Matrix3d R_;
  Eigen::Vector3d point_m_;
  std::optional<Eigen::Index> shift_;
  Eigen::Vector3d t_m_;
  Eigen::Vector2d seen_px_;
  double weight_;
};

// What is known of the plates' shifts: their deviation from it, in pixels.
class PlateCost final : public ceres::CostFunction {
 public:
  explicit PlateCost(const CameraBundle& bundle)
      : mean_mm_(bundle.plates.known.mean_mm),
        root_(bundle.plates_noise_px *
              Eigen::MatrixXd(inverseOfSymmetric(bundle.plates.known.covariance_mm2).llt().matrixU())),
        values_(bundle.values.size()) {
    set_num_residuals(static_cast<int>(mean_mm_.size()));
    *mutable_parameter_block_sizes() = {static_cast<int>(values_)};
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Index numbers = mean_mm_.size();
    Eigen::Map<Eigen::VectorXd>(residuals, numbers) =
        root_ * (Eigen::Map<const Eigen::VectorXd>(blocks[0], values_).tail(numbers) - mean_mm_);
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> J(jacobians[0], numbers,
                                                                                         values_);
    J.setZero();
    J.rightCols(numbers) = root_;
    return true;
  }

 private:
  Eigen::VectorXd mean_mm_;
  Eigen::MatrixXd root_;
  Eigen::Index values_;
};

void moveBy(Pose& T, const Vector6d& step) {
  T.linear() = nearestRotation(expSO3(step.tail<3>()) * T.linear());
  T.translation() += step.head<3>();
}

}  // namespace

std::unique_ptr<ceres::CostFunction> beadCost(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead) {
  return std::make_unique<BeadCost>(bundle, view, bead);
}

std::optional<Eigen::Index> CameraBundle::shiftOf(const BundleView& view, Eigen::Index bead) const {
  if (view.plate.empty()) return std::nullopt;
  return values.size() - 3 * (plates.count - view.plate[static_cast<std::size_t>(bead)]);
}

Eigen::Vector3d CameraBundle::point_m(const BundleView& view, Eigen::Index bead) const {
  const auto shift = shiftOf(view, bead);
  if (!shift) return view.points_m.col(bead);
  return view.points_m.col(bead) + kMillimetre * values.segment<3>(*shift);
}

Eigen::MatrixXd CameraBundle::priorInformation() const {
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(values.size(), values.size());
  const Eigen::Index numbers = 3 * plates.count;
  if (numbers > 0) {
    information.bottomRightCorner(numbers, numbers) =
        plates_noise_px * plates_noise_px * inverseOfSymmetric(plates.known.covariance_mm2);
  }
  return information;
}

void CameraBundle::addPlates(const PhantomPlates& with, const std::vector<BeadView>& given) {
  plates = with;
  for (Eigen::Index k = 0; k < plates.count; ++k) {
    for (const char* axis : {"x", "y", "z"}) parameters.names.push_back(formatted("plate_%td_%s_mm", k, axis));
  }
  const Eigen::Index numbers = 3 * plates.count;
  parameters.map.conservativeResize(Eigen::NoChange, parameters.map.cols() + numbers);
  parameters.map.rightCols(numbers).setZero();
  values.conservativeResize(values.size() + numbers);
  values.tail(numbers) = plates.known.mean_mm;
  for (BundleView& view : views) {
    for (const SeenBead& seen : given[view.index].beads) {
      view.plate.push_back(plates.plate_of_bead[static_cast<std::size_t>(seen.bead)]);
    }
  }
}

Eigen::Matrix2Xd CameraBundle::residualsOf(const BundleView& view) const {
  const LensNumbers numbers = lens();
  Eigen::Matrix2Xd r(2, view.points_m.cols());
  for (Eigen::Index i = 0; i < r.cols(); ++i) {
    const Eigen::Vector3d p_m = view.T_camera_phantom * point_m(view, i);
    if (p_m.z() > 0) {
      r.col(i) = model.seen(numbers, view.distance_m, p_m) - view.seen_px.col(i);
    } else {
      r.col(i).setConstant(std::numeric_limits<double>::infinity());
    }
  }
  return r;
}

bool CameraBundle::solve(std::optional<double> robust_scale, int max_iterations, Free free) {
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  ceres::CauchyLoss cauchy(robust_scale.value_or(1));
  std::vector<Vector6d> steps(views.size(), Vector6d::Zero());
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  ordering->AddElementToGroup(values.data(), 1);
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t i = 0; i < views[v].use.size(); ++i) {
      if (!views[v].use[i]) continue;
      problem.AddResidualBlock(beadCost(*this, views[v], static_cast<Eigen::Index>(i)).release(),
                               robust_scale ? &cauchy : nullptr, values.data(), steps[v].data());
    }
    ordering->AddElementToGroup(steps[v].data(), 0);
  }
  if (!plates.isOnePiece() && problem.HasParameterBlock(values.data())) {
    problem.AddResidualBlock(new PlateCost(*this), nullptr, values.data());
  }
  if (free == Free::kPoses && problem.HasParameterBlock(values.data()))
    problem.SetParameterBlockConstant(values.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering = ordering;
  options.max_num_iterations = max_iterations;
  options.function_tolerance = 1e-14;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-12;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (std::size_t v = 0; v < views.size(); ++v) moveBy(views[v].T_camera_phantom, steps[v]);
  return summary.IsSolutionUsable();
}

Pose fittedPose(const CameraBundle& bundle, const BundleView& view) {
  CameraBundle alone = bundle;
  alone.views = {view};
  alone.solve(std::nullopt, 100, CameraBundle::Free::kPoses);
  return alone.views.front().T_camera_phantom;
}

Eigen::MatrixXd ViewInformation::reducedLens() const {
  return lens - cross * inverseOfSymmetric(pose) * cross.transpose();
}

Eigen::VectorXd ViewInformation::reducedGradient() const {
  return lens_gradient - cross * solveSymmetric(pose, pose_gradient);
}

ViewInformation informationOf(const CameraBundle& bundle, const BundleView& view) {
  const Eigen::Index n = bundle.values.size();
  ViewInformation sum;
  sum.lens = Eigen::MatrixXd::Zero(n, n);
  sum.cross = Eigen::MatrixXd::Zero(n, 6);
  sum.lens_gradient = Eigen::VectorXd::Zero(n);
  const Vector6d no_step = Vector6d::Zero();
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> J_lens(2, n);
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> J_pose;
  Eigen::Vector2d r;
  const double* const blocks[] = {bundle.values.data(), no_step.data()};
  double* jacobians[] = {J_lens.data(), J_pose.data()};
  for (Eigen::Index i = 0; i < view.points_m.cols(); ++i) {
    if (!view.use[i]) continue;
    if (!BeadCost(bundle, view, i).Evaluate(blocks, r.data(), jacobians)) continue;  // Behind the camera.
    sum.lens.noalias() += J_lens.transpose() * J_lens;
    sum.pose.noalias() += J_pose.transpose() * J_pose;
    sum.cross.noalias() += J_lens.transpose() * J_pose;
    sum.lens_gradient.noalias() += J_lens.transpose() * r;
    sum.pose_gradient.noalias() += J_pose.transpose() * r;
    sum.squared += r.squaredNorm();
    sum.residuals += 2;
  }
  return sum;
}

}  // namespace angio::calibration
