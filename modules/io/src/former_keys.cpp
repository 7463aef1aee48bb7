// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/former_keys.hpp"

#include <algorithm>

namespace angio {
namespace {

// Whether an entry of the table, "ridge.sigma" or "sigma", means a key of these sections.
bool means(const std::string& entry, const std::vector<std::string>& sections, const std::string& key) {
  std::string path;
  for (const std::string& section : sections) path += "." + section;
  path += "." + key;
  const std::string end = "." + entry;
  return path.size() >= end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

bool FormerKeys::isConstant(const std::vector<std::string>& sections, const std::string& key) const {
  return std::any_of(constants.begin(), constants.end(),
                     [&](const std::string& entry) { return means(entry, sections, key); });
}

std::optional<std::string> FormerKeys::nameNow(const std::vector<std::string>& sections, const std::string& key,
                                               const std::vector<std::string>& known) const {
  const auto isKnown = [&](const std::string& name) {
    return std::find(known.begin(), known.end(), name) != known.end();
  };
  for (const Renamed& entry : renamed) {
    if (means(entry.former, sections, key) && isKnown(entry.key)) return entry.key;
  }
  for (const Prefix& entry : prefixes) {
    if (key.compare(0, entry.former.size(), entry.former) != 0) continue;
    const std::string name = entry.prefix + key.substr(entry.former.size());
    if (isKnown(name)) return name;
  }
  return std::nullopt;
}

const FormerKeys& formerKeys() {
  static const FormerKeys table = {
      // Constants.
      {"acceleration_mean_s",
       "acceleration_std_mm_s2",
       "ahead_mm",
       "aim_mm",
       "along_std_mm",
       "along_stiffness",
       "amplitude_memory_s",
       "angle_deg",
       "angular_acceleration_std_deg_s2",
       "back_mm",
       "background_px",
       "background_structure_mm",
       "backlash_mm",
       "behind_mm",
       "braking_share",
       "breathing_harmonics",
       "breaths_to_learn",
       "clearly_better",
       "clock_drift_ppm",
       "cone_deg",
       "confirm_mm",
       "contact_force_n",
       "correlation_px",
       "dead_band_deg",
       "deformation_length_mm",
       "depth_std_mm",
       "diameter_factor",
       "dispersion",
       "disturbed_s",
       "drag_n_per_m",
       "drift_std_mm_s",
       "effort",
       "evidence",
       "faintest_absorption",
       "fallen_share",
       "first_angular_speed_std_deg_s",
       "first_speed_std_mm_s",
       "flex_std_deg",
       "flex_std_mm",
       "forgotten_deg_s",
       "forgotten_mm_s",
       "forgotten_share",
       "forward_mm",
       "frames_between_searches",
       "frames_to_resume",
       "gate",
       "halve_every",
       "heart_harmonics",
       "held_out_every",
       "hysteresis",
       "into_branch_mm",
       "judged_horizon_ms",
       "judged_over_s",
       "jump_probability",
       "largest_focal_sigma",
       "largest_misfit",
       "largest_offset_deg",
       "largest_offset_mm",
       "largest_outlier_share",
       "largest_sigma_mm",
       "largest_step_deg",
       "largest_stretch",
       "largest_turn_deg",
       "learn_s",
       "least_acceleration",
       "least_acceleration_deg_s2",
       "least_acceleration_mm_s2",
       "least_contrast",
       "least_contrast_to_noise",
       "least_probability",
       "least_radius_mm",
       "least_share",
       "least_significance",
       "least_turn_deg",
       "lever_mm",
       "limit_margin_deg",
       "limit_margin_mm",
       "line_factor",
       "local_length_mm",
       "local_std_mm",
       "longest_gap_px",
       "longest_gap_s",
       "longest_horizon_ms",
       "look_sigma_deg",
       "lost_px",
       "marker_ratio",
       "max_iterations",
       "measured_rotation_std_deg",
       "measured_std_mm",
       "measured_translation_std_mm",
       "memory_frames",
       "model_std_px",
       "most_modes",
       "most_overspeed",
       "most_points",
       "most_points_2d",
       "most_shift_error_mm",
       "most_turn_deg",
       "near_mm",
       "near_std_mm",
       "node_mm",
       "noise_factor",
       "nonrigid_first_scale_px",
       "offset_walk_mm",
       "opacity_factor",
       "other_deg",
       "outlier_gate",
       "outlier_mass",
       "outlier_px",
       "outlier_sigma",
       "outlier_sigmas",
       "outlier_view_factor",
       "overlap_weight",
       "patience_s",
       "periods_ahead",
       "pixel_std_px",
       "pose_scatter_deg",
       "pose_scatter_mm",
       "prior_length_unit",
       "prior_widening",
       "reach_mm",
       "reached_frames",
       "recovery_s",
       "relative_contrast",
       "relative_density",
       "renew_mm",
       "retreat_mm",
       "roadmap_patience_s",
       "roll_std_deg",
       "rotation_step_deg",
       "rounds",
       "samples",
       "scale_std_percent",
       "scales",
       "scatter_sigma_mm",
       "segment_points",
       "sharpness",
       "shift_time_s",
       "short_mm",
       "shortest_branch_radii",
       "shortest_curve_px",
       "shortest_line_px",
       "shortest_piece_px",
       "shortest_px",
       "slack_mm",
       "slack_mm_per_rad",
       "slip_std",
       "slow_mm",
       "smoothing_mm",
       "smoothing_radii",
       "sound_s",
       "speed_std_mm_s",
       "stall_mm",
       "start_std_mm",
       "step_deg",
       "step_px",
       "stiffness_n_per_m",
       "sure_mm",
       "tip_std_px",
       "tip_stiffness_n_per_rad",
       "tracking_rotation_std_deg",
       "tracking_translation_std_mm",
       "turn_weight",
       "uniformity",
       "unknown_radius_mm",
       "unwind_mm",
       "view_within_deg",
       "view_within_mm",
       "washed_out_frames",
       "wind_up_deg_per_m"},
      // Renamed.
      {},
      // Prefixes.
      {{"most_", "max_"},
       {"largest_", "max_"},
       {"longest_", "max_"},
       {"furthest_", "max_"},
       {"least_", "min_"},
       {"shortest_", "min_"}},
  };
  return table;
}

}  // namespace angio
