// SPDX-License-Identifier: GPL-2.0-or-later
// MCAP files by the format's own library, @mcap/core of npm.
#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "angio/mcap/reader.hpp"
#include "angio/recording/log_conversion.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "recorded_messages.hpp"

namespace angio::test {
namespace {

TEST(McapCore, ReadsWhatIsWrittenWithAllItsCrcs) {
  if (std::system("node --version > /dev/null 2>&1 && npm --version > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "node and npm are not there: apt-get install nodejs npm";
  }
  const TemporaryFolder folder;
  const std::string install = "cd " + folder.path() +
                              " && timeout 60 npm install --no-audit --no-fund --ignore-scripts @mcap/core@2.2.2 "
                              "@foxglove/wasm-zstd@1.0.1 > /dev/null 2>&1";
  if (std::system(install.c_str()) != 0) GTEST_SKIP() << "@mcap/core cannot be had of the npm registry";
  std::filesystem::copy_file(ANGIO_MCAP_CORE_SCRIPT, folder.path("read.mjs"));
  writeRecordedLog(folder.path("run.lcm"));
  for (const auto compression : {mcap::Compression::kNone, mcap::Compression::kZstd}) {
    mcap::WriterSettings settings;
    settings.compression = compression;
    settings.chunk_bytes = 100'000;
    convertToMcap(folder.path("run.lcm"), folder.path("run.mcap"), recordedScene(),
                  {{0, "tree/tree.csv", "text/csv", "id,x_mm"}}, settings);
    const std::string command =
        "cd " + folder.path() + " && timeout 60 node read.mjs run.mcap > found.json 2> error.txt";
    ASSERT_EQ(std::system(command.c_str()), 0) << contentOf(folder.path("error.txt"));
    const auto found = nlohmann::json::parse(contentOf(folder.path("found.json")));
    mcap::Reader reader(folder.path("run.mcap"));
    std::map<std::string, int> topics;
    int messages = 0;
    for (auto m = reader.next(); m; m = reader.next(), ++messages) ++topics[m->channel->topic];
    EXPECT_EQ(found["topics"], nlohmann::json(topics));
    EXPECT_EQ(found["attachments"], nlohmann::json({"tree/tree.csv"}));
    EXPECT_EQ(found["streamed"], messages);
    EXPECT_EQ(found["counted"], messages);
    EXPECT_EQ(found["ended"], true);
    EXPECT_GT(found["chunks"].get<int>(), 2);
  }
}

}  // namespace
}  // namespace angio::test
