// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/message_json.hpp"

#include <angio_lcm/descriptions.hpp>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <variant>

#include "description.hpp"

namespace angio::messaging {
namespace wire {
namespace {

using Json = nlohmann::ordered_json;

// Integers and enums as integers, all else as what it is.
template <typename Number>
Json plain(Number value) {
  if constexpr (std::is_enum_v<Number> || std::is_integral_v<Number>) {
    return static_cast<std::int64_t>(value);
  } else {
    return value;
  }
}

// Visits a message's fields and enters their values.
class JsonValues {
 public:
  Json object = Json::object();

  template <typename Number>
  void number(const char* name, const Number& value, const Limits& = {}) {
    object[name] = plain(value);
  }
  template <typename Values>
  void array(const char* name, const Values& values, ArrayRule = ArrayRule::kNone) {
    Json& list = object[name] = Json::array();
    for (Eigen::Index r = 0; r < values.rows(); ++r) {
      for (Eigen::Index c = 0; c < values.cols(); ++c) list.push_back(double{values(r, c)});
    }
  }
  template <typename T>
  void message(const char* name, const T& m) {
    JsonValues inner;
    Description<T>::fields(inner, m);
    object[name] = std::move(inner.object);
  }
  void text(const char* name, const std::string& text) { object[name] = text; }
  template <typename Bytes>
  void bytes(const char* size_name, std::int32_t size, const char*, const Bytes&) {
    object[size_name] = size;
  }
  template <int Rows, typename Rule>
  void columns(const char* count_name, const char* name, const Columns<Rows>& values, const Rule&) {
    object[count_name] = values.cols();
    Json& list = object[name] = Json::array();
    for (Eigen::Index i = 0; i < values.size(); ++i) list.push_back(values.data()[i]);
  }
};

// Visits a message's fields and enters their schemas.
class JsonSchemas {
 public:
  Json properties = Json::object();

  template <typename Number>
  void number(const char* name, const Number&, const Limits& = {}) {
    properties[name]["type"] = std::is_floating_point_v<Number> ? "number" : "integer";
  }
  template <typename Values>
  void array(const char* name, const Values& values, ArrayRule = ArrayRule::kNone) {
    enterArray(name);
    properties[name]["minItems"] = properties[name]["maxItems"] = values.size();
  }
  template <typename T>
  void message(const char* name, const T& m) {
    properties[name] = of(m);
  }
  void text(const char* name, const std::string&) { properties[name]["type"] = "string"; }
  template <typename Bytes>
  void bytes(const char* size_name, std::int32_t, const char*, const Bytes&) {
    properties[size_name]["type"] = "integer";
  }
  template <int Rows, typename Rule>
  void columns(const char* count_name, const char* name, const Columns<Rows>&, const Rule&) {
    properties[count_name]["type"] = "integer";
    enterArray(name);
  }

  template <typename T>
  static Json of(const T& packed) {
    return of<T, T>(packed);
  }
  // Of a message that is packed otherwise on the wire.
  template <typename T, typename Packed>
  static Json of(const Packed& packed) {
    JsonSchemas visitor;
    Description<T>::fields(visitor, packed);
    Json schema{{"title", Description<T>::Wire::getTypeName()}, {"type", "object"}};
    schema["properties"] = std::move(visitor.properties);
    Json& required = schema["required"] = Json::array();
    for (const auto& property : schema["properties"].items()) required.push_back(property.key());
    return schema;
  }

 private:
  void enterArray(const char* name) {
    properties[name]["type"] = "array";
    properties[name]["items"]["type"] = "number";
  }
};

template <typename T>
JsonSchema schemaOf() {
  const typename Description<T>::Packed packed{};
  Json schema = JsonSchemas::of<T, typename Description<T>::Packed>(packed);
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  return {Description<T>::Wire::getTypeName(), schema.dump()};
}

template <typename... T>
std::vector<JsonSchema> schemasOf(const std::variant<T...>*) {
  return {schemaOf<T>()...};
}

}  // namespace
}  // namespace wire

std::string typeOf(const AnyMessage& message) {
  return std::visit(
      [](const auto& m) { return std::string(wire::Description<std::decay_t<decltype(m)>>::Wire::getTypeName()); },
      message);
}

std::string jsonOf(const AnyMessage& message) {
  wire::JsonValues values;
  std::visit(
      [&values](const auto& m) {
        using Wire = wire::Description<std::decay_t<decltype(m)>>;
        const auto& packed = Wire::pack(m);
        Wire::fields(values, packed);
      },
      message);
  // Texts come from the bus, and need not be UTF-8.
  return values.object.dump(-1, ' ', false, wire::Json::error_handler_t::replace);
}

std::vector<JsonSchema> jsonSchemas() { return wire::schemasOf(static_cast<const AnyMessage*>(nullptr)); }

}  // namespace angio::messaging
