// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/apps/namespace.hpp"
#include "angio/evaluation/film_writer.hpp"
#include "angio/evaluation/live_overlay.hpp"
#include "angio/experiments/navigate_experiment.hpp"

namespace angio::apps {

/// A journey of a catheter as a film, three times as fast as it was: the X-ray with the registered tree, what is seen
/// of the catheter, where its tip is believed, the target, and what the navigator does.
class NavigateFilm {
 public:
  /// Throws InputError as FilmWriter does. Borrows the tree.
  NavigateFilm(const std::string& path, const VesselTree& tree, const TreeLocation& target, double frame_rate_hz);

  void show(const NavigateMoment& moment);
  void finish() { film_.finish(); }

 private:
  FilmWriter film_;
  ModelId model_id_;
  LiveOverlay overlay_;
  Eigen::Vector3d target_;
  int frames_ = 0;
};

}  // namespace angio::apps
