// SPDX-License-Identifier: GPL-2.0-or-later

#include <visp3/visual_features/vpBasicFeature.h>

#include <algorithm>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/vessel/resample.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "visp_servo_law.hpp"

namespace angio::servo {
namespace {

constexpr int kPlacesPerSample = 12;  // To choose from.
constexpr int kMaxPlaces = 20000;

// `count` points on the tree's centreline (3 x N [m]; fewer for a tree that has fewer places), spread well: points in
// equal steps of arc length, of which each next one is the furthest from all before (Gonzalez 1985). The first is the
// one furthest from the centroid.
Eigen::Matrix3Xd spreadSamples(const VesselTree& tree, int count) {
  const double step_m = tree.length() / (kPlacesPerSample * count);
  const ResampledTree dense = resampled(tree, step_m, std::max(kMaxPlaces, tree.size()));
  const Eigen::Matrix3Xd& places = dense.tree.points();
  const auto samples = std::min<Eigen::Index>(count, places.cols());
  Eigen::Matrix3Xd chosen(3, samples);
  Eigen::Index next = 0;
  (places.colwise() - tree.centroid()).colwise().squaredNorm().maxCoeff(&next);
  Eigen::RowVectorXd nearest = Eigen::RowVectorXd::Constant(places.cols(), std::numeric_limits<double>::infinity());
  for (Eigen::Index i = 0; i < samples; ++i) {
    chosen.col(i) = places.col(next);
    nearest = nearest.cwiseMin((places.colwise() - places.col(next)).colwise().squaredNorm());
    nearest.maxCoeff(&next);
  }
  return chosen;
}

constexpr int kMinInView = 8;

// The images of many points as one feature: x and y of each, at z = 1. ViSP selects no part of a feature of more than
// 31 numbers, so all count.
class PointsFeature final : public vpBasicFeature {
 public:
  explicit PointsFeature(int points) : Z_(static_cast<std::size_t>(points), 1.0) {
    dim_s = 2 * static_cast<unsigned>(points);
    s.resize(dim_s);
  }

  void set(int point, const Eigen::Vector3d& p) {
    s[2 * static_cast<unsigned>(point)] = p.x() / p.z();
    s[2 * static_cast<unsigned>(point) + 1] = p.y() / p.z();
    Z_[static_cast<std::size_t>(point)] = p.z();
  }
  /// A point that does not count: no error, and nothing that changes it.
  void leaveOut(int point) {
    s[2 * static_cast<unsigned>(point)] = s[2 * static_cast<unsigned>(point) + 1] = 0;
    Z_[static_cast<std::size_t>(point)] = 0;
  }

  vpMatrix interaction(unsigned /*select*/ = FEATURE_ALL) override {
    vpMatrix L(dim_s, 6);  // Zero.
    for (unsigned i = 0; i < dim_s / 2; ++i) {
      const double Z = Z_[i], x = s[2 * i], y = s[2 * i + 1];
      if (Z == 0) continue;
      const double rows[2][6] = {{-1 / Z, 0, x / Z, x * y, -(1 + x * x), y}, {0, -1 / Z, y / Z, 1 + y * y, -x * y, -x}};
      for (unsigned k = 0; k < 12; ++k) L[2 * i + k / 6][k % 6] = rows[k / 6][k % 6];
    }
    return L;
  }
  vpBasicFeature* duplicate() const override { return new PointsFeature(*this); }
  void init() override {}
  void print(unsigned /*select*/ = FEATURE_ALL) const override {}
  void display(const vpCameraParameters&, const vpImage<unsigned char>&, const vpColor&, unsigned) const override {}
  void display(const vpCameraParameters&, const vpImage<vpRGBa>&, const vpColor&, unsigned) const override {}

 private:
  std::vector<double> Z_;
};

class ImageBased final : public ServoLaw {
 public:
  ImageBased(const ImageBasedSettings& settings, const LawModel& model)
      : max_step_rad_(degToRad(settings.max_step_deg)),
        points_(spreadSamples(*model.tree, settings.samples)),
        center_(model.target.value_or(model.tree->centroid())),
        features_(static_cast<int>(points_.cols())),
        desired_features_(static_cast<int>(points_.cols())),
        in_view_(static_cast<std::size_t>(points_.cols())),
        task_(settings, center_) {
    task_.servo().addFeature(features_, desired_features_);
  }

  std::optional<CArmJoints> velocity(const LawInput& input) override {
    const auto goal = task_.goal(input);
    if (!goal) return std::nullopt;
    choosePoints(*goal, input.camera);
    const Pose step = stepTowards(*goal);
    for (int i = 0; i < points_.cols(); ++i) {
      if (!in_view_[static_cast<std::size_t>(i)]) {
        features_.leaveOut(i);
        desired_features_.leaveOut(i);
        continue;
      }
      const Eigen::Vector3d seen = task_.T_camera_model() * points_.col(i), desired = step * points_.col(i);
      if (!(seen.z() > 0 && desired.z() > 0)) return std::nullopt;
      features_.set(i, seen);
      desired_features_.set(i, desired);
    }
    return task_.velocity(input);
  }

 private:
  void choosePoints(const Pose& goal, const XrayCamera* camera) {
    int count = 0;
    for (int i = 0; i < points_.cols(); ++i) {
      const auto pixel = camera ? camera->project(goal * points_.col(i)) : std::nullopt;
      in_view_[static_cast<std::size_t>(i)] = pixel && camera->sees(*pixel);
      count += in_view_[static_cast<std::size_t>(i)] ? 1 : 0;
    }
    if (count < kMinInView) in_view_.assign(in_view_.size(), true);
  }

  // An intermediate goal: so much of the turn, and the same share of the target's path.
  Pose stepTowards(const Pose& goal) const {
    const Pose& seen = task_.T_camera_model();
    const Eigen::Vector3d turn = logSO3(goal.linear() * seen.linear().transpose());
    const double share = max_step_rad_ / std::max(max_step_rad_, turn.norm());
    if (share >= 1) return goal;
    Pose step = Pose::Identity();
    step.linear() = expSO3(share * turn) * seen.linear();
    const Eigen::Vector3d target = seen * center_;
    step.translation() = target + share * (goal * center_ - target) - step.linear() * center_;
    return step;
  }

  double max_step_rad_;
  Eigen::Matrix3Xd points_;
  Eigen::Vector3d center_;
  PointsFeature features_, desired_features_;
  std::vector<bool> in_view_;
  VispServoLaw task_;  // Last: goes before the features that it holds.
};

}  // namespace

std::unique_ptr<ServoLaw> make(const ImageBasedSettings& settings, const LawModel& model) {
  if (!model.tree) throw InputError(ImageBasedSettings::kName, "tree", "", "the law needs one");
  return std::make_unique<ImageBased>(settings, model);
}

}  // namespace angio::servo
