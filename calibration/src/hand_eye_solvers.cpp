// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye_solvers.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <random>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/decompositions.hpp"
#include "hand_eye_problem.hpp"
#include "least_squares.hpp"

namespace angio::calibration {
namespace {

// Nearer to half a turn, noise decides on which side of it a motion is: its axis has no sign.
const double kMaxTurn_rad = degToRad(170);

using Matrix9d = Eigen::Matrix<double, 9, 9>;

Eigen::Matrix3d unstacked(const Eigen::Matrix<double, 9, 1>& columns) {
  return Eigen::Map<const Eigen::Matrix3d>(columns.data());
}

// Both translations, the rotations being known: R_h t_X - t_Z = -R_h R_X t_c - t_h for all poses.
HandEyeTransforms withTranslations(const HandEyeEquations& e, const Eigen::Matrix3d& R_X, const Eigen::Matrix3d& R_Z) {
  Matrix6d A = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) {
    Eigen::Matrix<double, 3, 6> J;
    J << e.hands[i].linear(), -Eigen::Matrix3d::Identity();
    A += J.transpose() * J;
    b -= J.transpose() * (e.hands[i] * (R_X * e.cameras[i].translation()));
  }
  const Vector6d t = A.fullPivHouseholderQr().solve(b);
  HandEyeTransforms found;
  found.X.linear() = R_X;
  found.X.translation() = t.head<3>();
  found.Z.linear() = R_Z;
  found.Z.translation() = t.tail<3>();
  return found;
}

// Root mean square distance of the cameras from the object [m].
double leverOf(const HandEyeEquations& e) {
  double squares = 0;
  for (const Pose& camera : e.cameras) squares += camera.translation().squaredNorm();
  return std::sqrt(squares / static_cast<double>(e.size()));
}

// Sum of squares over those `kept` of the poses that agree best: rotations as they are [rad], translations over a
// lever.
double bestSquares(const HandEyeEquations& e, const HandEyeTransforms& t, std::size_t kept, double lever_m) {
  std::vector<double> squares;
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Pose Z = e.hands[i] * t.X * e.cameras[i];
    squares.push_back(std::pow(rotationAngle(t.Z.linear().transpose() * Z.linear()), 2) +
                      (Z.translation() - t.Z.translation()).squaredNorm() / (lever_m * lever_m));
  }
  const auto end = squares.begin() + static_cast<std::ptrdiff_t>(std::min(kept, squares.size()));
  std::partial_sort(squares.begin(), end, squares.end());
  return std::accumulate(squares.begin(), end, 0.0);
}

}  // namespace

void HandEyeEquations::add(const Pose& hand, const Pose& camera) {
  hands.push_back(hand);
  cameras.push_back(camera);
}

HandEyeEquations handEyeEquations(const PoseSet& set) {
  HandEyeEquations equations;
  for (const HandEyePose& pose : set.poses) {
    equations.add(set.setup == HandEyeSetup::kEyeInHand ? pose.T_base_hand : Pose(pose.T_base_hand.inverse()),
                  pose.T_camera_object);
  }
  return equations;
}

HandEyeTransforms solveParkMartin(const HandEyeEquations& e) {
  // log A = R_X log B for every motion A = H_j^-1 H_i, B = C_j C_i^-1; the R_X that aligns both sets of vectors.
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Vector3d alpha = logSO3(e.hands[j].linear().transpose() * e.hands[i].linear());
      const Eigen::Vector3d beta = logSO3(e.cameras[j].linear() * e.cameras[i].linear().transpose());
      if (alpha.norm() < kMaxTurn_rad) M += alpha * beta.transpose();
    }
  }
  const Eigen::Matrix3d R_X = nearestRotation(M);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) sum += e.hands[i].linear() * R_X * e.cameras[i].linear();
  return withTranslations(e, R_X, nearestRotation(sum));
}

HandEyeTransforms solveShah(const HandEyeEquations& e) {
  // vec R_X = (R_c kron R_h^T) vec R_Z for every pose (vec stacks columns).
  Matrix9d K = Matrix9d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Eigen::Matrix3d R_h = e.hands[i].linear().transpose();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) K.block<3, 3>(3 * r, 3 * c) += e.cameras[i].linear()(r, c) * R_h;
    }
  }
  const SingularValues svd = singularValuesOf(K, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d X = unstacked(svd.U.col(0)), Z = unstacked(svd.V.col(0));
  if (X.determinant() < 0) {
    X = -X;
    Z = -Z;
  }
  return withTranslations(e, nearestRotation(X), nearestRotation(Z));
}

HandEyeResiduals handEyeResiduals(const HandEyeEquations& e, const HandEyeTransforms& t) {
  HandEyeResiduals squares;
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Pose Z = e.hands[i] * t.X * e.cameras[i];
    squares.rotation_rad += std::pow(rotationAngle(t.Z.linear().transpose() * Z.linear()), 2);
    squares.translation_m += (Z.translation() - t.Z.translation()).squaredNorm();
  }
  const double count = std::max<double>(1, static_cast<double>(e.size()));
  return {std::sqrt(squares.rotation_rad / count), std::sqrt(squares.translation_m / count)};
}

HandEyeTransforms robustStart(const HandEyeEquations& e, HandEyeMount mount, const HandEyeSettings& settings) {
  constexpr std::size_t kDrawn = 4;  // One more than is needed: three poses make poor starts.
  constexpr double kTrimmed = 0.45;  // Of two machines' poses in one file, half are one's.
  const auto kept =
      std::max<std::size_t>(3, static_cast<std::size_t>(std::ceil(kTrimmed * static_cast<double>(e.size()))));
  const double lever_m = leverOf(e);
  HandEyeTransforms best;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](const HandEyeTransforms& t) {
    const double here = bestSquares(e, t, kept, lever_m);
    if (!(here < least)) return;
    least = here;
    best = t;
  };
  if (mount == HandEyeMount::kIdentity) {
    for (std::size_t i = 0; i < e.size(); ++i) consider({Pose::Identity(), e.hands[i] * e.cameras[i]});
    return best;
  }
  const auto solveOver = [&](const HandEyeEquations& some) {
    consider(solveParkMartin(some));
    consider(solveShah(some));
  };
  solveOver(e);
  if (e.size() <= kDrawn) return best;
  std::mt19937 engine(static_cast<unsigned>(settings.seed));
  std::vector<std::size_t> shuffled(e.size());
  std::iota(shuffled.begin(), shuffled.end(), std::size_t{0});
  for (int draw = 0; draw < settings.starts; ++draw) {
    HandEyeEquations few;
    for (std::size_t k = 0; k < kDrawn; ++k) {
      // std::uniform_int_distribution is not the same on every machine; the bias of a remainder is of no account here.
      std::swap(shuffled[k], shuffled[k + engine() % (shuffled.size() - k)]);
      few.add(e.hands[shuffled[k]], e.cameras[shuffled[k]]);
    }
    solveOver(few);
  }
  return best;
}

namespace {

// Units that differ are off by 10 and more; a wrong object or pixel size is off by less, and is only warned of.
constexpr double kOtherUnit = 3;
constexpr double kScaleKnown = 0.1;  // Relative standard deviation.

// Other readings must explain the poses so much better before they are believed: a wrong one is off by degrees.
constexpr double kMuchBetter = 0.2;
constexpr double kReadTrimmed = 0.6;  // Share of the poses that are looked at: some may be outliers.

std::string axisText(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d a = withPositiveLargest(axis);
  const auto rounded = [](double x) { return std::round(x * 1e3) / 1e3 + 0.0; };  // No "-0.000".
  return formatted("[%.3f, %.3f, %.3f]", rounded(a.x()), rounded(a.y()), rounded(a.z()));
}

// How far poses are from their predictions: the share of them that fits best, as an angle and a length over `lever_m`.
double misfit(const HandEyeEquations& e, double lever_m) {
  const auto kept = std::max<std::size_t>(3, static_cast<std::size_t>(kReadTrimmed * static_cast<double>(e.size())));
  double best = std::numeric_limits<double>::infinity();
  for (const auto& solve : {solveParkMartin, solveShah}) {
    best = std::min(best, std::sqrt(bestSquares(e, solve(e), kept, lever_m) / static_cast<double>(kept)));
  }
  return best;
}

Pose turnedBack(const Pose& T) {
  Pose transposed = T;
  transposed.linear() = T.linear().transpose();
  return transposed;
}

Pose mirrored(const Pose& T) {
  const Eigen::DiagonalMatrix<double, 3> flip(-1, 1, 1);
  Pose M = Pose::Identity();
  M.linear() = flip * T.linear() * flip;
  M.translation() = flip * T.translation();
  return M;
}

}  // namespace

MotionSpread motionSpread(const HandEyeEquations& e) {
  MotionSpread spread;
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  double pairs = 0;
  for (std::size_t i = 0; i < e.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Vector3d w = logSO3(e.hands[j].linear().transpose() * e.hands[i].linear());
      const double angle = w.norm();
      spread.max_turn_rad = std::max(spread.max_turn_rad, angle);
      if (angle > 0) M += std::pow(2 * std::sin(angle / 2) / angle, 2) * w * w.transpose();
      ++pairs;
    }
  }
  if (pairs == 0) return spread;
  // In the axes of the hand at pose j, so of all poses: what all of them share is an axis fixed in the hand. X maps to
  // the hand's axes; motions H_j^-1 H_i are A of AX = XB.
  const SymmetricEigen3 axes = eigenOfSymmetric(M / pairs);
  spread.main_axis = axes.vectors.col(2);
  spread.along_rad = std::sqrt(std::max(0.0, axes.values[2]));
  spread.across_rad = std::sqrt(std::max(0.0, axes.values[1]));
  return spread;
}

Eigen::Vector3d withPositiveLargest(const Eigen::Vector3d& axis) {
  Eigen::Index largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  return axis[largest] < 0 ? Eigen::Vector3d(-axis) : axis;
}

void requireMotions(const std::string& place, HandEyeSetup setup, const MotionSpread& spread, std::size_t poses,
                    double min_turn_rad) {
  const bool in_hand = setup == HandEyeSetup::kEyeInHand;
  const std::string frame = in_hand ? "the hand's axes" : "the base's axes";
  const std::string X = in_hand ? "the camera on the hand" : "the camera in the base's frame";
  if (poses < 3) {
    throw InputError(place, "poses", std::to_string(poses),
                     "must be at least 3, which turn about two axes, to know where " + X + " is");
  }
  if (spread.along_rad < min_turn_rad) {
    throw InputError(
        place, "poses", formatted("turns of at most %.2g deg", radToDeg(spread.max_turn_rad)),
        "translations alone leave the place of " + X + " open in all three directions: turn the hand about two axes");
  }
  if (spread.across_rad < min_turn_rad) {
    throw InputError(place, "poses", "all motions turn about one axis, " + axisText(spread.main_axis) + " in " + frame,
                     "the translation of " + X +
                         " along it stays open, and its turn about it nearly so (turns about "
                         "other axes: " +
                         formatted("%.2g deg rms, wanted %.2g", radToDeg(spread.across_rad), radToDeg(min_turn_rad)) +
                         "): turn the hand about a second axis");
  }
}

std::optional<TranslationScale> translationScale(const HandEyeEquations& e) {
  // R_h t_X - t_Z + s R_h R_X t_c = -t_h for all poses.
  const Eigen::Matrix3d R_X = solveParkMartin(e).X.linear();
  const auto rows = static_cast<Eigen::Index>(3 * e.size());
  Eigen::MatrixXd A(rows, 7);
  Eigen::VectorXd b(rows);
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Eigen::Matrix3d& R_h = e.hands[i].linear();
    const auto row = static_cast<Eigen::Index>(3 * i);
    A.block<3, 3>(row, 0) = R_h;
    A.block<3, 3>(row, 3) = -Eigen::Matrix3d::Identity();
    A.block<3, 1>(row, 6) = R_h * R_X * e.cameras[i].translation();
    b.segment<3>(row) = -e.hands[i].translation();
  }
  if (rows < 9) return std::nullopt;
  const double column = A.col(6).norm();
  A.col(6) /= column;
  const SingularValues svd = singularValuesOf(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  if (!(svd.values[6] > 1e-9 * svd.values[0])) return std::nullopt;
  const Eigen::VectorXd solution = svd.V * (svd.U.transpose() * b).cwiseQuotient(svd.values);
  const double variance = (A * solution - b).squaredNorm() / static_cast<double>(rows - 7);
  const Eigen::VectorXd last = svd.V.row(6).transpose().cwiseQuotient(svd.values);
  const TranslationScale scale{solution[6] / column, std::sqrt(variance) * last.norm() / column};
  if (!(scale.sigma < kScaleKnown * std::abs(scale.value))) return std::nullopt;
  return scale;
}

void requireConventions(const std::string& place, HandEyeSetup setup, const HandEyeEquations& e) {
  const double lever_m = leverOf(e);
  if (const auto scale = translationScale(e)) {
    const double factor = std::max(scale->value, 1 / scale->value);
    if (scale->value > 0 && factor > kOtherUnit) {
      throw InputError(place, "translation_mm",
                       formatted("the camera's translations fit the hands' when they are multiplied by %.4g +- %.2g",
                                 scale->value, scale->sigma),
                       "both must be in millimetres");
    }
  }
  using Reading = std::function<Pose(const Pose&)>;
  const Reading as_it_is = [](const Pose& T) { return T; };
  const Reading inverse = [](const Pose& T) { return Pose(T.inverse()); };
  const bool in_hand = setup == HandEyeSetup::kEyeInHand;
  const struct {
    std::string name;
    Reading hand, camera;
  } readings[] = {
      // Either inverse is the same equation with X and Z in each other's place.
      {std::string("T_base_hand or T_camera_object is taken as its inverse, or setup as ") +
           (in_hand ? "eye_to_hand" : "eye_in_hand"),
       inverse, as_it_is},
      {"T_base_hand.rotation is transposed", turnedBack, as_it_is},
      {"T_camera_object.rotation is transposed", as_it_is, turnedBack},
      {"both rotations are transposed", turnedBack, turnedBack},
      {"the camera's image is mirrored", as_it_is, mirrored},
  };
  if (e.size() < 4) return;  // Three poses nearly fit anything.
  const double given = misfit(e, lever_m);
  for (const auto& reading : readings) {
    HandEyeEquations other;
    for (std::size_t i = 0; i < e.size(); ++i) {
      // T_hand_base stands in the equations of the other setup; its transposed rotation is T_base_hand's.
      const Pose hand = in_hand ? reading.hand(e.hands[i]) : Pose(reading.hand(e.hands[i].inverse()).inverse());
      other.add(hand, reading.camera(e.cameras[i]));
    }
    const double then = misfit(other, lever_m);
    if (then < kMuchBetter * given) {
      throw InputError(
          place, "poses",
          formatted("fit to %.2g deg and not to %.2g deg", radToDeg(then), radToDeg(given)) + " when " + reading.name,
          "must be as the file's description says");
    }
  }
}

}  // namespace angio::calibration
