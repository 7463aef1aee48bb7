// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <vector>

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
  double roll_rad = 0;        ///< Of the tip, against the vessel's frame (TreeTopology::frame).
  double bend_rad = 0;        ///< Between the tip and the catheter behind it, if nothing held it.
  bool touches_wall = false;  ///< The wall holds the tip by more than what counts as a contact.
  bool buckled = false;       ///< The drive pushes, and the catheter bulges instead of going on.
  int wall_contacts = 0;      ///< Since the start, each counted once.
};

/// A catheter with a bent tip in a vessel tree, moved by a drive at its base; quasi-static.
///
/// Its body follows the vessels. Between base and tip lie backlash, slack in bends, friction that grows with all bends
/// passed (capstan), wind-up of the shaft, which sliding lets out again, and buckling. At a fork it enters the branch
/// that its free tip points to best, where the branches' lumens part; where it points into none, it stands against the
/// wall. A tip goes no further than the tree or where the lumen is narrower than itself.
///
/// The base follows commands exactly, the rest is computed every 5 ms of its own time: it does not depend on how often
/// `advance` is called. When the last command has run out the drive stands still: silence means stop.
///
/// The parts and their magnitudes are our own assumptions, plausible for a microcatheter and nobody's measurement:
/// friction by Euler's and Eytelwein's capstan equation, wind-up of the shaft as a play operator.
class SimulatedCatheter : public CommandReceiver {
 public:
  /// With its tip at `start` at the time `now_us` [us], nothing wound up. Radii that the tree does not know are filled
  /// in by withPlausibleRadii. Throws InputError when a setting is out of its range or `start` is none of the tree's
  /// places.
  SimulatedCatheter(const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start,
                    std::int64_t now_us, const ReceiverSettings& receiver = {});

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
  using Base = Eigen::Vector3d;  // Insertion [m], roll and bend [rad], or their speeds [m/s, rad/s].
  Base furthest() const;
  Base baseAt(std::int64_t time_us) const;
  void settle(const Base& base);
  void slide(double insertion_m);
  bool advanceTip(double step_m);
  void retractTip(double step_m);
  int choose(int branch, double* worst) const;
  void feel(double insertion_m);
  double freePlay() const;
  double slidingForce() const;
  double radius(const TreeLocation& place) const;
  TreeLocation placeAt(double path_m) const;
  double deflection_m(const TreeLocation& place) const;
  Eigen::Vector3d freeDirection() const;
  Eigen::Vector3d heldDirection() const;

  CatheterSettings settings_;
  VesselTree tree_;
  TreeTopology map_;
  std::vector<int> path_;           // Branches from the root to the tip.
  double tip_m_;                    // Of the tip along the path, from the root.
  double roll_rad_, bend_rad_ = 0;  // Of the tip; roll without the zero's offset.
  double force_n_ = 0, tip_force_n_ = 0;
  bool blocked_ = false, buckled_ = false, touches_ = false;
  int contacts_ = 0;

  std::int64_t now_us_, settled_us_;       // The present, and the last multiple of the step that is computed.
  std::int64_t command_us_ = 0, stop_us_;  // When the command in force arrived, and when it ends.
  Base origin_, settled_;                  // Base when it arrived, and when the tip was last computed.
  Base speeds_ = Base::Zero();             // That it commands.
};

}  // namespace angio::simulation
