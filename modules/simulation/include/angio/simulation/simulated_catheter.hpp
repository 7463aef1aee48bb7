// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "angio/simulation/catheter_settings.hpp"
#include "angio/simulation/device.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/types/catheter.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::simulation {

/// What a simulated catheter really does, and what its drive cannot tell. All at rest: as if no tissue moved.
struct CatheterTruth {
  TreeLocation tip;                                            ///< On the tree.
  double path_m = 0;                                           ///< From the root to there.
  Eigen::Vector3d tip_model = Eigen::Vector3d::Zero();         ///< The tip's end, beside the centreline [m].
  Eigen::Vector3d direction_model = Eigen::Vector3d::UnitZ();  ///< In which it points, as far as the lumen lets it.
  double roll_rad = 0;         ///< Of the tip, against the vessel's frame (TreeTopology::frame).
  double bend_rad = 0;         ///< Between the tip and the catheter behind it, if nothing held it.
  bool touches_wall = false;   ///< The wall holds the tip by more than what counts as a contact.
  bool buckled = false;        ///< The drive pushes, and the catheter bulges instead of going on.
  int wall_contacts = 0;       ///< Since the start, each counted once.
  double tip_force_n = 0;      ///< Of the wall on the tip [N]; of an elastic catheter, from its bend to its end.
  double max_tip_force_n = 0;  ///< The largest since the start [N], at every step of 5 ms.
  double max_push_n = 0;       ///< The largest with which the drive pushed since the start [N], the same.
  double max_pull_n = 0;       ///< The same of pulling.
};

class CatheterBody;

/// A catheter with a bent tip in a vessel tree, moved by a drive at its base; quasi-static.
///
/// Its body is kinematic or elastic, as the settings choose. A kinematic one follows the vessels. Between base and tip
/// lie backlash, slack in bends, friction that grows with all bends passed (capstan), wind-up of the shaft, which
/// sliding lets out again, and buckling. At a fork it enters the branch that its free tip points to best, where the
/// branches' lumens part; where it points into none, it stands against the wall. A tip goes no further than the tree or
/// where the lumen is narrower than itself. These parts and their magnitudes are our own assumptions, plausible for a
/// microcatheter and nobody's measurement. An elastic one is an ElasticRod between the walls, whose forces make all of
/// this but the drive's backlash; where it is pushed with more than `buckling_force_n`, it bulges outside the vessels.
///
/// The base follows commands exactly, the rest is computed every 5 ms of its own time: it does not depend on how often
/// `advance` is called. When the last command has run out the drive stands still: silence means stop.
class SimulatedCatheter : public CommandReceiver {
 public:
  /// With its tip at `start` at the time `now_us` [us], nothing wound up. Radii that the tree does not know are filled
  /// in by withPlausibleRadii. Throws InputError when a setting is out of its range or `start` is none of the tree's
  /// places.
  SimulatedCatheter(const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start,
                    std::int64_t now_us, const ReceiverSettings& receiver = {});
  SimulatedCatheter(SimulatedCatheter&&) noexcept;
  SimulatedCatheter& operator=(SimulatedCatheter&&) noexcept;
  ~SimulatedCatheter();

  using Base = Eigen::Vector3d;  ///< Insertion [m], roll and bend [rad], or their speeds [m/s, rad/s].

  /// Takes a command that arrives at `now_us` [us] and holds for its validity from then on; speeds beyond the drive's
  /// are cut to them. What CommandReceiver does not take is ignored, and the command before it stays in force.
  ///
  /// @param sender  As the bus names it; empty: unknown.
  void obey(const CatheterCommand& command, std::int64_t now_us, const std::string& sender = {});

  /// Moves to the time `now_us` [us]; an earlier time than the present is ignored.
  void advance(std::int64_t now_us);

  /// The drive at the present time. The sequence number is the sender's to fill in.
  CatheterState state() const;

  CatheterTruth truth() const;

  /// Its shape where the tree's points stand at 3 x N `points` [m], the tip last: moved tissue takes it along.
  Device device(const Eigen::Matrix3Xd& points) const;

 private:
  Base nearest() const;
  Base furthest() const;
  Base baseAt(std::int64_t time_us) const;

  CatheterSettings settings_;
  VesselTree tree_;
  std::unique_ptr<CatheterBody> body_;

  std::int64_t now_us_, settled_us_;       // The present, and the last multiple of the step that is computed.
  std::int64_t command_us_ = 0, stop_us_;  // When the command in force arrived, and when it ends.
  Base origin_, settled_;                  // Base when it arrived, and when the tip was last computed.
  Base speeds_ = Base::Zero();             // That it commands.
};

}  // namespace angio::simulation
