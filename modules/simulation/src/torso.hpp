// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/tubes/tubes.hpp"
#include "shapes.hpp"

namespace angio::simulation {

/// A round bone of changing course: tubes of cortical bone with marrow inside.
struct LongBones {
  std::vector<Tube> bone, marrow;
};

/// A body in axes L, P, S [m], around the point of it where a vessel tree of the region has its centroid.
struct Body {
  std::vector<Tissue> tissues;
  LongBones bones;
};

/// The trunk of an adult of average size: soft tissue, spine, ribs, lungs over the domes of the diaphragm, heart, and
/// bowel gas in places that `seed` draws; nothing for region `none`. Sizes are those of anatomy books, rounded;
/// attenuation is for the mean energy behind a patient, 60 keV (ICRU 44: water 20.6, cortical bone 60, lung 5.4 per
/// metre).
Body bodyAround(const AnatomySettings& settings, std::uint64_t seed);

constexpr double kMarrowOverBone = -0.75;  ///< Marrow's attenuation above bone's, as a part of bone's above water's.
constexpr double kBoneAttenuation_per_m = 32;  ///< Cortical bone above water.

}  // namespace angio::simulation
