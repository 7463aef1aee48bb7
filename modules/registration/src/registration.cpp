// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/registration.hpp"

#include "angio/base/variant_sections.hpp"
#include "angio/registration/xray_view.hpp"
#include "methods.hpp"

namespace angio::registration {

std::unique_ptr<Registration> makeRegistration(const RegistrationSettings& settings, const VesselTree& tree) {
  return madeOf(settings, [&](const auto& chosen) { return make(chosen, tree); });
}

RegistrationSettings registrationSettingsNamed(const std::string& name) {
  return VariantSections<RegistrationSettings>("method", {}, "").named(name);
}

std::string methodName(const RegistrationSettings& settings) {
  return std::visit([](const auto& chosen) -> std::string { return chosen.kName; }, settings);
}

std::string statusName(RegistrationStatus status) {
  constexpr const char* kNames[] = {"converged", "ambiguous", "diverged", "too_few_points"};
  return kNames[static_cast<int>(status)];
}

std::string priorName(PriorInForce prior) {
  constexpr const char* kNames[] = {"lambda", "covariance of the settings", "covariance given with the start"};
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
