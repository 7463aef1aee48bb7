// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/any_message.hpp"

#include <angio_lcm/carm_command_t.hpp>
#include <angio_lcm/carm_state_t.hpp>
#include <angio_lcm/catheter_command_t.hpp>
#include <angio_lcm/catheter_input_t.hpp>
#include <angio_lcm/catheter_state_t.hpp>
#include <angio_lcm/catheter_tip_t.hpp>
#include <angio_lcm/registration_t.hpp>
#include <angio_lcm/servo_input_t.hpp>
#include <angio_lcm/servo_request_t.hpp>
#include <angio_lcm/servo_status_t.hpp>
#include <angio_lcm/xray_frame_t.hpp>
#include <iterator>

#include "angio/messaging/mailbox.hpp"

namespace angio {
namespace {

struct Entry {
  const char* type;
  std::int64_t fingerprint;
  Decoded<AnyMessage> (*read)(const std::uint8_t* data, std::size_t size);
};

template <typename T, typename Wire>
Entry entry() {
  return {Wire::getTypeName(), Wire::getHash(), [](const std::uint8_t* data, std::size_t size) {
            Decoded<T> decoded = decode<T>(data, size);
            Decoded<AnyMessage> any;
            if (decoded.value) any.value.emplace(std::move(*decoded.value));
            any.error = std::move(decoded.error);
            return any;
          }};
}

const Entry* find(const std::uint8_t* data, std::size_t size) {
  static const Entry kEntries[] = {entry<XrayFrame, angio_lcm::xray_frame_t>(),
                                   entry<CArmState, angio_lcm::carm_state_t>(),
                                   entry<ServoInput, angio_lcm::servo_input_t>(),
                                   entry<CArmCommand, angio_lcm::carm_command_t>(),
                                   entry<RegistrationMessage, angio_lcm::registration_t>(),
                                   entry<ServoStatus, angio_lcm::servo_status_t>(),
                                   entry<ServoRequest, angio_lcm::servo_request_t>(),
                                   entry<CatheterState, angio_lcm::catheter_state_t>(),
                                   entry<CatheterCommand, angio_lcm::catheter_command_t>(),
                                   entry<CatheterTip, angio_lcm::catheter_tip_t>(),
                                   entry<CatheterInput, angio_lcm::catheter_input_t>()};
  static_assert(std::size(kEntries) == std::variant_size_v<AnyMessage>, "a message is missing");
  if (size < 8) return nullptr;
  std::uint64_t fingerprint = 0;
  for (int i = 0; i < 8; ++i) fingerprint = fingerprint << 8 | data[i];
  for (const Entry& known : kEntries) {
    if (static_cast<std::uint64_t>(known.fingerprint) == fingerprint) return &known;
  }
  return nullptr;
}

}  // namespace

std::optional<std::string> messageType(const std::uint8_t* data, std::size_t size) {
  const Entry* known = find(data, size);
  return known ? std::optional<std::string>(known->type) : std::nullopt;
}

Decoded<AnyMessage> decodeAny(const std::uint8_t* data, std::size_t size) {
  if (const Entry* known = find(data, size)) return known->read(data, size);
  return {std::nullopt, "its fingerprint is that of no type we know"};
}

std::int64_t timeOf(const AnyMessage& message) {
  return std::visit([](const auto& m) { return m.time_us; }, message);
}

std::int64_t sequenceOf(const AnyMessage& message) {
  return std::visit([](const auto& m) { return sequenceOf(m); }, message);
}

}  // namespace angio
