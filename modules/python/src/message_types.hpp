// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/messaging/mailbox.hpp"
#include "binding.hpp"

namespace angio::python {

/// Names a type of message.
template <typename T>
struct MessageTag {
  using Message = T;
};

/// What Python calls each message: the name of its struct.
template <typename T>
std::string nameOfMessage();
template <>
inline std::string nameOfMessage<XrayFrame>() {
  return "XrayFrame";
}
template <>
inline std::string nameOfMessage<CArmState>() {
  return "CArmState";
}
template <>
inline std::string nameOfMessage<ServoInput>() {
  return "ServoInput";
}
template <>
inline std::string nameOfMessage<CArmCommand>() {
  return "CArmCommand";
}
template <>
inline std::string nameOfMessage<RegistrationMessage>() {
  return "RegistrationMessage";
}
template <>
inline std::string nameOfMessage<ServoStatus>() {
  return "ServoStatus";
}
template <>
inline std::string nameOfMessage<ServoRequest>() {
  return "ServoRequest";
}
template <>
inline std::string nameOfMessage<CatheterState>() {
  return "CatheterState";
}
template <>
inline std::string nameOfMessage<CatheterCommand>() {
  return "CatheterCommand";
}
template <>
inline std::string nameOfMessage<CatheterTip>() {
  return "CatheterTip";
}
template <>
inline std::string nameOfMessage<CatheterInput>() {
  return "CatheterInput";
}
template <>
inline std::string nameOfMessage<ViewRequest>() {
  return "ViewRequest";
}
template <>
inline std::string nameOfMessage<ServoSession>() {
  return "ServoSession";
}
template <>
inline std::string nameOfMessage<RegistrationPoints>() {
  return "RegistrationPoints";
}

namespace detail {
template <typename Work, typename... T>
void forEach(const Work& work, const std::variant<T...>*) {
  (work(MessageTag<T>{}), ...);
}
}  // namespace detail

/// work(MessageTag<T>{}) for each alternative of AnyMessage.
template <typename Work>
void forEachMessage(const Work& work) {
  detail::forEach(work, static_cast<const AnyMessage*>(nullptr));
}

}  // namespace angio::python
