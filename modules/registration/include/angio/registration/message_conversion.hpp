// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/result.hpp"
#include "angio/types/registration_message.hpp"

namespace angio::registration {

/// What a registration says of a frame, for the bus. A pose, covariance or residual that is not finite is left at
/// identity and zero; its status is then not "converged".
RegistrationMessage registrationMessage(const RegistrationResult& seen, ModelId model_id, std::int64_t frame_time_us,
                                        std::int64_t frame_sequence);

/// The inverse, as far as a message goes: without alignment score, ambiguity and displacements; without a covariance
/// where the message has zero for it.
RegistrationResult registrationResult(const RegistrationMessage& message);

}  // namespace angio::registration
