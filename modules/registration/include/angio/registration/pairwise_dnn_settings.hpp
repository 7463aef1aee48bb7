// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Pairwise DNN: a convolutional network says from a picture of the X-ray image and one of the tree how the tree has to
/// move, again and again. Source: Zheng, Miao, Wang and Liao, "Pairwise domain adaptation module for CNN-based 2-D/3-D
/// registration", Journal of Medical Imaging 5 (2018). The network is ours, trained on simulated X-rays of trees that
/// stand in no other place of the project (modules/registration/training).
struct PairwiseDnnSettings {
  static constexpr const char* kName = "pairwise_dnn";
  static constexpr bool kNeedsImage = true;

  static constexpr int max_iterations = 20;
  // Of branches whose radius the tree does not know.
  static constexpr double end_radius_mm = 0.6;

  void visit(SettingsVisitor&) {}
};

}  // namespace angio::registration
