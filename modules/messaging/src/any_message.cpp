// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/any_message.hpp"

#include <angio_lcm/descriptions.hpp>
#include <array>
#include <stdexcept>

#include "angio/base/errors.hpp"
#include "angio/messaging/mailbox.hpp"
#include "field_bytes.hpp"

namespace angio::messaging {
namespace wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <typename T>
std::string nameOf() {
  return Description<T>::Wire::getTypeName();
}

template <typename T, typename... Options>
Bytes bytesOf(const T& message, Options... options) {
  if (const auto broken = Description<T>::broken(message)) throw std::invalid_argument(nameOf<T>() + ": " + *broken);
  Bytes bytes;
  FieldWriter writer(bytes);
  writer.number("fingerprint", std::int64_t{Description<T>::Wire::getHash()});
  const auto& packed = Description<T>::pack(message, options...);
  Description<T>::fields(writer, packed);
  return bytes;
}

std::optional<std::int64_t> fingerprintOf(const std::uint8_t* data, std::size_t size) {
  std::int64_t fingerprint = 0;
  if (size < sizeof fingerprint) return std::nullopt;
  FieldReader(data, sizeof fingerprint).number("fingerprint", fingerprint);
  return fingerprint;
}

// Bytes to value: layout, conversion, rules.
template <typename T>
Decoded<AnyMessage> read(const std::uint8_t* data, std::size_t size) {
  const auto refused = [](const std::string& why) {
    return Decoded<AnyMessage>{std::nullopt, nameOf<T>() + ": " + why};
  };
  const auto fingerprint = fingerprintOf(data, size);
  if (!fingerprint) return refused("too short for a fingerprint");
  if (*fingerprint != Description<T>::Wire::getHash()) {
    const auto other = messageType(data, size);
    return refused("another type's fingerprint" + (other ? ", " + *other + "'s" : std::string()));
  }
  if (size > static_cast<std::size_t>(kMaxMessage)) return refused("too long");
  typename Description<T>::Packed packed{};
  FieldReader reader(data + sizeof *fingerprint, size - sizeof *fingerprint);
  Description<T>::fields(reader, packed);
  if (const char* broken = reader.broken()) return refused(broken);
  try {
    T message = Description<T>::unpack(std::move(packed));
    if (const auto broken = Description<T>::broken(message)) return refused(*broken);
    return {AnyMessage(std::move(message)), {}};
  } catch (const InputError& wrong) {
    return refused(wrong.what());
  }
}

struct Entry {
  std::string type;
  std::int64_t fingerprint;
  Decoded<AnyMessage> (*read)(const std::uint8_t* data, std::size_t size);
};

template <typename... T>
std::array<Entry, sizeof...(T)> entries(const std::variant<T...>*) {
  return {Entry{nameOf<T>(), Description<T>::Wire::getHash(), &read<T>}...};
}

// In the order of AnyMessage's alternatives.
const auto& table() {
  static const auto kTable = entries(static_cast<const AnyMessage*>(nullptr));
  return kTable;
}

const Entry* find(const std::uint8_t* data, std::size_t size) {
  const auto fingerprint = fingerprintOf(data, size);
  for (const Entry& known : table()) {
    if (known.fingerprint == fingerprint) return &known;
  }
  return nullptr;
}

}  // namespace

Bytes encode(const Messages::Pointer& message) {
  return std::visit([](const auto* m) { return bytesOf(*m); }, message);
}

Decoded<AnyMessage> decode(std::size_t alternative, const std::uint8_t* data, std::size_t size) {
  return table().at(alternative).read(data, size);
}

}  // namespace wire

std::vector<std::uint8_t> encode(const XrayFrame& frame, ImageEncoding encoding) {
  return wire::bytesOf(frame, encoding);
}

std::optional<std::string> messageType(const std::uint8_t* data, std::size_t size) {
  const wire::Entry* known = wire::find(data, size);
  return known ? std::optional(known->type) : std::nullopt;
}

Decoded<AnyMessage> decodeAny(const std::uint8_t* data, std::size_t size) {
  if (const wire::Entry* known = wire::find(data, size)) return known->read(data, size);
  return {std::nullopt, "its fingerprint is that of no type we know"};
}

std::int64_t timeOf(const AnyMessage& message) {
  return std::visit([](const auto& m) { return m.time_us; }, message);
}

std::int64_t sequenceOf(const AnyMessage& message) {
  return std::visit([](const auto& m) { return sequenceOf(m); }, message);
}

Numbering numberingOf(const AnyMessage& message) {
  Numbering numbering;
  numbering.gaps_are_losses = !std::holds_alternative<ServoRequest>(message);
  numbering.repeats_are_copies =
      !std::holds_alternative<ServoStatus>(message) && !std::holds_alternative<ViewRequest>(message);
  return numbering;
}

std::string describe(const AnyMessage& message) {
  return std::visit([](const auto& m) { return wire::Description<std::decay_t<decltype(m)>>::line(m); }, message);
}

}  // namespace angio::messaging
