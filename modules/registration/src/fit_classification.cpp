// SPDX-License-Identifier: GPL-2.0-or-later
#include "fit_classification.hpp"
#include "angio/geometry/decompositions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "angio/base/formatted.hpp"
#include "angio/registration/result.hpp"
#include "densified_views.hpp"

namespace angio::registration {
namespace {

constexpr int kMinPoints = 12;

// Right poses of fully visible trees, from rendered X-ray images with the tangles and stubs an extractor misses,
// explain 73 % or more of the model and 85 % of the image (score 0.62); wrong poses, noise images and other patients'
// trees stay below 0.59 and 0.58, and below a score of 0.43 (tests/registration: none of them converges).
constexpr double kConvergedShare = 0.6;
constexpr double kConvergedScore = 0.5;
// Of brains deformed by 5 mm in two views (tuned half, 400 trials) all score 0.42 or more, and claim enough where
// claims go by the score; in one view nearly half of 400 do, of both halves, and none of these is wrong. Other
// patients' trees deformed to two views score 0.09 at most (48 trials), to one view 0.08 (40 trials of either half).
constexpr double kNearStartScore = 0.42;
constexpr double kDivergedShare = 0.35;

// A fit whose best alternative scores less than half stands alone: oriented fits with 70 % of the tree without contrast
// and ten stray curves score 0.16 or more and have alternatives of at most 0.6; fits to other trees, in 300 trials,
// score 0.07 at most and have alternatives of 0.89 or more.
constexpr double kAloneShare = 0.5, kAloneMinShare = 0.25, kAloneScore = 0.15;
// A different pose with this share of the best score leaves the choice open.
constexpr double kAmbiguousShare = 0.9;

// What an image holds no better than this (rms over the tree's points, one standard deviation) is right by luck when it
// is; real views of a phantom leave 1.4 to 2.1 mm. A fit that is believed because it stands alone owes more: of 808
// right ones on half of a tree 3 are less sure than both limits, and 27 of 33 wrong ones that everything else spoke
// for.
constexpr double kMaxSpread_m = 3e-3, kAloneMaxSpread_m = 1e-3;
// A deformed tree that the image explains well keeps its place in the image; its depth is open, and the covariance says
// so. Who needs depth has to look at it. An image that explains little keeps neither: of a tree deformed by 3 mm
// residuals are as wide as the distances between vessels, and no longer tell how much it is deformed.
constexpr double kMaxAcross_m = 5e-3;
// From this on a deformation is worth a word.
constexpr double kDeformed_m = 0.3e-3;

// A deformation larger than this (rms over the tree) is more than breathing: livers move by up to 25 mm with breath,
// most of it as one. A stent's wires or a table deform a tree further. Nonrigid points can follow any line, also one
// that is no vessel of this tree, so that such a fit has to explain nearly all that the image shows.
constexpr double kLargeDeformation_m = 10e-3, kLargeImageShare = 0.8;

double rms(const Eigen::Matrix3Xd& displacements_m) {
  return displacements_m.cols() == 0
             ? 0.0
             : std::sqrt(displacements_m.squaredNorm() / static_cast<double>(displacements_m.cols()));
}

std::string millimetres(double length_m) { return std::to_string(static_cast<int>(1e3 * length_m + 0.5)) + " mm"; }
std::string percent(double share) { return std::to_string(static_cast<int>(100 * share + 0.5)) + " %"; }

Matrix6d symmetric(const Matrix6d& C) { return 0.5 * (C + C.transpose()); }

// What an alignment score must reach.
struct Threshold {
  double share, score;
  PlaceSpread spread;
};

constexpr Threshold kUsual{
    kConvergedShare, kConvergedScore, {kMaxSpread_m, std::numeric_limits<double>::infinity(), kMaxAcross_m}};
constexpr Threshold kNearStart{kConvergedShare, kNearStartScore, kUsual.spread};
constexpr Threshold kAlone{kAloneMinShare, kAloneScore, {kAloneMaxSpread_m, kAloneMaxSpread_m, kMaxAcross_m}};

const Threshold& usualOf(const RegistrationResult& result) { return result.low_score_suffices ? kNearStart : kUsual; }

bool reaches(const AlignmentScore& a, double share, double score) {
  return std::min(a.model_explained, a.image_explained) >= share && a.score() >= score;
}

// What the image leaves open by more than it may, if anything.
std::optional<std::string> leftOpen(const Threshold& threshold, const VesselTree& tree,
                                    const RegistrationResult& result) {
  PlaceSpread spread;
  if (result.spread) {
    spread = *result.spread;
  } else {
    spread.noise_m = spread.all_m = spread_m(*result.covariance, result.T_camera_model, tree);
  }
  // The noise's part means something where the tree is taken to be rigid.
  const bool deformed = result.spread && result.displacements_m.cols() > 0;
  const bool within =
      (deformed || spread.noise_m <= threshold.spread.noise_m) && spread.all_m <= threshold.spread.all_m;
  if (within && spread.across_m <= threshold.spread.across_m) return std::nullopt;
  std::string what = "the image leaves the pose open by more than " + millimetres(threshold.spread.noise_m);
  if (within) what = formatted("the image leaves the place across the beam open by %.1f mm", 1e3 * spread.across_m);
  if (!seemsDeformed(result)) return what;
  return what + ": the tree seems bent by " + formatted("%.1f mm", 1e3 * result.deformation_std_m);
}

// Why a large deformation is not believed, where there is one.
std::optional<std::string> deformedTooFar(const RegistrationResult& result, double deformation_m) {
  if (deformation_m <= kLargeDeformation_m || result.alignment.image_explained >= kLargeImageShare) return std::nullopt;
  return "the tree had to be deformed by " + millimetres(deformation_m) + ", and the model explains " +
         percent(result.alignment.image_explained) + " of the image, less than " + percent(kLargeImageShare);
}

void classifyBy(const Threshold& threshold, const VesselTree& tree, double deformation_m, RegistrationResult& result) {
  const AlignmentScore& a = result.alignment;
  const double most = std::max(a.model_explained, a.image_explained);
  result.status = RegistrationStatus::kAmbiguous;
  result.reason = "image explains " + percent(a.model_explained) + " of the model in view, model explains " +
                  percent(a.image_explained) + " of the image";
  if (!result.T_camera_model.matrix().allFinite() || !result.covariance || a.model_points < kMinPoints) {
    result.status = RegistrationStatus::kDiverged;
    result.reason = "no model in view, or no full-rank system at the solution";
  } else if (!reaches(a, threshold.share, threshold.score)) {
    if (most < kDivergedShare) result.status = RegistrationStatus::kDiverged;
  } else if (result.last_step_px > kAtRest_px) {
    result.reason = "the solver had not come to rest";
  } else if (const auto why = deformedTooFar(result, deformation_m)) {
    result.reason = *why;
  } else if (const auto open = leftOpen(threshold, tree, result)) {
    result.reason = *open;
  } else {
    result.status = RegistrationStatus::kConverged;
    result.reason.clear();
  }
}

}  // namespace

RegistrationResult resultAt(const Pose& start, int points_3d, const XrayViews& views) {
  RegistrationResult result;
  result.T_camera_model = start;
  result.points_3d = points_3d;
  result.points_2d = pointsIn(views);
  return result;
}

bool tooFewPoints(RegistrationResult& result) {
  if (result.points_3d >= kMinPoints && result.points_2d >= kMinPoints) return false;
  result.status = RegistrationStatus::kTooFewPoints;
  result.reason = std::to_string(result.points_3d) + " model and " + std::to_string(result.points_2d) +
                  " image points, at least " + std::to_string(kMinPoints) + " of each are needed";
  return true;
}

bool seemsDeformed(const RegistrationResult& result) { return result.deformation_std_m > kDeformed_m; }

bool explained(const RegistrationResult& result) {
  const Threshold& usual = usualOf(result);
  return result.T_camera_model.matrix().allFinite() && result.covariance &&
         result.alignment.model_points >= kMinPoints && reaches(result.alignment, usual.share, usual.score) &&
         result.last_step_px <= kAtRest_px && !deformedTooFar(result, rms(result.displacements_m));
}

double spread_m(const Matrix6d& covariance, const Pose& T_camera_model, const VesselTree& tree) {
  // A point q about the centroid moves by v + w x q; the mean of q is nothing, and so are the mixed terms.
  const Matrix6d C = covarianceAboutCentroid(covariance, T_camera_model, tree.centroid());
  const Eigen::Matrix3Xd q = tree.points().colwise() - tree.centroid();
  const Eigen::Matrix3d M = q * q.transpose() / static_cast<double>(tree.size());
  const Eigen::Matrix3d inertia = M.trace() * Eigen::Matrix3d::Identity() - M;
  const double variance_m2 = C.topLeftCorner<3, 3>().trace() + C.bottomRightCorner<3, 3>().cwiseProduct(inertia).sum();
  return std::sqrt(std::max(0.0, variance_m2));
}

void classify(const VesselTree& tree, RegistrationResult& result) {
  classifyBy(usualOf(result), tree, rms(result.displacements_m), result);
}

void classifyInMotion(const VesselTree& tree, RegistrationResult& result) {
  Eigen::Matrix3Xd deformation_m = result.displacements_m;
  if (deformation_m.cols() > 0) deformation_m.colwise() -= Eigen::Vector3d(deformation_m.rowwise().mean());
  classifyBy(usualOf(result), tree, rms(deformation_m), result);
}

void classifyAgainst(double alternative_share, const VesselTree& tree, RegistrationResult& result) {
  const Threshold& usual = usualOf(result);
  const bool reached = reaches(result.alignment, usual.share, usual.score);
  // A deformed tree follows any line near by: that nothing else fits does not speak for it.
  const double deformation_m = rms(result.displacements_m);
  const bool alone = alternative_share <= kAloneShare && !reached && !(deformation_m > 0);
  classifyBy(alone ? kAlone : usual, tree, deformation_m, result);
  compareWithAlternative(alternative_share, result);
}

void compareWithAlternative(double alternative_share, RegistrationResult& result) {
  result.ambiguity = alternative_share;
  if (result.status == RegistrationStatus::kConverged && alternative_share > kAmbiguousShare) {
    result.status = RegistrationStatus::kAmbiguous;
    result.reason = "a different pose fits nearly as well";
  }
}

bool isFullRank(const Matrix6d& H) {
  // Unit lengths of the tree's size make metres and radians comparable.
  Vector6d scale;
  scale << Eigen::Vector3d::Constant(0.05), Eigen::Vector3d::Ones();
  const Matrix6d scaled = scale.asDiagonal() * H * scale.asDiagonal();
  if (!scaled.allFinite()) return false;
  const Vector6d eigenvalues = eigenvaluesOfSymmetric(scaled);
  return eigenvalues[0] > 1e-10 * eigenvalues[5];
}

std::optional<Matrix6d> covarianceOf(const NormalEquations& at_solution, const std::vector<Pull>& pulls,
                                     const Pose& T_camera_centered, const Eigen::Vector3d& centroid) {
  if (!isFullRank(at_solution.H)) return std::nullopt;

  // Two residuals a point; a point of small weight counts for as much as it weighs.
  double weights = 0, max_weight = 1e-12, squares_px2 = 0;
  for (const Pull& pull : pulls) {
    weights += pull.weight.sum();
    max_weight = std::max(max_weight, pull.weight.maxCoeff());
    squares_px2 += pull.weighted_squares_px2;
  }
  const double residuals = 2 * weights / max_weight;
  const double variance_px2 = squares_px2 / std::max(1.0, residuals - 6);
  const Matrix6d about_centroid = variance_px2 * inverseOf(at_solution.H);
  return covarianceOfResult(about_centroid, T_camera_centered, centroid);
}

// R_true = R exp(w) gives dw = R w in camera axes; t_true = T (c + exp(xi)(-c)) gives dt = R (v + c x w).
Matrix6d covarianceOfResult(const Matrix6d& about_centroid, const Pose& T_camera_model,
                            const Eigen::Vector3d& centroid_model) {
  const Eigen::Matrix3d R = T_camera_model.linear();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = R;
  J.topRightCorner<3, 3>() = R * skew(centroid_model);
  return symmetric(J * about_centroid * J.transpose());
}

// w = R^T dw, v = R^T dt - c x w.
Matrix6d covarianceAboutCentroid(const Matrix6d& of_result, const Pose& T_camera_model,
                                 const Eigen::Vector3d& centroid_model) {
  const Eigen::Matrix3d Rt = T_camera_model.linear().transpose();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = Rt;
  J.topRightCorner<3, 3>() = -skew(centroid_model) * Rt;
  return symmetric(J * of_result * J.transpose());
}

}  // namespace angio::registration
