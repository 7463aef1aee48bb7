// SPDX-License-Identifier: GPL-2.0-or-later
// The corpus of datagrams, and what is like it, through a real socket into both machines' nodes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <random>

#include "angio/base/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "node_datagrams.hpp"

namespace angio::test {
namespace {

constexpr std::size_t kCuts = 12;
constexpr int kChanges = 40;

std::vector<std::string> corpusFiles() {
  std::vector<std::string> paths;
  for (const char* folder : {"/node_datagrams", "/lcm_datagrams"}) {
    for (const auto& entry : std::filesystem::directory_iterator(std::string(ANGIO_FUZZ_CORPUS) + folder)) {
      paths.push_back(entry.path().string());
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

TEST(NodesOnASocket, AnswerAGoodFrameWhateverDatagramsCame) {
  std::optional<NodesOnSocket> nodes;
  try {
    nodes.emplace();
  } catch (const InputError& error) {
    GTEST_SKIP() << "no multicast on this machine: " << error.what();
  }
  std::int64_t inputs = 0;
  const auto receive = [&](const std::string& input, const std::string& what) {
    ++inputs;
    try {
      nodes->receive(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
    } catch (const std::exception& error) {
      FAIL() << what << ": " << error.what();
    }
  };
  receive("", "nothing");
  ASSERT_EQ(nodes->answered(), 1);
  for (const std::string& file : corpusFiles()) {
    const std::string whole = contentOf(file);
    receive(whole, file);
    for (std::size_t cut = 1; cut < kCuts; ++cut) {
      receive(whole.substr(0, whole.size() * cut / kCuts), file + " cut, " + std::to_string(cut));
    }
    std::mt19937 random(4);
    for (int trial = 0; trial < kChanges; ++trial) {
      std::string changed = whole;
      for (int change = 0; change <= trial % 3; ++change) {
        changed[random() % changed.size()] = static_cast<char>(random());
      }
      receive(changed, file + " changed, trial " + std::to_string(trial));
      if (HasFatalFailure()) return;
    }
  }
  std::printf("%lld of %lld inputs, and a frame answered behind each\n", static_cast<long long>(nodes->answered()),
              static_cast<long long>(inputs));
  // A changed number of a sound frame may be so high that no frame is newer.
  EXPECT_GT(nodes->answered(), inputs * 8 / 10) << "of " << inputs;
}

}  // namespace
}  // namespace angio::test
