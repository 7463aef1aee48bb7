// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/campaign/shard_file.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/record_row.hpp"

namespace angio::campaign {
namespace {

constexpr int kVersion = 1, kMaxDepth = 32;
constexpr std::size_t kMaxHeader = std::size_t{16} << 20, kMaxParts = 100000, kMaxArguments = 10000;
constexpr const char* kNotFinite = "not_finite";

// JSON has no such numbers.
Json withNames(const Json& value) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) {
    const auto number = value.get<double>();
    return {{kNotFinite, std::isnan(number) ? "nan" : number > 0 ? "inf" : "-inf"}};
  }
  if (!value.is_structured()) return value;
  Json named = value;
  for (Json& member : named) member = withNames(member);
  return named;
}

void replaceNames(Json& value, const std::string& place) {
  if (!value.is_structured()) return;
  if (value.is_object() && value.size() == 1 && value.contains(kNotFinite)) {
    const Json name = value[kNotFinite];
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    if (name == "nan") {
      value = std::numeric_limits<double>::quiet_NaN();
    } else if (name == "inf" || name == "-inf") {
      value = name == "inf" ? kInfinity : -kInfinity;
    } else {
      results::RowPlace{place, kNotFinite}.refuse(name, "must be nan, inf or -inf");
    }
    return;
  }
  for (Json& member : value) replaceNames(member, place);
}

// Deeper values exhaust the stack of whoever copies them.
bool isTooDeep(const std::string& text) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '\\') {
      ++i;
    } else if (c == '"') {
      quoted = !quoted;
    } else if (!quoted && (c == '[' || c == '{')) {
      if (++depth > kMaxDepth) return true;
    } else if (!quoted && (c == ']' || c == '}')) {
      --depth;
    }
  }
  return false;
}

Json parsed(const std::string& text, const std::string& place) {
  if (isTooDeep(text)) throw InputError(place, "", "", "is nested too deeply");
  Json value = Json::parse(text, nullptr, false);
  if (value.is_discarded()) throw InputError(place, "", "", "is not JSON");
  return value;
}

int wholeIn(const Json& object, const char* key, const std::string& place, int low, int high) {
  int value = 0;
  const results::RowPlace at{place, key};
  const Json& found = memberOf(object, key, {place, ""});
  fromRow(found, at, value);
  if (value < low || value > high) {
    at.refuse(found, "must be within " + std::to_string(low) + " and " + std::to_string(high));
  }
  return value;
}

std::string textIn(const Json& object, const char* key, const std::string& place) {
  std::string value;
  fromRow(memberOf(object, key, {place, ""}), {place, key}, value);
  return value;
}

CampaignIdentity identityIn(const Json& header, const std::string& path) {
  CampaignIdentity identity{
      textIn(header, "program", path), textIn(header, "version", path), textIn(header, "build", path), {}, {}};
  const Json& arguments = memberOf(header, "arguments", {path, ""});
  fromRow(arguments, {path, "arguments"}, identity.arguments);
  if (identity.arguments.empty() || identity.arguments.size() > kMaxArguments) {
    results::RowPlace{path, "arguments"}.refuse(arguments, "must be a command line that begins with a sub-command");
  }
  if (const std::string option = unsharedOption(identity.arguments); !option.empty()) {
    throw InputError(path, "arguments", option.substr(0, 40), "must not be in a shard's command line");
  }
  const Json& inputs = memberOf(header, "inputs", {path, ""});
  if (!inputs.is_object()) results::RowPlace{path, "inputs"}.refuse(inputs, "must be a map");
  for (const auto& [name, hash] : inputs.items()) {
    fromRow(hash, results::RowPlace{path, "inputs"}.at("of a file"), identity.inputs[name]);
  }
  if (textIn(header, "campaign", path) != identity.fingerprint()) {
    results::RowPlace{path, "campaign"}.refuse(header["campaign"],
                                               "must be the fingerprint of program, arguments and inputs");
  }
  return identity;
}

std::string bodyOf(const ShardFile& file) {
  std::string body;
  for (const ShardFile::Row& row : file.rows) {
    body += "{\"part\":" + std::to_string(row.part) + ",\"run\":" + std::to_string(row.run) + ",\"row\":" + row.text +
            "}\n";
  }
  return body;
}

// The next run of a shard, from `part` and `run` on; false behind the last one.
bool advance(const ShardFile& file, int& part, int& run) {
  for (; part < static_cast<int>(file.parts.size()); ++part, run = 0) {
    for (; run < file.parts[static_cast<std::size_t>(part)]; ++run) {
      if (file.shard.has(part, run)) return true;
    }
  }
  return false;
}

std::string nameOfRun(int part, int run) { return "part " + std::to_string(part) + ", run " + std::to_string(run); }

void readRows(const std::string& content, std::size_t at, ShardFile& file) {
  int part = 0, run = 0;
  while (at < content.size()) {
    const std::string place = placeOfRow(file, file.rows.size());
    const std::size_t end = content.find('\n', at);
    if (end == std::string::npos) throw InputError(place, "", "", "is not whole");
    const Json line = parsed(content.substr(at, end - at), place);
    at = end + 1;
    constexpr int kMost = std::numeric_limits<int>::max() - 1;
    ShardFile::Row row{wholeIn(line, "part", place, 0, kMost), wholeIn(line, "run", place, 0, kMost), ""};
    const bool more = advance(file, part, run);
    if (!more || row.part != part || row.run != run) {
      throw InputError(place, "run", nameOfRun(row.part, row.run),
                       "must be " + (more ? nameOfRun(part, run) : std::string("no more")));
    }
    Json value = memberOf(line, "row", {place, ""});
    row.text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
    replaceNames(value, place);
    file.rows.push_back(std::move(row));
    ++run;
  }
  if (advance(file, part, run)) throw InputError(file.path, "rows", "", "lack " + nameOfRun(part, run));
}

}  // namespace

std::string rowAsText(const Json& value) { return withNames(value).dump(); }

Json rowOfText(const std::string& text, const std::string& place) {
  Json value = parsed(text, place);
  replaceNames(value, place);
  return value;
}

std::string placeOfRow(const ShardFile& file, std::size_t row) { return file.path + ":" + std::to_string(row + 2); }

std::string shardAsText(const ShardFile& file) {
  const std::string body = bodyOf(file);
  const CampaignIdentity& identity = file.identity;
  const Json header = {{"angio_shard", kVersion},
                       {"program", identity.program},
                       {"version", identity.version},
                       {"build", identity.build},
                       {"arguments", identity.arguments},
                       {"inputs", identity.inputs},
                       {"campaign", identity.fingerprint()},
                       {"shard", file.shard.number},
                       {"shards", file.shard.count},
                       {"parts", file.parts},
                       {"machine", file.machine},
                       {"rows", file.rows.size()},
                       {"rows_fnv1a", fingerprintOf(body)}};
  return header.dump() + "\n" + body;
}

ShardFile readShard(const std::string& path) {
  const std::string content = readWholeFile(path);
  const std::size_t end = content.find('\n');
  if (end == std::string::npos || end > kMaxHeader) throw InputError(path, "", "", "is no whole shard of a campaign");
  const Json header = parsed(content.substr(0, end), path + ":1");
  if (!header.is_object() || !header.contains("angio_shard")) {
    throw InputError(path, "angio_shard", "", "is missing: no shard of a campaign");
  }
  ShardFile file;
  file.path = path;
  wholeIn(header, "angio_shard", path, kVersion, kVersion);
  file.shard.count = wholeIn(header, "shards", path, 1, kMaxShards);
  file.shard.number = wholeIn(header, "shard", path, 1, file.shard.count);
  // What a killed program or a broken copy leaves, before anything else is said of the file.
  const std::string body = content.substr(end + 1);
  const int rows = wholeIn(header, "rows", path, 0, std::numeric_limits<int>::max());
  if (textIn(header, "rows_fnv1a", path) != fingerprintOf(body)) {
    const auto lines = std::count(body.begin(), body.end(), '\n');
    throw InputError(path, "rows", std::to_string(lines) + " of " + std::to_string(rows),
                     "must be whole and unchanged: the file is broken, make shard " + file.shard.name() + " again");
  }
  file.identity = identityIn(header, path);
  const Json& parts = memberOf(header, "parts", {path, ""});
  fromRow(parts, {path, "parts"}, file.parts);
  if (file.parts.size() > kMaxParts) results::RowPlace{path, "parts"}.refuse(parts, "must be fewer");
  for (const int count : file.parts) {
    if (count < 0) throw InputError(path, "parts", std::to_string(count), "must be numbers of runs");
  }
  file.machine = memberOf(header, "machine", {path, ""});
  if (!file.machine.is_object()) results::RowPlace{path, "machine"}.refuse(file.machine, "must be a map");
  readRows(content, end + 1, file);
  if (static_cast<int>(file.rows.size()) != rows) {
    throw InputError(path, "rows", std::to_string(rows), "must be " + std::to_string(file.rows.size()));
  }
  return file;
}

}  // namespace angio::campaign
