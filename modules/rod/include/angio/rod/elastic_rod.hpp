// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/rod/lumen.hpp"
#include "angio/rod/rod_energy.hpp"
#include "angio/rod/rod_settings.hpp"

namespace angio::rod {

class BandedSystem;
struct SlidingPoint;

/// How a rod is laid into the vessels.
struct RodStart {
  TreeLocation tip;
  double bend_rad = 0;  ///< As ElasticRod::bend.
  double roll_rad = 0;  ///< Of the director against the vessel's normal at the root, clockwise as seen towards the tip.
};

/// What a drive does to a rod in one step.
struct RodMotion {
  double inserted_m = 0;  ///< Pushed in; pulled back < 0.
  double rolled_rad = 0;  ///< Clockwise as seen from the base towards the tip.
};

/// Forces of a rod at rest [N].
struct RodForces {
  double insertion_n = 0;   ///< With which the drive pushes (+) or pulls (-).
  double tip_n = 0;         ///< Of the wall on the tip, from its bend to its end: length of their sum.
  double most_wall_n = 0;   ///< The largest such force on any stretch as long as the tip.
  Eigen::Matrix3Xd wall_n;  ///< 3 x n, of the wall on each of the rod's points, model axes: pressure and friction.
};

/// How the last step came to rest.
struct RodEffort {
  int iterations = 0;    ///< Of Newton's method.
  bool at_rest = false;  ///< The last of them moved the rod by less than a micrometre.
  double energy_j = 0;   ///< Elastic energy and the wall's.
};

/// An elastic catheter in the vessels of a tree, pushed and turned where it comes in: at the root of the branches that
/// its tip is in, along the vessel there.
///
/// After each step it is at rest: a local minimum of its elastic energy (elasticEnergy), of the wall's, which resists
/// in proportion to how deep a point is in it, and of what sliding costs (Coulomb friction by the wall's forces, found
/// in turns). Newton's method, begun from where the rod was, pushed along itself. Inertia and blood are left out.
class ElasticRod {
 public:
  /// Laid along the vessels without twist, and brought to rest. Throws InputError when a setting is out of its range or
  /// the tip is nearer to the root than kMinInserted_m.
  ElasticRod(Lumen lumen, const RodSettings& settings, const RodStart& start);
  ElasticRod(ElasticRod&&) noexcept;
  ElasticRod& operator=(ElasticRod&&) noexcept;
  ~ElasticRod();

  /// It is never pulled out further than that.
  static constexpr double kMinInserted_m = 10e-3;

  /// The angle by which the tip is bent without load, evenly over its bend, towards the director [rad].
  void bend(double angle_rad);

  /// A constant force on the tip's end, model axes [N].
  void load(const Eigen::Vector3d& force_n) { load_n_ = force_n; }

  /// Moves the drive, in as many steps as it takes, and brings the rod to rest.
  void move(const RodMotion& motion);

  const RodShape& shape() const { return shape_; }
  const RodBody& body() const { return body_; }
  const RodEffort& effort() const { return effort_; }
  const Lumen& lumen() const { return lumen_; }
  double inserted_m() const { return inserted_m_; }
  TreeLocation tip() const;
  EdgePoint edgePoint(Eigen::Index point) const;  ///< The vessel's axis beside one of its points.
  RodForces forces() const;

 private:
  void layOut(const RodStart& start);
  void setSections();
  void slideBy(double inserted_m);
  bool fitPoints();
  void step(const RodMotion& motion);
  void rest();
  bool newton();
  std::vector<WallGap> gaps(const RodShape& shape) const;
  double wall_n_m(Eigen::Index point) const;
  double energy(const RodShape& shape, const std::vector<WallGap>& gaps, Eigen::VectorXd* gradient,
                BandedSystem* hessian) const;
  std::vector<SlidingPoint> pressed() const;

  Lumen lumen_;
  RodSettings settings_;
  RodShape shape_;
  RodBody body_;
  std::vector<int> tubes_;             // In which each point is.
  Eigen::Matrix3Xd from_;              // Where the points were before the last step; empty when there was none.
  std::vector<SlidingPoint> sliding_;  // Points that the wall pressed on when friction was last brought up to date.
  Eigen::Vector3d load_n_ = Eigen::Vector3d::Zero();
  double inserted_m_ = 0, bend_rad_ = 0;
  RodEffort effort_;
};

}  // namespace angio::rod
