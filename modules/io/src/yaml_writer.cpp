// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/yaml.hpp"

namespace angio::io {
namespace {

using Json = nlohmann::ordered_json;

// Words that YAML takes as they are; all else is quoted. JSON's quotes and escapes are YAML's.
std::string scalarText(const Json& value, const std::string& key) {
  if (value.is_number_float()) {
    if (!std::isfinite(value.get<double>())) throw InputError("", key, "", "must be finite");
    return exact(value.get<double>());
  }
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string keyText(const std::string& key) {
  const bool plain =
      !key.empty() && !std::isdigit(static_cast<unsigned char>(key[0])) &&
      key.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") == std::string::npos;
  return plain ? key : Json(key).dump();
}

bool isFlat(const Json& value) {
  if (!value.is_structured()) return true;
  if (value.is_object()) return value.empty();
  for (const Json& item : value) {
    if (item.is_structured()) return false;
  }
  return true;
}

std::string flowText(const Json& value, const std::string& key) {
  if (!value.is_structured()) return scalarText(value, key);
  if (value.is_object()) return "{}";
  std::string text = "[";
  for (const Json& item : value) text += (text.size() > 1 ? ", " : "") + scalarText(item, key);
  return text + "]";
}

void writeBlock(const Json& value, const std::string& name, int indent, std::string& text);

// What stands behind "key:" or "-", whose line is still open.
void writeValue(const Json& value, const std::string& name, int indent, std::string& text) {
  if (isFlat(value)) {
    text += " " + flowText(value, name) + "\n";
    return;
  }
  text += "\n";
  writeBlock(value, name, indent, text);
}

void writeBlock(const Json& value, const std::string& name, int indent, std::string& text) {
  const std::string margin(static_cast<std::size_t>(indent), ' ');
  if (value.is_object()) {
    for (const auto& [key, item] : value.items()) {
      text += margin + keyText(key) + ":";
      writeValue(item, key, indent + 2, text);
    }
    return;
  }
  for (const Json& item : value) {
    text += margin + "-";
    if (item.is_object() && !item.empty()) {
      std::string block;
      writeBlock(item, name, indent + 2, block);
      text += " " + block.substr(margin.size() + 2);  // The first key stands beside the dash.
    } else {
      writeValue(item, name, indent + 2, text);
    }
  }
}

}  // namespace

std::string asYaml(const Json& document) {
  std::string text;
  if (isFlat(document)) return flowText(document, "document") + "\n";
  writeBlock(document, "document", 0, text);
  return text;
}

}  // namespace angio::io
