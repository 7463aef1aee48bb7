// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "angio/registration/oriented_kernel_settings.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "field_step.hpp"
#include "kernel_field.hpp"

namespace angio::registration {

/// Scales of the kernel fields, coarse to fine [px].
constexpr std::array<double, 3> kFieldScales_px = {32, 16, 8};
constexpr int kFieldScales = static_cast<int>(kFieldScales_px.size());

/// The image side of a registration: what is computed once per frame, for all of its views. Fields are built when they
/// are first asked for. Memory is kept from frame to frame.
class OrientedFrame {
 public:
  /// Borrows the views until the next call.
  void begin(const XrayViews& views, const OrientedKernelSettings& settings);

  const XrayViews& views() const { return *views_; }
  std::size_t viewCount() const { return views_->size(); }
  const OrientedPoints& points(std::size_t view) const { return images_[view].points; }
  const std::vector<HalfPlane>& fieldOfView(std::size_t view) const { return images_[view].field_of_view; }
  const KernelField& field(std::size_t view, int scale);

  int pointCount() const { return point_count_; }  ///< Of all views.
  double length_px() const { return length_px_; }  ///< Of all centrelines.
  /// The same by chords of 12 px: the zigzag of noise lengthens lines, not chords. Found when first asked for.
  double chordLength_px();

 private:
  struct Image {
    OrientedPoints points, thin;
    std::array<KernelField, kFieldScales> field;
    std::array<bool, kFieldScales> built;
    std::vector<HalfPlane> field_of_view;
  };
  const XrayViews* views_ = nullptr;
  std::vector<Image> images_;
  int point_count_ = 0;
  double length_px_ = 0;
  std::optional<double> chord_length_px_;
};

/// Brings a centreline into oriented points, none further apart than `spacing_px` along a branch and at most about
/// `max_points`. The mass of points without order is found from how dense they are. The order in which branches, or
/// points without order, are given does not matter. `to` is overwritten, its memory kept.
void orientedPoints(const Centerline2d& centerline, double spacing_px, int max_points, OrientedPoints& to);

/// About every `stride`-th point of each branch, at least one, with the mass of those left out. `to` is overwritten,
/// its memory kept.
void thinned(const OrientedPoints& points, int stride, OrientedPoints& to);

}  // namespace angio::registration
