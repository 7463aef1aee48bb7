// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/io/yaml.hpp"

namespace angio {

/// Whether a covariance may leave a direction without variance.
enum class Definiteness { kPositive, kSemi };

/// A covariance as it was read from a field, made symmetric. Throws InputError that names the field when it is not
/// symmetric or not as definite as wanted, up to the rounding of files, each number in units of its own deviation.
Eigen::MatrixXd requireCovariance(const YamlField& field, const Eigen::MatrixXd& read, Definiteness wanted);

}  // namespace angio
