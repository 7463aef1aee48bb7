// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/campaign/campaigns.hpp"

namespace angio::campaign {
namespace {

void refuseForeign(const ShardFile& shard, const ShardFile& first, const std::string& field, const std::string& value) {
  throw InputError(shard.path, field, value.substr(0, 60), "is of another campaign than " + first.path);
}

// Throws with what differs first.
void requireSame(const ShardFile& shard, const ShardFile& first) {
  const CampaignIdentity &a = shard.identity, &b = first.identity;
  if (a.program != b.program) refuseForeign(shard, first, "program", a.program);
  if (a.version != b.version) refuseForeign(shard, first, "version", a.version);
  if (a.build != b.build) refuseForeign(shard, first, "build", a.build);
  const auto differ = std::mismatch(a.arguments.begin(), a.arguments.end(), b.arguments.begin(), b.arguments.end());
  if (a.arguments != b.arguments) {
    refuseForeign(shard, first, "arguments", differ.first == a.arguments.end() ? "" : *differ.first);
  }
  for (const auto& [name, hash] : a.inputs) {
    const auto found = b.inputs.find(name);
    if (found == b.inputs.end() || found->second != hash) refuseForeign(shard, first, "inputs", name);
  }
  if (a.inputs != b.inputs) refuseForeign(shard, first, "inputs", "fewer");
  if (shard.shard.count != first.shard.count) refuseForeign(shard, first, "shards", std::to_string(shard.shard.count));
  if (shard.parts != first.parts) refuseForeign(shard, first, "parts", std::to_string(shard.parts.size()) + " parts");
}

std::string commandOf(const ShardFile& like, const Shard& shard) {
  std::vector<std::string> words = {like.identity.program};
  words.insert(words.end(), like.identity.arguments.begin(), like.identity.arguments.end());
  const auto out = std::filesystem::path(like.path).replace_filename("shard-" + std::to_string(shard.number) + ".json");
  words.insert(words.end(), {"--shard", shard.name(), "--out", out.string()});
  return shellCommand(words);
}

}  // namespace

MergedShards::MergedShards(std::vector<ShardFile> shards) : shards_(std::move(shards)) {
  if (shards_.empty()) throw InputError("", "shards", "", "must be at least one");
  const ShardFile first = shards_.front();
  for (const ShardFile& shard : shards_) requireSame(shard, first);
  std::stable_sort(shards_.begin(), shards_.end(),
                   [](const ShardFile& a, const ShardFile& b) { return a.shard.number < b.shard.number; });
  for (std::size_t s = 1; s < shards_.size(); ++s) {
    if (shards_[s].shard.number == shards_[s - 1].shard.number) {
      throw InputError(shards_[s].path, "shard", shards_[s].shard.name(),
                       "stands in " + shards_[s - 1].path + " already");
    }
  }
  std::vector<std::string> missing, commands;
  std::size_t there = 0;
  for (int number = 1; number <= first.shard.count; ++number) {
    if (there < shards_.size() && shards_[there].shard.number == number) {
      ++there;
      continue;
    }
    missing.push_back(std::to_string(number));
    commands.push_back(commandOf(first, {number, first.shard.count}));
  }
  if (!missing.empty()) {
    throw InputError("", "", "",
                     (missing.size() == 1 ? "shard " : "shards ") + joined(missing, 20) + " of " +
                         std::to_string(first.shard.count) + (missing.size() == 1 ? " is" : " are") +
                         " missing; to make " + (missing.size() == 1 ? "it: " : "them: ") + joined(commands, 20, "; "));
  }
  next_.assign(shards_.size(), 0);
}

std::vector<results::Campaign::Row> MergedShards::rows(int count, int, const std::function<std::string(int k)>&,
                                                       const std::function<Json(int k)>&, const results::Progress&) {
  const std::vector<int>& parts = shards_.front().parts;
  if (part_ >= parts.size() || parts[part_] != count) {
    throw InputError(path(), "parts", part_ < parts.size() ? std::to_string(parts[part_]) : "",
                     "must be " + std::to_string(count) + " runs in part " + std::to_string(part_));
  }
  std::vector<Row> rows;
  for (std::size_t s = 0; s < shards_.size(); ++s) {
    const ShardFile& shard = shards_[s];
    for (; next_[s] < shard.rows.size() && shard.rows[next_[s]].part == static_cast<int>(part_); ++next_[s]) {
      const std::string place = placeOfRow(shard, next_[s]);
      rows.push_back({shard.rows[next_[s]].run, rowOfText(shard.rows[next_[s]].text, place), place});
    }
  }
  std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.run < b.run; });
  ++part_;
  return rows;
}

void MergedShards::finish() {
  if (part_ == shards_.front().parts.size()) return;
  throw InputError(path(), "parts", std::to_string(shards_.front().parts.size()), "must be " + std::to_string(part_));
}

Json MergedShards::machine() const {
  Json machine = shards_.front().machine, each = Json::array();
  std::vector<std::string> processors;
  bool same = true;
  for (const ShardFile& shard : shards_) {
    each.push_back(shard.machine);
    same = same && shard.machine == machine;
    const Json processor = shard.machine.value("processor", Json(""));
    if (!processor.is_string()) continue;
    if (std::find(processors.begin(), processors.end(), processor.get<std::string>()) == processors.end()) {
      processors.push_back(processor);
    }
  }
  if (same) return machine;
  machine["processor"] = joined(processors);
  machine["shards"] = each;
  return machine;
}

}  // namespace angio::campaign
