// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <utility>

#include "field_rules.hpp"

namespace angio::messaging::wire {

/// How a message stands on the wire, what holds for it, and how it is shown. Codec, rules, text and tests of a message
/// follow from its description; each message has one, in messages/.
///
///   using Wire          What lcm-gen makes of the .lcm file: type name and fingerprint.
///   fields(v, m)        Names each field to a visitor, by its name and in the order of the .lcm file:
///                         v.number(name, value, limits)  Integer, double or enum.
///                         v.array(name, values, rule)    Vector or matrix of doubles, row by row.
///                         v.message(name, m)             A struct with a description of its own.
///                         v.text(name, text)             Stands last.
///                         v.bytes(name of the size, size, name, bytes)   Stands last.
///   line(m)             The message in one line for people.
template <typename T>
struct Description;

/// Part of the description of a message whose members are its fields.
template <typename T, typename LcmType>
struct PlainDescription {
  using Wire = LcmType;

  /// What fields() visits, and the ways there and back; unpack() may throw InputError.
  using Packed = T;
  static const T& pack(const T& m) { return m; }
  static T unpack(T&& m) { return std::move(m); }

  /// The first rule of the wire that a message breaks, in one line; nothing when it may go on the wire. Sender and
  /// receiver ask the same, so that whatever is decoded could have been encoded.
  static std::optional<std::string> broken(const T& m) {
    FieldRules rules;
    Description<T>::fields(rules, m);
    return rules.broken();
  }
};

}  // namespace angio::messaging::wire
