// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/calibration/anatomy_registration.hpp"

namespace angio::calibration {

/// Names of the runs in the order of their first views, and each view's run by its number.
struct AnatomyRuns {
  std::vector<std::string> names;
  std::vector<std::size_t> of_view;

  explicit AnatomyRuns(const std::vector<AnatomyView>& views);
};

/// T_dsa_cb and the shift of each run [m].
struct AnatomyState {
  Pose T_dsa_cb = Pose::Identity();
  std::vector<Eigen::Vector3d> shifts_m;

  Pose predicted(const AnatomyView& view, std::size_t run) const {
    return view.T_camera_patient * Eigen::Translation3d(shifts_m[run]) * T_dsa_cb;
  }
};

/// Fills what a result says from where an estimate stands; `covariance` is of [T_dsa_cb; shifts].
AnatomyResult anatomyResult(const AnatomyState& state, const AnatomyRuns& runs, const Eigen::MatrixXd& covariance);

}  // namespace angio::calibration
