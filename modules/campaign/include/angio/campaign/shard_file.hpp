// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "angio/campaign/identity.hpp"

namespace angio::campaign {

/// What one shard of a campaign has made.
///
/// Its file has one JSON value a line. The first is the shard: {"angio_shard": 1, "program", "version", "build",
/// "arguments", "inputs", "campaign", "shard", "shards", "parts", "machine", "rows", "rows_fnv1a"}, where "campaign" is
/// the identity's fingerprint, "parts" says how many runs each part of the experiment has, and "rows_fnv1a" is the
/// fingerprint of all that follows the line. A line {"part", "run", "row"} follows for each of the shard's runs, in
/// their order. Numbers are exact; those that are not finite stand as {"not_finite": "nan"}, "inf" or "-inf".
struct ShardFile {
  /// What one run gave.
  struct Row {
    int part = 0, run = 0;
    std::string text;  ///< JSON.
  };

  std::string path;  ///< Where it was read.
  CampaignIdentity identity;
  Shard shard;
  std::vector<int> parts;
  Json machine;
  std::vector<Row> rows;
};

/// A row's value as text and back. Throws InputError that begins with `place`.
std::string rowAsText(const Json& value);
Json rowOfText(const std::string& text, const std::string& place);

/// Where a row of a shard stands: "shard-2.json:14".
std::string placeOfRow(const ShardFile& file, std::size_t row);

/// The file's whole content.
std::string shardAsText(const ShardFile& file);

/// Throws InputError that names the file, and the field, its value and the rule: a file that is not whole, that has
/// been changed, that lacks a run or has one twice, or whose command line would write something.
ShardFile readShard(const std::string& path);

}  // namespace angio::campaign
