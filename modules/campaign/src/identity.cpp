// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/campaign/identity.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/fnv1a.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::campaign {
namespace {

// Where one shard's results go, and how it is run. The first ones have a value.
constexpr std::array kOwnWithValue = {"--out", "--shard", "--threads"};
constexpr std::array kOwnFlags = {"--no-times", "--estimate"};
// What a shard does not take, and whoever reads its file must not do.
constexpr std::array kRefused = {"--report", "--sheet",    "--film",    "--help",
                                 "-h",       "--help-all", "--version", "--print-settings"};

template <typename Names>
bool isOneOf(const Names& names, const std::string& argument) {
  const std::string name = argument.substr(0, argument.find('='));
  return std::any_of(names.begin(), names.end(), [&](const char* one) { return name == one; });
}

std::string asHex(const Fnv1a& hash) { return formatted("%016llx", static_cast<unsigned long long>(hash.value())); }

bool isPrintable(const std::string& text) {
  return std::none_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

}  // namespace

Shard shardNamed(const std::string& text) {
  const auto slash = text.find('/');
  const auto isNumber = [](const std::string& part) {
    return !part.empty() && part.size() <= 5 && part.find_first_not_of("0123456789") == std::string::npos;
  };
  if (slash != std::string::npos && isNumber(text.substr(0, slash)) && isNumber(text.substr(slash + 1))) {
    const Shard shard{std::stoi(text.substr(0, slash)), std::stoi(text.substr(slash + 1))};
    if (shard.number >= 1 && shard.number <= shard.count && shard.count <= kMaxShards) return shard;
  }
  throw InputError("", "--shard", text,
                   "must be a number and how many there are, 2/4, of 1 to " + std::to_string(kMaxShards));
}

std::string CampaignIdentity::fingerprint() const {
  return fingerprintOf(Json{program, version, build, arguments, inputs}.dump());
}

std::string fingerprintOf(const std::string& bytes) {
  Fnv1a hash;
  hash.add(bytes.data(), bytes.size());
  return asHex(hash);
}

std::string fingerprintOfFile(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return fingerprintOf(readWholeFile(path));
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file()) files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  std::string all;
  for (const std::string& file : files)
    all += file.substr(path.size()) + " " + fingerprintOf(readWholeFile(file)) + "\n";
  return fingerprintOf(all);
}

std::string fingerprintOfProgram() {
  return fingerprintOfFile(std::filesystem::read_symlink("/proc/self/exe").string());
}

std::vector<std::string> sharedArguments(const std::vector<std::string>& arguments) {
  std::vector<std::string> shared;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    if (!isPrintable(argument)) throw InputError("", "--shard", "", "takes no arguments with control characters");
    if (isOneOf(kOwnFlags, argument)) continue;
    if (isOneOf(kOwnWithValue, argument)) {
      if (argument.find('=') == std::string::npos) ++i;
      continue;
    }
    shared.push_back(argument);
  }
  return shared;
}

std::string unsharedOption(const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (!isPrintable(argument)) return "(control characters)";
    if (isOneOf(kOwnFlags, argument) || isOneOf(kOwnWithValue, argument) || isOneOf(kRefused, argument)) {
      return argument.substr(0, argument.find('='));
    }
  }
  return "";
}

std::string shellCommand(const std::vector<std::string>& words) {
  std::string command;
  for (const std::string& word : words) {
    const std::string plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_@%+=:,./-";
    std::string quoted = word;
    if (word.empty() || word.find_first_not_of(plain) != std::string::npos) {
      quoted = "'";
      for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
      quoted += "'";
    }
    command += (command.empty() ? "" : " ") + quoted;
  }
  return command;
}

}  // namespace angio::campaign
