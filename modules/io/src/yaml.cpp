// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/yaml.hpp"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {
namespace {

// Ten thousand cases fit. yaml-cpp may keep a hundred and forty bytes for every byte that it reads.
constexpr std::size_t kMaxYamlFile = std::size_t{4} << 20;
constexpr std::size_t kDeepest = 32;
constexpr int kMaxNodes = 1'000'000;

// Builds our own small tree from the parser's events: yaml-cpp's own would accept repeated keys and expand what it is
// told to.
class TreeBuilder final : public YAML::EventHandler {
 public:
  explicit TreeBuilder(const std::string& path) : path_(path) {}

  YamlNode take() { return std::move(root_); }

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { add(mark, anchor, YamlNode::Kind::kNull); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { refuse(mark, "alias", "must not be used here"); }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    if (!open_.empty() && open_.back().node->kind == YamlNode::Kind::kMap && !open_.back().has_key) {
      requirePlain(mark, tag, anchor);
      addKey(mark, value);
      return;
    }
    YamlNode& node = add(mark, anchor, YamlNode::Kind::kScalar);
    requirePlain(mark, tag, anchor);
    node.scalar = value;
    node.quoted = tag == "!";
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(mark, tag, anchor, YamlNode::Kind::kSequence);
  }
  void OnSequenceEnd() override { open_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(mark, tag, anchor, YamlNode::Kind::kMap);
  }
  void OnMapEnd() override { open_.pop_back(); }

 private:
  struct Open {
    YamlNode* node;  // Stays valid: its parent gets no further item while it is open.
    bool has_key = false;
    std::set<std::string> keys;
  };

  [[noreturn]] void refuse(const YAML::Mark& mark, const std::string& field, const std::string& rule) const {
    throw InputError(atLine(path_, mark.line + 1), field, "", rule);
  }

  // Quoted text has the tag "!", everything else that is not tagged "?" or none.
  void requirePlain(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) const {
    if (anchor != 0) refuse(mark, "anchor", "must not be used here");
    if (tag.size() > 1) refuse(mark, "tag", "must not be used here");
  }

  void addKey(const YAML::Mark& mark, const std::string& key) {
    Open& map = open_.back();
    if (!map.keys.insert(key).second) refuse(mark, key, "must not be given twice");
    map.node->keys.push_back(key);
    map.node->key_lines.push_back(mark.line + 1);
    map.has_key = true;
  }

  YamlNode& add(const YAML::Mark& mark, YAML::anchor_t anchor, YamlNode::Kind kind) {
    if (anchor != 0) refuse(mark, "anchor", "must not be used here");
    if (++count_ > kMaxNodes) refuse(mark, "values", "there must not be more than a million");
    YamlNode* node = &root_;
    if (!open_.empty()) {
      Open& parent = open_.back();
      if (parent.node->kind == YamlNode::Kind::kMap && !parent.has_key) refuse(mark, "key", "must be plain text");
      parent.has_key = false;
      node = &parent.node->items.emplace_back();
    }
    node->kind = kind;
    node->line = mark.line + 1;
    return *node;
  }

  void open(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, YamlNode::Kind kind) {
    requirePlain(mark, tag, anchor);
    if (open_.size() == kDeepest) refuse(mark, "nesting", "must not be deeper than " + std::to_string(kDeepest));
    YamlNode& node = add(mark, 0, kind);
    open_.push_back({&node, false, {}});
  }

  const std::string& path_;
  YamlNode root_;
  std::vector<Open> open_;
  int count_ = 0;
};

}  // namespace

YamlNode readYaml(const std::string& path) {
  std::string content = readWholeFile(path, kMaxYamlFile);
  const auto nul = content.find('\0');
  if (nul != std::string::npos) {
    const auto line = 1 + std::count(content.begin(), content.begin() + nul, '\n');
    throw InputError(atLine(path, static_cast<int>(line)), "byte", "0", "must be text, without control characters");
  }
  std::istringstream stream(std::move(content));
  try {
    YAML::Parser parser(stream);
    TreeBuilder builder(path);
    parser.HandleNextDocument(builder);
    TreeBuilder second(path);
    if (parser.HandleNextDocument(second)) throw InputError(path, "document", "", "there must be only one in a file");
    return builder.take();
  } catch (const YAML::Exception& error) {
    throw InputError(atLine(path, std::max(error.mark.line, 0) + 1), "", "", "is not valid YAML: " + error.msg);
  }
}

std::string formatValue(const YamlNode& node) {
  switch (node.kind) {
    case YamlNode::Kind::kNull:
      return "(nothing)";
    case YamlNode::Kind::kScalar:
      return node.quoted ? '"' + node.scalar + '"' : node.scalar;
    case YamlNode::Kind::kSequence:
      return "(list of " + std::to_string(node.items.size()) + ")";
    case YamlNode::Kind::kMap:
      return "(map)";
  }
  return "";
}

std::string YamlField::place() const { return atLine(path, node->line); }

void YamlField::refuse(const std::string& rule) const { throw InputError(place(), key, formatValue(*node), rule); }

double YamlField::number() const {
  if (node->kind != YamlNode::Kind::kScalar || node->quoted) refuse("must be a number");
  return parseNumber(place(), key, node->scalar);
}

double YamlField::positive() const { return requirePositive(place(), key, number()); }

double YamlField::between(double low, double high) const { return requireBetween(place(), key, number(), low, high); }

int YamlField::integer(int low, int high) const {
  const int value = integer();
  requireBetween(place(), key, value, low, high);
  return value;
}

int YamlField::integer() const {
  if (node->kind != YamlNode::Kind::kScalar || node->quoted) refuse("must be an integer");
  return parseInteger(place(), key, node->scalar);
}

bool YamlField::flag() const {
  if (node->kind != YamlNode::Kind::kScalar || node->quoted) refuse("must be true or false");
  if (node->scalar != "true" && node->scalar != "false") refuse("must be true or false");
  return node->scalar == "true";
}

const std::string& YamlField::text() const {
  if (node->kind != YamlNode::Kind::kScalar || node->scalar.empty()) refuse("must be a text");
  return node->scalar;
}

YamlField YamlField::item(std::size_t i) const { return {path, key + "[" + std::to_string(i) + "]", &node->items[i]}; }

std::vector<YamlField> YamlField::items(const std::string& rule, std::size_t min, std::size_t max) const {
  const std::size_t count = node->items.size();
  if (node->kind != YamlNode::Kind::kSequence || count < min || count > max) refuse(rule);
  std::vector<YamlField> all;
  for (std::size_t i = 0; i < count; ++i) all.push_back(item(i));
  return all;
}

std::vector<double> YamlField::numbers(std::size_t count) const {
  std::vector<double> result;
  for (const YamlField& entry : items("must be a list of " + std::to_string(count) + " numbers", count, count)) {
    result.push_back(entry.number());
  }
  return result;
}

std::vector<double> YamlField::numbers(std::size_t count, double low, double high) const {
  const std::vector<double> result = numbers(count);
  for (std::size_t i = 0; i < count; ++i) requireBetween(item(i).place(), item(i).key, result[i], low, high);
  return result;
}

YamlMap::YamlMap(std::string path, const YamlNode& node, const std::string& name)
    : path_(std::move(path)), node_(node) {
  if (node.kind != YamlNode::Kind::kMap && node.kind != YamlNode::Kind::kNull) {
    YamlField{path_, name, &node}.refuse("must be a map of keys and values");
  }
}

std::optional<YamlField> YamlMap::find(const std::string& key) {
  asked_.push_back(key);
  const auto at = std::find(node_.keys.begin(), node_.keys.end(), key);
  if (at == node_.keys.end()) return std::nullopt;
  return YamlField{path_, key, &node_.items[at - node_.keys.begin()]};
}

YamlField YamlMap::need(const std::string& key) {
  if (const auto field = find(key)) return *field;
  throw InputError(atLine(path_, node_.line), key, "", "is missing");
}

bool YamlMap::knows(const std::string& key) const {
  return std::find(asked_.begin(), asked_.end(), key) != asked_.end();
}

void YamlMap::refuseOthers() const {
  for (std::size_t i = 0; i < node_.keys.size(); ++i) {
    if (knows(node_.keys[i])) continue;
    throw InputError(atLine(path_, node_.key_lines[i]), node_.keys[i], formatValue(node_.items[i]),
                     "unknown key; there are: " + joined(asked_));
  }
}

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
