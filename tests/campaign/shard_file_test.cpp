// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/campaign/shard_file.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "angio/test/errors.hpp"
#include "angio/test/text.hpp"
#include "journeys.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// A file whose fingerprint fits whatever stands in it.
std::string withFingerprint(Json header, const std::string& body) {
  header["rows_fnv1a"] = campaign::fingerprintOf(body);
  return header.dump() + "\n" + body;
}

struct ShardText : testing::Test {
  ShardFolder folder{2};
  const std::string whole = readWholeFile(folder.paths().front());
  const Json header = Json::parse(whole.substr(0, whole.find('\n')));
  const std::string body = whole.substr(whole.find('\n') + 1);

  std::string refusalOfText(const std::string& content) const {
    const std::string path = folder.path("input.json");
    writeWholeFile(path, content);
    const std::string line = refusalOf([&] { (void)readShard(path); });
    EXPECT_THAT(line, StartsWith(path));
    return line.substr(std::min(line.size(), path.size()));
  }
  std::string refusalWith(const char* key, const Json& value) const {
    Json changed = header;
    changed[key] = value;
    return refusalOfText(withFingerprint(changed, body));
  }
};

TEST_F(ShardText, IsWrittenAsItWasRead) { EXPECT_EQ(shardAsText(readShard(folder.paths().front())), whole); }

// What a program that was killed, a full disk or a copy leaves.
TEST_F(ShardText, CutOrChangedIsRefusedByName) {
  for (std::size_t length = 0; length < whole.size(); length += 37) {
    EXPECT_NE(refusalOfText(whole.substr(0, length)), "") << length;
  }
  EXPECT_EQ(refusalOfText(whole.substr(0, whole.size() - 1)),
            ": rows = 6 of 7: must be whole and unchanged: the file is broken, make shard 1/2 again");
  std::string changed = whole;
  changed[changed.size() - 20] ^= 1;
  EXPECT_THAT(refusalOfText(changed), HasSubstr("must be whole and unchanged"));
}

TEST_F(ShardText, FieldsAreRefusedByTheirRules) {
  EXPECT_EQ(refusalWith("shard", 3), ": shard = 3: must be within 1 and 2");
  EXPECT_EQ(refusalWith("shards", 0), ": shards = 0: must be within 1 and 10000");
  EXPECT_EQ(refusalWith("shard", "1"), ": shard = \"1\": must be a whole number");
  EXPECT_EQ(refusalWith("angio_shard", 2), ": angio_shard = 2: must be within 1 and 1");
  EXPECT_EQ(refusalWith("rows", 6), ": rows = 6: must be 7");
  EXPECT_EQ(refusalWith("machine", 1), ": machine = 1: must be a map");
  EXPECT_EQ(refusalWith("version", "0.2.0"), ": campaign = \"" + header["campaign"].get<std::string>() +
                                                 "\": must be the fingerprint of program, arguments and inputs");
  EXPECT_EQ(refusalWith("parts", {10, 6}), ": rows: lack part 1, run 5");
  EXPECT_THAT(refusalWith("parts", {10}), HasSubstr("run = part 1, run 1: must be no more"));
  EXPECT_THAT(refusalOfText("{}\n"), HasSubstr("angio_shard: is missing"));
  EXPECT_THAT(refusalOfText(std::string(100, '[') + "\n"), HasSubstr("is nested too deeply"));
  Json incomplete = header;
  incomplete.erase("inputs");
  EXPECT_EQ(refusalOfText(withFingerprint(incomplete, body)), ": inputs: is missing");
}

// Whoever merges shards must not write where a file says.
TEST_F(ShardText, CommandLinesThatWriteAreRefused) {
  for (const char* option : {"--out=/tmp/x", "--report", "--film", "--help"}) {
    ShardFile file = readShard(folder.paths().front());
    file.identity.arguments.push_back(option);
    EXPECT_THAT(refusalOfText(shardAsText(file)), HasSubstr("must not be in a shard's command line"));
  }
}

TEST_F(ShardText, RunsThatLackOrStandTwiceAreRefused) {
  const std::size_t first = body.find('\n') + 1;
  EXPECT_THAT(refusalOfText(withFingerprint(header, body.substr(first))),
              HasSubstr(":2: run = part 0, run 3: must be part 0, run 0"));
  EXPECT_THAT(refusalOfText(withFingerprint(header, body.substr(0, first) + body)), HasSubstr("must be part 0, run 3"));
  EXPECT_THAT(refusalOfText(withFingerprint(header, "{\"part\":0,\"run\":0}\n")), HasSubstr(":2: row: is missing"));
}

}  // namespace
}  // namespace angio::test
