// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/imaging/extractor.hpp"
#include "angio/io/case_files.hpp"
#include "angio/perception/patient_tracker.hpp"
#include "angio/registration/certificate.hpp"
#include "angio/registration/starts.hpp"
#include "angio/results/campaign.hpp"
#include "angio/results/pose_error.hpp"

namespace angio::results {

/// How the frames of a sequence are tracked when nothing else is asked for: an initial pose is believed as well as a
/// single case's (OrientedKernelSettings), since it may be a nominal one. A loop believes its calibration better.
PatientTrackerSettings trackerOfCases();

/// How cases are run.
struct CaseRunSettings {
  RegistrationSettings registration;
  StartSettings starts;
  ExtractorSettings extractor;
  PatientTrackerSettings tracker = trackerOfCases();  ///< Of sequences.
  bool point_covariance = false;                      ///< Whether the covariance of each point of the tree is wanted.
  bool displacements = false;    ///< Whether every result has displacements: of a rigid method they are zero.
  Campaign* campaign = nullptr;  ///< Where cases come from that are not all run here; a sequence is one run.
};

/// What became of one case.
struct CaseOutcome {
  std::string name;
  RegistrationResult result;
  double image_s = 0;                    ///< Time from images to centrelines; 0 when centrelines were given [s].
  double pixel_at_isocenter_m = 0;       ///< Size of the first view's pixel at the depth of the tree's centroid.
  std::optional<bool> followed;          ///< Of a frame of a sequence: whether it passed the gate, and is tracked.
  std::optional<std::string> rejection;  ///< Why the gate rejected it; nothing when it passed, or is of no sequence.
  bool by_catheter = false;              ///< Whether the vessels that a catheter lies in have been registered, alone.
  /// Of a result with a covariance and a known truth: shares of the tree's points that lie further off than the
  /// covariance claims.
  struct Claim {
    double beyond = 0;    ///< Beyond its ellipsoid of 3 standard deviations (99.7 %).
    double depth_in = 0;  ///< Share whose depth is within the 90 % interval.
    double plane_in = 0;  ///< The same across the beam, of both axes.
  };
  std::optional<Claim> claim;
  /// Tasks whose needs the claimed covariance of a converged result meets, with the loops' own limit of what may be
  /// unsure, at 95 % of the tree's places: of "centre", which needs them across the beam, "view" and "navigate".
  std::vector<std::string> usable_for;
  std::vector<Eigen::Matrix3d> point_covariances_m2;  ///< Of each point of the tree, camera axes, where asked for.
  /// The same whose 90 % intervals hold 90 %: see PointUncertainty::centralCovarianceAt().
  std::vector<Eigen::Matrix3d> point_central_covariances_m2;
  /// Half of the 90 % intervals about the claimed places, rms over the tree [m].
  struct Interval {
    double across_beam_m = 0;  ///< On an axis across the ray.
    double depth_m = 0;        ///< Along it.
  };
  std::optional<Interval> interval_90;
  /// Of a trial that was certified: what the certificate says, and whether it is false: it has proven a pose that is
  /// another one than the truth.
  std::optional<PoseCertificate> certificate;
  bool certificate_false = false;
  /// Of a trial: the paper's PR, see projectionResidual_px().
  std::optional<double> projection_residual_px;
  std::optional<PoseError> start_error,
      error;  ///< Of the pose it started from and of the result, when the truth is known; in the first view.
};

/// Runs every case with one method. The cases of a sequence are tracked as a loop tracks its frames: by GatedPerception
/// with its own defaults, the method searching and tracking; an initial pose stands for what joints and calibration say
/// of that frame. Where the set does not say the frames' period there are 15 a second for a tracker that follows
/// motion, and two for others. With `oriented_kernel` frames of one curve alone that no pose explains are registered by
/// their catheter; alignment, spread and uses are then those of the vessels that it lies in. After SIGINT or SIGTERM no
/// case is begun; returns those that are finished. Throws InputError for files that cannot be read, Interrupted when no
/// case is finished.
std::vector<CaseOutcome> runCases(const CaseSet& set, const CaseRunSettings& settings, const Progress& progress = {});

/// One method's figures over all cases, as people compare methods.
nlohmann::ordered_json summaryOf(const std::vector<CaseOutcome>& outcomes);

/// Sets what an outcome's result is usable for, its 90 % intervals and, if asked for, the covariances of each point of
/// the tree.
void addClaims(const VesselTree& tree, bool of_each_point, CaseOutcome& outcome);

/// One case as outside tools read it.
nlohmann::ordered_json caseAsJson(const CaseOutcome& outcome);

/// A certificate and what was asked for.
nlohmann::ordered_json certificateAsJson(const PoseCertificate& certificate, const CertificateSettings& settings);

/// The summaries of several methods as a table for people, Markdown.
std::string summaryTable(const nlohmann::ordered_json& summary_by_method);

}  // namespace angio::results
