// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/command_receiver.hpp"

namespace angio::simulation {
namespace {

constexpr std::int64_t kMaxValidityUs = 1'000'000;

}  // namespace

CommandReceiver::CommandReceiver(const ReceiverSettings& settings) : settings_(settings) {
  checkSettings("receiver of commands", settings);
}

bool CommandReceiver::takes(std::int64_t time_us, std::int64_t sequence, std::int64_t valid_for_us,
                            const Eigen::Ref<const Eigen::VectorXd>& speeds, std::int64_t now_us) {
  // A lower sequence is newer only with a later time: then its sender has started again, and must not go unheard for
  // ever.
  const bool newer = sequence > last_sequence_ || (sequence < last_sequence_ && time_us > last_time_us_);
  const double age_ms = 1e-3 * (static_cast<double>(now_us) - static_cast<double>(time_us));
  const bool of_now = age_ms <= settings_.max_command_age_ms && age_ms >= -settings_.max_command_lead_ms;
  if (!speeds.allFinite()) {
    ++ignored_.not_finite;
  } else if (valid_for_us <= 0 || valid_for_us > kMaxValidityUs) {
    ++ignored_.bad_validity;
  } else if (commanded_ && !newer) {
    ++ignored_.out_of_sequence;
  } else if (!of_now && !speeds.isZero(0)) {
    ++ignored_.too_old;
  } else if (speeds.cwiseAbs().maxCoeff() > settings_.max_overspeed) {
    ++ignored_.wrong_unit;  // Cut to the limits it would be full speed, in a direction that nobody meant.
  } else {
    commanded_ = true;
    last_sequence_ = sequence;
    last_time_us_ = time_us;
    return true;
  }
  return false;
}

}  // namespace angio::simulation
