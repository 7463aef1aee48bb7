// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/registration.hpp"

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/base/variant_sections.hpp"
#include "angio/registration/xray_view.hpp"
#include "image_needed.hpp"
#include "methods.hpp"

namespace angio::registration {
namespace {

struct Preset {
  std::string name;
  RegistrationSettings settings;
  int starts;
};

const std::vector<Preset>& presets() {
  using Pnp = IterativePnpSettings;
  Pnp huber = Pnp::asInThePaper(), squares = huber;
  huber.kernel = Kernel::kHuber;
  squares.kernel = Kernel::kL2;
  const std::string name = Pnp::kName;
  NicpSettings nicp;
  nicp.first_scale_px = NicpSettings::in_plane_above_px;  // The whole pose moves at every scale.
  CvoSettings cvo;
  cvo.objective = CvoObjective::kInnerProduct;
  DtIcpSettings dt_icp;
  dt_icp.loss = DistanceLoss::kL2;
  static const std::vector<Preset> kPresets = {{name + ":paper", Pnp::asInThePaper(), 0},
                                               {name + ":huber", huber, 0},
                                               {name + ":l2", squares, 0},
                                               {name + ":best", Pnp::atItsBest(), Pnp::kBestStarts},
                                               {std::string(NicpSettings::kName) + ":source", nicp, 0},
                                               {std::string(CvoSettings::kName) + ":source", cvo, 0},
                                               {std::string(DtIcpSettings::kName) + ":l2", dt_icp, 0}};
  return kPresets;
}

}  // namespace

std::unique_ptr<Registration> makeRegistration(const RegistrationSettings& settings, const VesselTree& tree) {
  return madeOf(settings, [&](const auto& chosen) { return make(chosen, tree); });
}

RegistrationSettings registrationSettingsNamed(const std::string& name) {
  for (const Preset& preset : presets()) {
    if (name == preset.name) return preset.settings;
  }
  if (isPreset(name)) {
    std::vector<std::string> names;
    for (const Preset& preset : presets()) names.push_back(preset.name);
    throw InputError("", "method", name, "must be one of the presets " + joined(names));
  }
  return VariantSections<RegistrationSettings>("method", {}, "").named(name);
}

bool isPreset(const std::string& name) { return name.find(':') != std::string::npos; }

int startsOfPreset(const std::string& name) {
  for (const Preset& preset : presets()) {
    if (name == preset.name) return preset.starts;
  }
  return 0;
}

std::string methodName(const RegistrationSettings& settings) {
  return std::visit([](const auto& chosen) -> std::string { return chosen.kName; }, settings);
}

bool setDeformation(RegistrationSettings& settings, Deformation deformation) {
  return std::visit(
      [&](auto& chosen) {
        if constexpr (CanDeform<std::decay_t<decltype(chosen)>>::value) {
          chosen.deformation = deformation;
          return true;
        } else {
          return deformation == Deformation::kRigid;
        }
      },
      settings);
}

bool imageNeeded(const RegistrationSettings& settings) {
  return std::visit([](const auto& chosen) { return NeedsImage<std::decay_t<decltype(chosen)>>::value; }, settings);
}

std::string statusName(RegistrationStatus status) {
  constexpr const char* kNames[] = {"converged", "ambiguous", "diverged", "too_few_points"};
  return kNames[static_cast<int>(status)];
}

std::string priorName(PriorInForce prior) {
  constexpr const char* kNames[] = {"lambda", "covariance of the settings", "covariance given with the start", "none"};
  return kNames[static_cast<int>(prior)];
}

bool XrayView::sees(const Eigen::Vector2d& pixel) const {
  if (!camera.sees(pixel)) return false;
  // Inside a convex polygon every edge has the point on the same side, whichever way round the corners go.
  bool left = true, right = true;
  for (std::size_t i = 0; i < collimator_px.size(); ++i) {
    const Eigen::Vector2d a = collimator_px[i], edge = collimator_px[(i + 1) % collimator_px.size()] - a;
    const double side = edge.x() * (pixel.y() - a.y()) - edge.y() * (pixel.x() - a.x());
    left = left && side >= 0;
    right = right && side <= 0;
  }
  return left || right;
}

}  // namespace angio::registration
