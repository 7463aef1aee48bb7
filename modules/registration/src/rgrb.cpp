// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <random>

#include "angio/geometry/decompositions.hpp"
#include "angio/vessel/plausible_radii.hpp"
#include "image_gradient.hpp"
#include "image_registration.hpp"
#include "methods.hpp"

namespace angio::registration {
namespace {

// Gradients are taken of an image that is smoothed by so much [px].
constexpr double kGradientSmoothing_px = 1.5;
// The search ends at this reach, at which matches are off by noise only [px].
constexpr double kMinReach_px = 4;
// A match agrees with a motion that leaves it so far off: this share of the reach, and no less than a pixel and a half.
constexpr double kAgreeShare = 0.15, kMinAgree_px = 1.5;
// A vessel seen so nearly end-on has no silhouette of its own [px of projected direction over those seen across].
constexpr double kMinSeenShare = 0.2;
// No motion is found where so few match: a match says one number of six.
constexpr int kMinMatches = 24;
constexpr double kGradientRest_px = 0.05;

using Row6 = Eigen::Matrix<double, 1, 6>;

// One place of a vessel's silhouette and where the image has the like of it along the normal.
struct SilhouetteMatch {
  Row6 row;         // Of the silhouette's place along its normal by the twist of the centred tree [px].
  double off_px;    // How much further out the image has it.
  double strength;  // Of the image's gradient there, along the normal.
};

// A tree's points with a direction and a radius.
struct SurfacePoints {
  Eigen::Matrix3Xd tangents;
  Eigen::VectorXd radii_m;
};

// All radii of the tree must be known.
SurfacePoints surfaceOf(const VesselTree& tree) {
  SurfacePoints surface{Eigen::Matrix3Xd::Zero(3, tree.size()), Eigen::VectorXd::Zero(tree.size())};
  for (int i = 0; i < tree.size(); ++i) {
    if (tree.parents()[i] < 0) continue;
    const Eigen::Vector3d edge = tree.points().col(i) - tree.points().col(tree.parents()[i]);
    if (edge.norm() > 0) surface.tangents.col(i) = edge.normalized();
    surface.radii_m[i] = tree.radii()[i].value_or(0);
  }
  return surface;
}

class Rgrb final : public ImageRegistration {
 public:
  Rgrb(const RgrbSettings& settings, const VesselTree& tree)
      : ImageRegistration(RgrbSettings::kName, tree),
        settings_(settings),
        surface_(surfaceOf(withPlausibleRadii(tree, 1e-3 * settings.end_radius_mm))),
        radius_m_(std::sqrt(pointsCentered().colwise().squaredNorm().mean())) {}

 private:
  void fit(const XrayViews& views, const std::vector<cv::Mat>& attenuations, Pose& T_camera_centered,
           RegistrationResult& result) override {
    std::vector<ImageGradient> gradients;
    for (const cv::Mat& attenuation : attenuations) gradients.emplace_back(attenuation, kGradientSmoothing_px);
    std::mt19937_64 engine(static_cast<std::uint64_t>(settings_.seed));
    double reach_px = 0;
    for (const XrayView& view : views) {
      const double depth_m = std::max(1e-3, (view.T_view_first * T_camera_centered).translation().z());
      reach_px = std::max(reach_px, 1e-3 * settings_.search_mm * view.camera.parameters().fx_px / depth_m);
    }
    while (result.rigid_iterations < settings_.max_iterations) {
      const std::vector<SilhouetteMatch> matches = matched(views, gradients, T_camera_centered, reach_px);
      if (static_cast<int>(matches.size()) < kMinMatches) {
        result.last_step_px = reach_px;  // Not at rest: there is nothing that could hold it.
        return;
      }
      const Twist dx = agreedMotion(matches, std::max(kMinAgree_px, kAgreeShare * reach_px), engine);
      T_camera_centered = T_camera_centered * expSE3(dx);
      T_camera_centered.linear() = nearestRotation(T_camera_centered.linear());
      ++result.rigid_iterations;
      result.last_step_px = movedBy(matches, dx);
      if (reach_px <= kMinReach_px && result.last_step_px < kGradientRest_px) return;
      reach_px = std::max(kMinReach_px, reach_px / 1.5);
    }
  }

  std::vector<SilhouetteMatch> matched(const XrayViews& views, const std::vector<ImageGradient>& gradients,
                                       const Pose& T_camera_centered, double reach_px) const {
    std::vector<SilhouetteMatch> matches;
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Pose T = views[v].T_view_first * T_camera_centered;
      for (Eigen::Index i = 0; i < pointsCentered().cols(); ++i) {
        const Eigen::Vector3d p = pointsCentered().col(i), at = T * p;
        Eigen::Matrix<double, 2, 3> J;
        const auto pixel = views[v].camera.project(at, &J);
        if (!pixel || !views[v].sees(*pixel)) continue;
        const Eigen::Matrix<double, 2, 3> J_model = J * T.linear();
        const Eigen::Vector2d along = J_model * surface_.tangents.col(i);
        const double px_per_m = views[v].camera.parameters().fx_px / at.z();
        if (!(along.norm() > kMinSeenShare * px_per_m)) continue;
        const Eigen::Vector2d normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
        SilhouetteMatch match;
        const Eigen::RowVector3d a = normal.transpose() * J_model;
        match.row << a, p.transpose().cross(a);
        for (const double side : {-1.0, 1.0}) {
          const Eigen::Vector2d outline = *pixel + side * surface_.radii_m[i] * px_per_m * normal;
          if (bestAlong(gradients[v], views[v], outline, normal, side, reach_px, match)) matches.push_back(match);
        }
      }
    }
    return matches;
  }

  // The strongest gradient along the normal that points into the vessel.
  static bool bestAlong(const ImageGradient& gradient, const XrayView& view, const Eigen::Vector2d& outline,
                        const Eigen::Vector2d& normal, double side, double reach_px, SilhouetteMatch& match) {
    match.strength = 0;
    const int steps = static_cast<int>(reach_px);
    for (int k = -steps; k <= steps; ++k) {
      const Eigen::Vector2d at = outline + k * normal;
      const double strength = -side * gradient.at(at).dot(normal);
      if (strength <= match.strength || !view.sees(at)) continue;
      match.strength = strength;
      match.off_px = k;
    }
    if (!(match.strength > 0)) return false;
    // Between the steps, by the parabola through three of them.
    const Eigen::Vector2d at = outline + match.off_px * normal;
    const double before = -side * gradient.at(at - normal).dot(normal),
                 after = -side * gradient.at(at + normal).dot(normal);
    const double bend = before - 2 * match.strength + after;
    if (bend < 0) match.off_px += std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
    return true;
  }

  // A twist by weighed matches. Metres and radians are weighed by the tree's size; what matches say nothing of stays.
  template <typename Weight>
  Twist solved(const std::vector<SilhouetteMatch>& matches, const Weight& weight) const {
    Matrix6d H = Matrix6d::Zero();
    Vector6d g = Vector6d::Zero();
    for (std::size_t m = 0; m < matches.size(); ++m) {
      const double w = weight(m);
      if (w == 0) continue;
      H.noalias() += w * matches[m].row.transpose() * matches[m].row;
      g.noalias() += w * matches[m].off_px * matches[m].row.transpose();
    }
    Vector6d unit;
    unit << Eigen::Vector3d::Ones(), Eigen::Vector3d::Constant(1 / radius_m_);
    const Matrix6d scaled = unit.asDiagonal() * H * unit.asDiagonal();
    constexpr double kHold = 1e-6;
    const Matrix6d held = scaled + (kHold * scaled.trace() + 1e-12) * Matrix6d::Identity();
    const Vector6d x = solveSymmetric(held, unit.asDiagonal() * g);
    return x.allFinite() ? Twist(unit.asDiagonal() * x) : Twist(Twist::Zero());
  }

  // The motion that the strongest gradients agree on: random draws of a few matches each, then least squares over
  // those that agree with the best of them.
  Twist agreedMotion(const std::vector<SilhouetteMatch>& matches, double agree_px, std::mt19937_64& engine) const {
    const auto agrees = [&](const SilhouetteMatch& m, const Twist& dx) {
      return std::abs(m.row.dot(dx) - m.off_px) <= agree_px;
    };
    const auto support = [&](const Twist& dx) {
      double sum = 0;
      for (const SilhouetteMatch& m : matches) sum += agrees(m, dx) ? m.strength : 0;
      return sum;
    };
    Twist best = Twist::Zero();
    double most = support(best);
    std::vector<SilhouetteMatch> few(static_cast<std::size_t>(settings_.matches_a_draw));
    for (int draw = 0; draw < settings_.draws; ++draw) {
      for (SilhouetteMatch& m : few) m = matches[engine() % matches.size()];
      const Twist dx = solved(few, [](std::size_t) { return 1.0; });
      const double found = support(dx);
      if (found > most) most = found, best = dx;
    }
    for (int round = 0; round < 3; ++round) {
      best = solved(matches, [&](std::size_t m) { return agrees(matches[m], best) ? matches[m].strength : 0.0; });
    }
    return best;
  }

  // How far a twist moves the silhouette across itself, rms [px].
  static double movedBy(const std::vector<SilhouetteMatch>& matches, const Twist& dx) {
    double squares = 0;
    for (const SilhouetteMatch& m : matches) squares += std::pow(m.row.dot(dx), 2);
    return std::sqrt(squares / static_cast<double>(matches.size()));
  }

  RgrbSettings settings_;
  SurfacePoints surface_;
  double radius_m_;
};

}  // namespace

std::unique_ptr<Registration> make(const RgrbSettings& settings, const VesselTree& tree) {
  return std::make_unique<Rgrb>(settings, tree);
}

}  // namespace angio::registration
