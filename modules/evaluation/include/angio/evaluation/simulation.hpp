// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/evaluation/namespace.hpp"
#include "angio/geometry/measured_motion.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::evaluation {

/// What a method is given of a simulated view: the centreline as it projects, with noise, or what an extractor finds in
/// a rendered X-ray image.
enum class TrialSource { kCenterlines, kImages };

/// Where the axes x, y, z of a tree's file point in the patient: L(eft), R(ight), A(nterior), P(osterior), S(uperior),
/// I(nferior).
enum class ModelAxes { kLps, kRas, kLip };

/// Simulated registration trials with known truth: how a tree is seen, and what is wrong with the image, the
/// calibration and the start.
struct SimulationSettings {
  int trials = 100;
  int seed = 1;
  TrialSource from = TrialSource::kCenterlines;

  // Starts: normal draws about the truth, per axis, about the tree's centroid.
  double rotation_std_deg = 2;
  double translation_std_mm = 5;
  double even_starts_mm = 0;

  // View: the beam is uniform in these ranges of DICOM's angles, the roll of the image in its own.
  int views = 1;
  double turn_deg = 0;
  double turn_s = 0;
  double breath_mm = 0;
  ModelAxes model_axes = ModelAxes::kLps;
  double primary_deg = 0, secondary_deg = 0;
  double primary_range_deg = 60, secondary_range_deg = 35, roll_range_deg = 180;
  double source_isocenter_mm = 750;

  // Image.
  double visible_fraction = 1;
  double missing = 0;
  double filled = 1;
  int spurious = 0;
  double noise_px = 0;
  double tangent_noise_deg = 0;
  double spacing_px = 1.5;
  double tree_spacing_mm = 0.25;

  // The deformation: four plane waves with random directions, phases and wavelengths of 1 to 3 times the tree's extent,
  // less their rigid part (mean shift and small rotation about the centroid, least squares), which would be a pose.
  // With measured motions one of these instead, carried over to the tree by scaling and by a random turn.
  double deformation_rms_mm = 0;
  double deformation_anisotropy = 1;

  // What a method is told differs from what is true by this much, in a random direction.
  double focal_error_percent = 0;
  double principal_point_error_px = 0;
  double calibration_rotation_error_deg = 0;
  double calibration_translation_error_mm = 0;

  /// How images look, when they are made. Their noise is that of the dose: noise_px and tangent_noise_deg have no part
  /// in them; spurious curves are steel wires in the plane of the isocentre.
  FluoroscopySettings fluoroscopy;

  void visit(SettingsVisitor& v) {
    v.choice("from", from, {"centerlines", "images"},
             "What methods are given: projected centrelines, or what the extractor finds in X-ray images");
    v.section("fluoroscopy", [this](SettingsVisitor& inner) { fluoroscopy.visit(inner); });
    v.integer("trials", trials, 1, 100000, "Number of trials, split over the trees");
    v.integer("seed", seed, 0, 2147483647, "Seed of all draws");
    v.number("rotation_std_deg", rotation_std_deg, 0, 180,
             "Standard deviation of the starts' rotation about the truth, per axis");
    v.number("translation_std_mm", translation_std_mm, 0, 1000,
             "Standard deviation of the starts' translation about the truth, per axis");
    v.number("even_starts_mm", even_starts_mm, 0, 1000,
             "Not 0: each draw is scaled so that its mTRE is uniform between 0 and this");
    v.integer(
        "views", views, 1, 60,
        "Views of one moment; 2: a second plane, its beam 70 to 110 deg from the first one's, about the isocentre");
    v.number("turn_deg", turn_deg, 0, 180,
             "Not 0: the views are spread evenly over such a turn of the C-arm, about the isocentre");
    v.number("turn_s", turn_s, 0, 60,
             "Not 0: the views are the frames of a sequence, 4 s of standing and then the turn by the primary angle, "
             "which takes so long; the last one is what is asked for");
    v.number("breath_mm", breath_mm, 0, 60, "How far the diaphragm comes down in the sequence of turn_s");
    v.choice(
        "model_axes", model_axes, {"lps", "ras", "lip"},
        "Where the tree's x, y, z point in the patient, by the initials of left, right, posterior, superior, inferior");
    v.number("primary_deg", primary_deg, -180, 180, "Middle of the range of the beam's primary angle");
    v.number("secondary_deg", secondary_deg, -90, 90, "Middle of the range of the beam's secondary angle");
    v.number("primary_range_deg", primary_range_deg, 0, 180,
             "The primary angle is drawn up to so far on either side of the middle");
    v.number("secondary_range_deg", secondary_range_deg, 0, 90,
             "The secondary angle is drawn up to so far on either side of the middle");
    v.number("roll_range_deg", roll_range_deg, 0, 180, "The image's roll is drawn up to so far on either side of 0");
    v.number("source_isocentre_mm", source_isocenter_mm, 10, 10000,
             "Distance from the source to the isocentre, where the tree's centroid stands");
    v.number("visible_fraction", visible_fraction, 0.02, 1,
             "Share of the tree's projected length inside the field of view");
    v.number("missing", missing, 0, 0.98,
             "Share of the tree's length, whole branches, that no view shows: no contrast agent");
    v.number("filled", filled, 0.02, 1, "Share of the tree's length in view that is filled, downstream of drawn sites");
    v.integer("spurious", spurious, 0, 1000, "Curves per view that are no vessel, 60 to 250 px long");
    v.number("noise_px", noise_px, 0, 100,
             "Standard deviation of each image coordinate, independent; tangents are estimated from the noisy points");
    v.number("tangent_noise_deg", tangent_noise_deg, 0, 90,
             "Standard deviation of the tangents, on top of that of the noisy points");
    v.number("spacing_px", spacing_px, 0, 100,
             "Distance between points of the centreline; 0: one per point of the projected tree");
    v.number("tree_spacing_mm", tree_spacing_mm, 0, 100,
             "Longest edge of the projected tree; 0: the tree's own points");
    v.number("deformation_rms_mm", deformation_rms_mm, 0, 1000,
             "Root mean square, over the tree's points, of a smooth deformation that leaves its mean pose as it is");
    v.number("deformation_anisotropy", deformation_anisotropy, 0.01, 100,
             "Amplitude of the deformation's waves from feet to head over that of the other two axes");
    v.number("focal_error_percent", focal_error_percent, 0, 50, "Error of the focal length that a method is told");
    v.number("principal_point_error_px", principal_point_error_px, 0, 1000,
             "Error of the principal point that a method is told, in a random direction");
    v.number("calibration_rotation_error_deg", calibration_rotation_error_deg, 0, 90,
             "Error of the second view's rotation against the first, about the isocentre");
    v.number("calibration_translation_error_mm", calibration_translation_error_mm, 0, 1000,
             "Error of the second view's translation against the first");
  }
};

/// Points in order, in one image [px].
using Curve = std::vector<Eigen::Vector2d>;

/// One trial: what a method is given, and the truth.
struct SimulatedTrial {
  /// How a view really is.
  struct TrueView {
    XrayCamera camera;
    Pose T_view_first = Pose::Identity();
    std::vector<Curve> spurious_px;  ///< Curves that are no vessel.
  };

  std::vector<XrayCamera> cameras;        ///< As the method is told, calibration errors included.
  std::vector<Centerline2d> centerlines;  ///< One per camera.
  std::vector<Pose> T_view_first;         ///< As the method is told; the identity for the first view.
  /// Of a sequence: when each view was taken [s], the newest last. "First" is the newest then.
  std::vector<double> times_s;
  Pose truth = Pose::Identity();  ///< T_camera_model of the first view.
  Pose start = Pose::Identity();
  Eigen::Matrix3Xd displacements_m;  ///< True, of the tree's points, model axes; empty without deformation.
  std::vector<TrueView> true_views;  ///< One per camera.
  Eigen::VectorXd filled;            ///< 1 at the tree's points on branches with contrast agent, 0 at the others.

  /// Borrows the trial, which must outlive it.
  XrayViews views() const;
};

/// Patient axes L, P, S from the axes of a tree's file.
Eigen::Matrix3d lpsOf(ModelAxes axes);

/// The detector of the simulated C-arm: 1024 x 1024 pixels of 0.308 mm, 1195 mm from the source.
XrayCamera simulatedCamera();

/// Makes one trial. The same for one seed and `index` on every machine; what one setting draws does not depend on the
/// others, so that a sweep over noise, say, sees the same views and starts.
///
/// With `visible_fraction` f below 1 the detector is cropped to a window about a random place of the tree that shows f
/// of the projected length of the whole tree, to within 0.02 where whole pixels and the tree allow it. A tree that the
/// detector itself cuts more than that is cut by the detector. A deformation is that of `motion` where one is given.
/// Throws InputError when a setting is out of its range.
SimulatedTrial simulatedTrial(const VesselTree& tree, const std::optional<XrayCamera>& camera,
                              const SimulationSettings& settings, int index, const MeasuredMotion* motion = nullptr);

/// What an X-ray image of a trial shows.
struct TrialTruth {
  Centerline2d visible;  ///< Vessels that can be seen at the dose, and devices.
  Centerline2d all;      ///< Those that cannot be seen as well.
};

/// Makes the X-ray images of simulated trials: contrast agent in the filled branches, the patient around them, wires
/// where the trial has curves that are no vessel.
class TrialImages {
 public:
  /// Throws InputError when a setting is out of its range, or `settings` asks for noise of points, which images do not
  /// have.
  TrialImages(const std::vector<VesselTree>& trees, const SimulationSettings& settings);

  /// One view of a trial of one of the trees. Noise is that of the trial's `index` and view.
  cv::Mat render(const SimulatedTrial& trial, std::size_t tree, std::size_t view, int index);

  /// What that image shows.
  TrialTruth truth(const SimulatedTrial& trial, std::size_t tree, std::size_t view);

 private:
  XrayScene sceneOf(const SimulatedTrial& trial, std::size_t view) const;

  SimulationSettings settings_;
  std::vector<std::unique_ptr<FluoroscopyRenderer>> renderers_;  // By tree.
};

}  // namespace angio::evaluation
