// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/deformation.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Loss of the distance of a projected point from the image's centreline.
enum class DistanceLoss { kHuber, kL2 };

/// DT-ICP: Rivest-Henault, Sundar and Cheriet (IEEE TMI 31(8), 2012) in the variant that the Iterative PnP paper
/// compares with.
struct DtIcpSettings {
  static constexpr const char* kName = "dt_icp";

  Deformation deformation = Deformation::kRigid;
  DistanceLoss loss = DistanceLoss::kHuber;
  double huber_px = 3;  ///< As `iterative_pnp` has it; the paper does not say.

  void visit(SettingsVisitor& v) {
    v.choice("deformation", deformation, {"rigid", "nonrigid"}, "Whether the tree may deform");
    v.choice("loss", loss, {"huber", "l2"}, "Loss of the distance of a projected point from the image's centreline");
    v.number("huber_px", huber_px, 1e-3, 1e3, "Where Huber's loss turns linear; used with loss huber only");
  }
};

}  // namespace angio::registration
