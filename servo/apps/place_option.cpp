// SPDX-License-Identifier: GPL-2.0-or-later
#include "place_option.hpp"

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"

namespace angio::apps {

TreeLocation placeOf(const TreeTopology& map, const std::string& name, int branch, double mm) {
  if (branch < 0 || branch >= map.chains()) {
    throw InputError("--" + name + "-branch", "", std::to_string(branch),
                     "must be one of the tree's " + std::to_string(map.chains()) + " branches, from 0 on");
  }
  requireBetween("--" + name + "-mm", "of branch " + std::to_string(branch), mm, 0, 1e3 * map.length_m(branch));
  return {branch, 1e-3 * mm};
}

}  // namespace angio::apps
