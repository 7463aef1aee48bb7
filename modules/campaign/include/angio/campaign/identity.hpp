// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <map>
#include <string>
#include <vector>

#include "angio/campaign/namespace.hpp"
#include "angio/results/statistics.hpp"

namespace angio::campaign {

/// A part of a campaign: the shard `number` of `count`, from 1 on.
struct Shard {
  int number = 1, count = 1;

  std::string name() const { return std::to_string(number) + "/" + std::to_string(count); }

  /// Whether a run is this shard's. Runs are dealt out in turn, each round and each part beginning one shard further,
  /// so that every shard meets every tree and has as much to do as the others.
  bool has(int part, int run) const { return (run + run / count + part) % count == number - 1; }
};

constexpr int kMaxShards = 10000;

/// "2/4". Throws InputError.
Shard shardNamed(const std::string& text);

/// What the rows of a campaign depend on: shards of one campaign have the same.
struct CampaignIdentity {
  std::string program, version;
  std::string build;                          ///< Fingerprint of the program's file.
  std::vector<std::string> arguments;         ///< The command line, without what only this shard has.
  std::map<std::string, std::string> inputs;  ///< Fingerprints of what was read, by path or by what it is.

  /// Of all of that, 16 hexadecimal digits (FNV-1a, 64 bits: tells mix-ups apart, not forgeries).
  std::string fingerprint() const;
};

/// 16 hexadecimal digits of bytes.
std::string fingerprintOf(const std::string& bytes);

/// The same of a file's content, or of all regular files below a folder, with their names. Throws InputError.
std::string fingerprintOfFile(const std::string& path);

/// Fingerprint of the running program's file.
std::string fingerprintOfProgram();

/// The command line without options that say where results go, which shard it is and how many threads it has: what all
/// shards of a campaign have in common. Throws InputError for an argument that a line of text cannot show.
std::vector<std::string> sharedArguments(const std::vector<std::string>& arguments);

/// The first option of a command line that a shard's must not have, as it writes, prints or chooses a shard; empty
/// where there is none.
std::string unsharedOption(const std::vector<std::string>& arguments);

/// A command as a shell takes it.
std::string shellCommand(const std::vector<std::string>& words);

}  // namespace angio::campaign
