// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/registration.hpp"

#include "angio/base/errors.hpp"
#include "iterative_pnp.hpp"
#include "oriented_kernel.hpp"

namespace angio::registration {
namespace {

template <std::size_t I = 0>
RegistrationSettings named(const std::string& name, const std::string& known = "") {
  if constexpr (I == std::variant_size_v<RegistrationSettings>) {
    throw InputError("", "method", name, "must be one of: " + known);
  } else {
    using Settings = std::variant_alternative_t<I, RegistrationSettings>;
    if (name == Settings::kName) return Settings{};
    return named<I + 1>(name, known + (known.empty() ? "" : ", ") + Settings::kName);
  }
}

}  // namespace

std::unique_ptr<Registration> makeRegistration(const RegistrationSettings& settings, const VesselTree& tree) {
  return std::visit([&](const auto& chosen) { return make(chosen, tree); }, settings);
}

RegistrationSettings registrationSettingsNamed(const std::string& name) { return named(name); }

std::string methodName(const RegistrationSettings& settings) {
  return std::visit([](const auto& chosen) -> std::string { return chosen.kName; }, settings);
}

std::string statusName(RegistrationStatus status) {
  switch (status) {
    case RegistrationStatus::kConverged:
      return "converged";
    case RegistrationStatus::kAmbiguous:
      return "ambiguous";
    case RegistrationStatus::kDiverged:
      return "diverged";
    case RegistrationStatus::kTooFewPoints:
      break;
  }
  return "too_few_points";
}

}  // namespace angio::registration
