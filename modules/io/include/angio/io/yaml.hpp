// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// A piece of a YAML document with the line it stands on. Files are data here, so there are no anchors, aliases or
/// tags.
struct YamlNode {
  enum class Kind { kNull, kScalar, kSequence, kMap };

  Kind kind = Kind::kNull;
  int line = 1;
  bool quoted = false;
  std::string scalar;
  std::vector<std::string> keys;  ///< Of a map: as many as items.
  std::vector<int> key_lines;
  std::vector<YamlNode> items;  ///< Of a sequence or a map.
};

/// Reads one YAML document; an empty file is kNull. Throws InputError "path:line: ..." for broken YAML, repeated keys,
/// anchors, aliases, tags, a second document, nesting beyond 32, more than a million values and more than 4 MiB.
YamlNode readYaml(const std::string& path);

using base::formatValue;  // Of numbers, beside that of nodes.
/// What a node says, for messages.
std::string formatValue(const YamlNode& node);

/// A value under its key, with the place to name when it is wrong. Each reader throws InputError "path:line: key = ...:
/// rule".
struct YamlField {
  std::string path;
  std::string key;
  const YamlNode* node;

  std::string place() const;
  [[noreturn]] void refuse(const std::string& rule) const;
  double number() const;
  double positive() const;
  double between(double low, double high) const;
  int integer() const;
  int integer(int low, int high) const;
  bool flag() const;
  const std::string& text() const;
  std::vector<double> numbers(std::size_t count) const;                           ///< A sequence of just so many,
  std::vector<double> numbers(std::size_t count, double low, double high) const;  ///< and each of them within bounds.
  YamlField item(std::size_t i) const;  ///< Of a sequence: its key is "key[i]".

  /// The items of a sequence; refuses all else by this rule, and fewer or more than these.
  std::vector<YamlField> items(const std::string& rule, std::size_t min = 0, std::size_t max = SIZE_MAX) const;
};

/// Reads the keys of a map; what nobody asked for is refused at the end.
class YamlMap {
 public:
  /// Throws InputError unless the node is a map (or null, which is an empty one). `name` is what it is called in
  /// messages.
  YamlMap(std::string path, const YamlNode& node, const std::string& name);

  std::optional<YamlField> find(const std::string& key);
  YamlField need(const std::string& key);  ///< Throws InputError when the key is missing.

  /// Whether a key was asked for.
  bool knows(const std::string& key) const;
  const std::vector<std::string>& asked() const { return asked_; }  ///< In this order, repeated if asked again.

  /// Throws InputError for the first key that was never asked for, and says which there are.
  void refuseOthers() const;

 private:
  std::string path_;
  const YamlNode& node_;
  std::vector<std::string> asked_;
};

/// A document as YAML text, for readYaml to read back: maps in blocks, lists of numbers on one line, lists of lists of
/// numbers a row a line, numbers in their shortest form that reads back the same. Throws InputError for a number that
/// is not finite: it has no place in a file.
std::string asYaml(const nlohmann::ordered_json& document);

}  // namespace angio::io
