// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include "angio/base/errors.hpp"
#include "angio/mcap/reader.hpp"
#include "angio/mcap/writer.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

constexpr int kMessages = 40;

std::string contentOfMessage(int i) { return std::string(static_cast<std::size_t>(50 * i), static_cast<char>(i)); }

// Forty messages on two topics in several chunks, and an attachment between them.
std::string writeSmallMcap(const TemporaryFolder& folder, mcap::Compression compression) {
  const std::string path = folder.path("small.mcap");
  AppendedFile file(path);
  mcap::WriterSettings settings;
  settings.compression = compression;
  settings.chunk_bytes = 4000;
  mcap::Writer writer(file, settings);
  const auto schema = writer.add(mcap::Schema{"one.Type", "jsonschema", "{}"});
  const auto first = writer.add(mcap::Channel{schema, "/first", "json", {{"key", "value"}}});
  std::uint16_t second = 0;
  for (int i = 0; i < kMessages; ++i) {
    if (i == 20) writer.attach({5, "a.txt", "text/plain", "attached"});
    if (i == 5) second = writer.add(mcap::Channel{0, "second", "lcm", {}});
    const auto time_ns = static_cast<std::uint64_t>(1000 * i);
    writer.write({i % 5 == 0 && i > 0 ? second : first, static_cast<std::uint32_t>(i), time_ns, time_ns + 1,
                  contentOfMessage(i)});
  }
  writer.finish();
  EXPECT_EQ(file.finish(), std::nullopt);
  return path;
}

std::vector<int> sequencesOf(mcap::Reader& reader) {
  std::vector<int> read;
  for (auto m = reader.next(); m; m = reader.next()) {
    const int i = static_cast<int>(m->message.sequence);
    if (i >= kMessages || m->message.data != contentOfMessage(i)) ADD_FAILURE() << "message " << i << " is another";
    read.push_back(i);
  }
  return read;
}

class McapOfCompression : public testing::TestWithParam<mcap::Compression> {};

TEST_P(McapOfCompression, GivesBackWhatWasWritten) {
  const TemporaryFolder folder;
  mcap::Reader reader(writeSmallMcap(folder, GetParam()));
  std::vector<std::int64_t> places;
  for (int i = 0; i < kMessages; ++i) {
    const auto m = reader.next();
    ASSERT_TRUE(m);
    EXPECT_EQ(m->message.data, contentOfMessage(i));
    EXPECT_EQ(m->message.log_time_ns, 1000u * static_cast<unsigned>(i));
    EXPECT_EQ(m->message.publish_time_ns, m->message.log_time_ns + 1);
    EXPECT_EQ(m->channel->topic, i % 5 == 0 && i > 0 ? "second" : "/first");
    places.push_back(m->position_bytes);
  }
  EXPECT_FALSE(reader.next());
  EXPECT_EQ(reader.position_bytes(), reader.size_bytes());
  EXPECT_TRUE(reader.whole());
  EXPECT_EQ(reader.skipped_bytes(), 0);
  // From any place, also by a reader who has not read what lies before.
  mcap::Reader other(folder.path("small.mcap"));
  for (const int i : {31, 3, 17}) {
    for (mcap::Reader* by : {&reader, &other}) {
      by->seek(places[static_cast<std::size_t>(i)]);
      EXPECT_EQ(by->next()->message.sequence, static_cast<std::uint32_t>(i));
      by->seek(places[static_cast<std::size_t>(i)] + 1);
      EXPECT_EQ(by->next()->message.sequence, static_cast<std::uint32_t>(i) + 1);
    }
  }
  const auto attachments = reader.attachments();
  ASSERT_EQ(attachments.size(), 1u);
  EXPECT_EQ(attachments[0].name + attachments[0].media_type + attachments[0].data, "a.txttext/plainattached");
}

TEST_P(McapOfCompression, CutAnywhereHoldsItsWholeChunks) {
  const TemporaryFolder folder;
  const std::string content = contentOf(writeSmallMcap(folder, GetParam()));
  std::size_t most = 0;
  for (std::size_t size = mcap::kMagic_bytes; size < content.size(); size += 13) {
    mcap::Reader reader(folder.write("cut.mcap", content.substr(0, size)));
    const auto read = sequencesOf(reader);
    EXPECT_FALSE(reader.whole()) << size;
    EXPECT_GE(read.size(), most);
    most = read.size();
    for (std::size_t i = 0; i < read.size(); ++i) EXPECT_EQ(read[i], static_cast<int>(i));
  }
  EXPECT_EQ(most, std::size_t{kMessages});
}

TEST_P(McapOfCompression, LeavesOutAChunkWhoseBytesHaveChanged) {
  const TemporaryFolder folder;
  std::string content = contentOf(writeSmallMcap(folder, GetParam()));
  content[content.size() / 3] = static_cast<char>(content[content.size() / 3] ^ 1);
  mcap::Reader reader(folder.write("changed.mcap", content));
  const auto read = sequencesOf(reader);
  EXPECT_LT(read.size(), std::size_t{kMessages});
  EXPECT_GT(read.size(), std::size_t{kMessages} / 2);
  EXPECT_GT(reader.skipped_bytes(), 0);
}

INSTANTIATE_TEST_SUITE_P(All, McapOfCompression, testing::Values(mcap::Compression::kNone, mcap::Compression::kZstd));

// What a stranger's bytes may do: end, and allocate no more than is allowed.
TEST(Mcap, AnyBytesEnd) {
  const TemporaryFolder folder;
  const std::string content = contentOf(writeSmallMcap(folder, mcap::Compression::kZstd));
  Random random(1);
  for (int i = 0; i < 600; ++i) {
    std::string bytes = content;
    for (int k = 0; k < 3; ++k) {
      bytes[mcap::kMagic_bytes + static_cast<std::size_t>(random.uniform(0, 1) * (bytes.size() - 9))] =
          static_cast<char>(static_cast<std::uint8_t>(random.uniform(0, 256)));
    }
    try {
      mcap::Reader reader(folder.write("bad.mcap", bytes));
      int read = 0;
      while (reader.next()) ++read;
      EXPECT_LE(read, kMessages);
      (void)reader.attachments();
    } catch (const InputError&) {  // Another compression.
    }
  }
}

TEST(Mcap, NamesWhatItCannotRead) {
  const TemporaryFolder folder;
  EXPECT_THAT(([&] { mcap::Reader(folder.write("a.mcap", "no MCAP file")); }),
              testing::ThrowsMessage<InputError>(testing::HasSubstr("a.mcap: does not begin as an MCAP file does")));
  std::string content = contentOf(writeSmallMcap(folder, mcap::Compression::kZstd));
  content.replace(content.find("zstd"), 4, "lz4s");
  EXPECT_THAT(([&] { mcap::Reader(folder.write("b.mcap", content)); }),
              testing::ThrowsMessage<InputError>(testing::HasSubstr("compression = lz4s: must be zstd or none")));
}

}  // namespace
}  // namespace angio::test
