// SPDX-License-Identifier: GPL-2.0-or-later
// The fuzzers' corpus and its neighbourhood through every reader: a value or one line of refusal, nothing printed, and
// no memory that is taken on a file's word.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include "angio/messaging/any_message.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "readers.hpp"

#if defined(__SANITIZE_ADDRESS__)
#define ANGIO_ADDRESS_SANITIZER
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define ANGIO_ADDRESS_SANITIZER
#endif
#endif

namespace angio::test {

void PrintTo(const FileReader& reader, std::ostream* out) { *out << reader.name; }

namespace {

constexpr std::size_t kCuts = 50;
constexpr int kChanges = 200;

// As much address space as there is in use, and a gibibyte. AddressSanitizer takes terabytes for itself.
class BoundedMemory {
 public:
  BoundedMemory() {
    getrlimit(RLIMIT_AS, &before_);
#ifndef ANGIO_ADDRESS_SANITIZER
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit bound = before_;
    bound.rlim_cur = std::min<rlim_t>(before_.rlim_max, pages * 4096 + (rlim_t{1} << 30));
    setrlimit(RLIMIT_AS, &bound);
#endif
  }
  BoundedMemory(const BoundedMemory&) = delete;
  BoundedMemory& operator=(const BoundedMemory&) = delete;
  ~BoundedMemory() { setrlimit(RLIMIT_AS, &before_); }

 private:
  rlimit before_{};
};

std::vector<std::string> corpusFiles(const std::string& reader) {
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(corpusOf(reader)))
    paths.push_back(entry.path().string());
  std::sort(paths.begin(), paths.end());
  return paths;
}

// What once broke a reader is named by that; files that are read begin with "valid".
bool isValid(const std::string& path) { return std::filesystem::path(path).filename().string().rfind("valid", 0) == 0; }

class FileReaders : public testing::TestWithParam<FileReader> {
 protected:
  FileReaders() : path_(placeIn(folder_.path(), GetParam())) {
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
  }
  ~FileReaders() override {
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  }

  bool refused(std::string content, const std::string& what) {
    const FileReader& reader = GetParam();
    if (reader.mended) content = reader.mended(std::move(content));
    folder_.write(reader.file, content);
    try {
      return isRefused(reader, path_);
    } catch (const std::exception& error) {
      ADD_FAILURE() << what << ": " << error.what();
      return true;
    }
  }

 private:
  const TemporaryFolder folder_;
  const std::string path_;
  const BoundedMemory bound_;
};

// One test a reader, so that a program that ends tells which one did it.
TEST_P(FileReaders, TakeTheCorpusAndWhatIsLikeItOrRefuseIt) {
  int valid = 0;
  for (const std::string& file : corpusFiles(GetParam().name)) {
    const std::string whole = contentOf(file);
    const bool was_refused = refused(whole, file);
    if (!isValid(file)) continue;
    ++valid;
    EXPECT_FALSE(was_refused) << file;
    for (std::size_t cut = 0; cut < kCuts; ++cut) {
      const std::size_t length = whole.size() * cut / kCuts;
      refused(whole.substr(0, length), file + " cut to " + std::to_string(length));
    }
    std::mt19937 random(4);
    for (int trial = 0; trial < kChanges; ++trial) {
      std::string changed = whole;
      for (int change = 0; change <= trial % 3; ++change)
        changed[random() % changed.size()] = static_cast<char>(random());
      refused(changed, file + " changed, trial " + std::to_string(trial));
    }
  }
  EXPECT_GT(valid, 0);
}

INSTANTIATE_TEST_SUITE_P(All, FileReaders, testing::ValuesIn(fileReaders()),
                         [](const auto& instance) { return instance.param.name; });

TEST(AllFileReaders, RefuseWhatIsNoFile) {
  for (const FileReader& reader : fileReaders()) {
    const TemporaryFolder folder;
    const auto refused_at = [&](const std::string& path) {
      try {
        return isRefused(reader, path);
      } catch (const std::exception& error) {
        ADD_FAILURE() << path << ": " << error.what();
        return true;
      }
    };
    const std::string path = folder.path(reader.file);
    EXPECT_TRUE(refused_at(path)) << reader.name << ": missing";
    EXPECT_TRUE(refused_at(folder.path(std::string(300, 'n') + reader.file))) << reader.name << ": too long a name";
    ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
    EXPECT_TRUE(refused_at(path)) << reader.name << ": a pipe that nobody writes to";
    std::filesystem::remove(path);
    std::filesystem::create_directory(path);
    EXPECT_TRUE(refused_at(path)) << reader.name << ": a folder";
  }
}

// Deeper than a stack has room for functions that call themselves.
std::string nested(const std::string& before, const std::string& open, const std::string& close,
                   const std::string& after) {
  constexpr int kDepth = 200'000;
  std::string text = before;
  for (int i = 0; i < kDepth; ++i) text += open;
  for (int i = 0; i < kDepth; ++i) text += close;
  return text + after;
}

TEST(AllFileReaders, RefuseNestingThatWouldExhaustTheStack) {
  const TemporaryFolder folder;
  const std::pair<const char*, std::string> files[] = {
      {"coco_polygons", nested("{\"images\":{\"x\":", "[", "]", "},\"annotations\":[]}")},
      {"coco_polygons", nested("{\"images\":", "{\"x\":", "}", ",\"annotations\":[]}")},
      {"tree_mrk_json", nested("{\"markups\":", "[", "]", "}")},
      {"tree_mrk_json", nested("{\"markups\":[{\"type\":", "[", "]", "}]}")},
      {"campaign_shard", nested("{\"angio_shard\":", "[", "]", "}\n")},
      {"campaign_shard", nested("{\"angio_shard\":", "{\"x\":", "}", "}\n")},
      {"tree_vtp", nested("<VTKFile>", "<a>", "</a>", "</VTKFile>")},
      {"camera_xml", nested("<root>", "<a>", "</a>", "</root>")},
      {"camera_yaml", nested("a: ", "[", "]", "")},
      {"case_set", nested("a: ", "{b: ", "}", "")},
      {"settings", nested("", "- ", "", "")},
      {"pose", nested("", "? ", "", "")},
  };
  for (const auto& [name, content] : files) {
    for (const FileReader& reader : fileReaders()) {
      EXPECT_TRUE(reader.name != name || isRefused(reader, folder.write(reader.file, content))) << name;
    }
  }
}

// A type that has changed would else be no more than bytes to the fuzzer.
TEST(Corpus, HasALogOfAllMessagesAsTheyAreToday) {
  LogReader log(corpusOf("bus_log") + "/valid.lcm");
  std::set<std::size_t> types;
  for (auto event = log.next(); event; event = log.next()) {
    const auto decoded = decodeAny(event->bytes.data(), event->bytes.size());
    if (decoded.value) types.insert(decoded.value->index());
  }
  EXPECT_EQ(types.size(), std::variant_size_v<AnyMessage>);
}

}  // namespace
}  // namespace angio::test
