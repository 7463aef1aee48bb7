// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>
#include <vector>

#include "angio/calibration/anatomy_registration.hpp"

namespace angio::calibration {

/// Names of the runs in the order of their first views, and each view's run by its number.
struct AnatomyRuns {
  std::vector<std::string> names;
  std::vector<std::size_t> of_view;

  explicit AnatomyRuns(const std::vector<AnatomyView>& views) {
    for (const AnatomyView& view : views) {
      const auto at = std::find(names.begin(), names.end(), view.run);
      of_view.push_back(static_cast<std::size_t>(at - names.begin()));
      if (at == names.end()) names.push_back(view.run);
    }
  }
};

/// Where the shift of a run stands among an estimate's numbers, behind [dt; dw] of T_dsa_cb.
inline Eigen::Index shiftAt(std::size_t run) { return static_cast<Eigen::Index>(6 + 3 * run); }

/// T_dsa_cb and the shift of each run [m].
struct AnatomyEstimate {
  Pose T_dsa_cb = Pose::Identity();
  std::vector<Eigen::Vector3d> shifts_m;

  Pose predicted(const AnatomyView& view, std::size_t run) const {
    return view.T_camera_patient * Eigen::Translation3d(shifts_m[run]) * T_dsa_cb;
  }

  void move(const Eigen::VectorXd& step) {
    T_dsa_cb.translation() += step.head<3>();
    T_dsa_cb.linear() = expSO3(step.segment<3>(3)) * T_dsa_cb.linear();
    for (std::size_t r = 0; r < shifts_m.size(); ++r) shifts_m[r] += step.segment<3>(shiftAt(r));
  }

  void addShiftPriors(const AnatomyRegistrationSettings& settings, Eigen::MatrixXd& A, Eigen::VectorXd& b) const {
    constexpr double kMinShift_m = 1e-6;  // What a shift that is none may be.
    const double std_m = std::max(kMinShift_m, 1e-3 * settings.shift_std_mm);
    for (std::size_t r = 0; r < shifts_m.size(); ++r) {
      A.diagonal().segment<3>(shiftAt(r)).array() += 1 / (std_m * std_m);
      b.segment<3>(shiftAt(r)) -= shifts_m[r] / (std_m * std_m);
    }
  }

  /// `covariance` is of all numbers, those of the shifts behind the first six.
  AnatomyResult result(const AnatomyRuns& runs, const Eigen::MatrixXd& covariance) const {
    AnatomyResult result;
    result.T_dsa_cb = T_dsa_cb;
    result.covariance = covariance.topLeftCorner<6, 6>();
    for (std::size_t r = 0; r < runs.names.size(); ++r) {
      result.runs.push_back({runs.names[r], shifts_m[r], covariance.block<3, 3>(shiftAt(r), shiftAt(r))});
    }
    return result;
  }
};

}  // namespace angio::calibration
