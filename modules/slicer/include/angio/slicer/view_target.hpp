// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "angio/geometry/carm.hpp"
#include "angio/slicer/namespace.hpp"

namespace angio::slicer {

/// A view that somebody asks for; what is left out stays as it is.
struct ViewTarget {
  std::optional<ViewAngles> angles;             ///< Of the anatomy.
  std::optional<Eigen::Vector3d> target_lps_m;  ///< The point that belongs at the isocentre, tree's frame.
};

/// Reads "lao_deg 30 cra_deg 15 r_mm 12 a_mm -3 s_mm 40": words and numbers in any order, both angles or none, all
/// three coordinates or none, one of both at least. rao_deg and cau_deg, l_mm, p_mm and i_mm are the other ways round.
/// Or one line that says what is wrong.
std::variant<ViewTarget, std::string> readViewTarget(const std::string& text);

}  // namespace angio::slicer
