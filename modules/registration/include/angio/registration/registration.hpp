// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <variant>

#include "angio/base/settings.hpp"
#include "angio/registration/automask_settings.hpp"
#include "angio/registration/cvo_settings.hpp"
#include "angio/registration/dt_icp_settings.hpp"
#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/registration/nicp_settings.hpp"
#include "angio/registration/oriented_kernel_settings.hpp"
#include "angio/registration/pairwise_dnn_settings.hpp"
#include "angio/registration/result.hpp"
#include "angio/registration/rgrb_settings.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::registration {

/// Several starts against local minima: the prior's pose and draws around it.
struct StartSettings {
  int count = 0;
  double rotation_std_deg = 2;
  double translation_std_mm = 5;
  int seed = 1;

  // A box around the prior's pose that is searched as a whole, when one of them is not 0: +- so much about and along
  // each axis.
  double box_rotation_deg = 0;
  double box_translation_mm = 0;

  bool box() const { return box_rotation_deg > 0 || box_translation_mm > 0; }

  void visit(SettingsVisitor& v) {
    v.integer("count", count, 0, 100000,
              "Starts in all, the first is the prior's pose; 0: as many as the method thinks right");
    v.number(
        "rotation_std_deg", rotation_std_deg, 0, 180,
        "Standard deviation of the draws' rotation, per axis, about the tree's centroid; when the prior says nothing");
    v.number("translation_std_mm", translation_std_mm, 0, 1000,
             "Standard deviation of the draws' translation, per axis; when the prior says nothing");
    v.integer("seed", seed, 0, 2147483647, "Seed of the draws");
    v.number("box_rotation_deg", box_rotation_deg, 0, 180,
             "Half width of a box around the prior's pose that is searched as a whole, about each axis; 0 with "
             "box_translation_mm 0: no box");
    v.number("box_translation_mm", box_translation_mm, 0, 1000,
             "Half width of a box around the prior's pose that is searched as a whole, along each axis");
  }
};

/// What is known of the pose before the image is looked at.
struct PosePrior {
  Pose T_camera_model = Pose::Identity();

  /// Covariance of the twist [v (m); w (rad)] about the tree's centroid c, in model axes:
  /// T_true = T_camera_model Trans(c) exp(xi) Trans(-c). Absent: the method's own prior holds.
  std::optional<Matrix6d> covariance;
};

/// Called now and then during long work with the share that is done, 0 to 1.
using SearchProgress = std::function<void(double share_done)>;

/// Aligns one vessel tree with X-ray images. One object per tree and thread: what depends on the tree only is computed
/// once.
class Registration {
 public:
  virtual ~Registration() = default;

  /// Finds the pose of the tree in the first view's camera frame.
  ///
  /// @param start  Where the solver begins: there is one answer near it.
  ///
  /// Never throws on a poor image: that is a status in the result. Throws InputError where the method needs an image
  /// (imageNeeded()) and a view has none.
  virtual RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) = 0;

  /// Finds the pose from several starts, or in a box of poses, and says how much better it is than the best different
  /// one.
  ///
  /// What every method can do, and does unless it knows better: aligns from each start and returns the best by
  /// AlignmentScore::score. Throws InputError when a setting is out of its range.
  virtual RegistrationResult search(const XrayViews& views, const PosePrior& prior, const StartSettings& starts,
                                    const SearchProgress& progress = {});

  /// One view.
  RegistrationResult align(const Centerline2d& centerline, const XrayCamera& camera, const PosePrior& prior,
                           const Pose& start) {
    return align({XrayView{centerline, camera}}, prior, start);
  }
  RegistrationResult align(const Centerline2d& centerline, const XrayCamera& camera, const PosePrior& prior) {
    return align(centerline, camera, prior, prior.T_camera_model);
  }
  RegistrationResult search(const Centerline2d& centerline, const XrayCamera& camera, const PosePrior& prior,
                            const StartSettings& starts) {
    return search({XrayView{centerline, camera}}, prior, starts);
  }

  /// The tree that is aligned.
  virtual const VesselTree& tree() const = 0;
};

/// The settings type is the choice of the method: a new method is its settings, its source and one name here.
using RegistrationSettings = std::variant<IterativePnpSettings, OrientedKernelSettings, DtIcpSettings, NicpSettings,
                                          CvoSettings, RgrbSettings, AutoMaskSettings, PairwiseDnnSettings>;

/// Throws InputError when a setting is out of its range.
std::unique_ptr<Registration> makeRegistration(const RegistrationSettings& settings, const VesselTree& tree);

/// Default settings of a method by its name, or those of a preset: "iterative_pnp:paper", as printed, ":huber" and
/// ":l2", so with another loss, ":best", the best found; "nicp:source" and "cvo:source", as their sources have it where
/// ours differ; "dt_icp:l2". Throws InputError that lists the names there are.
RegistrationSettings registrationSettingsNamed(const std::string& name);

/// Whether a method's name names a preset, which no settings file changes.
bool isPreset(const std::string& name);

/// How many starts belong to a preset; 0 where it leaves them open, and for methods that are none.
int startsOfPreset(const std::string& name);

/// The name of the method that `settings` choose.
std::string methodName(const RegistrationSettings& settings);

/// Chooses rigid or nonrigid. Returns false, and changes nothing, where a nonrigid registration is asked of a method
/// that is rigid.
bool setDeformation(RegistrationSettings& settings, Deformation deformation);

/// Whether a method looks at the X-ray images: each view must have its own.
bool imageNeeded(const RegistrationSettings& settings);

}  // namespace angio::registration
