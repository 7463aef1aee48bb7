// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/recording/log_conversion.hpp"

#include <unistd.h>

#include <filesystem>
#include <system_error>

#include "angio/base/errors.hpp"
#include "angio/messaging/log_writer.hpp"

namespace angio::recording {
namespace {

// The file that is written under this name: of a link the one that it leads to. Devices and folders are none.
std::string fileNamed(const std::string& path) {
  std::error_code ignored;
  const std::filesystem::path file = std::filesystem::is_symlink(path, ignored)
                                         ? std::filesystem::weakly_canonical(path, ignored)
                                         : std::filesystem::path(path);
  if (std::filesystem::exists(file, ignored) && !std::filesystem::is_regular_file(file, ignored)) {
    throw InputError(path, "", "", "must be a regular file, or none yet");
  }
  return file.string();
}

// A file under another name until it is whole; taken away otherwise.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::string& path)
      : path_(fileNamed(path)), unfinished_(path_ + ".part-" + std::to_string(::getpid())) {}
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;
  ~UnfinishedFile() {
    std::error_code ignored;
    std::filesystem::remove(unfinished_, ignored);
  }

  const std::string& name() const { return unfinished_; }
  void keep() const {
    std::error_code error;
    std::filesystem::rename(unfinished_, path_, error);
    if (error) throw InputError(path_, "", "", "cannot be written: " + error.message());
  }

 private:
  std::string path_, unfinished_;
};

template <typename Log>
Converted copyTo(Log& log, LogReader& from, const std::string& path, const ConversionProgress& progress) {
  Converted converted;
  for (auto event = from.next(); event && !log.failure(); event = from.next()) {
    log.write(*event);
    ++converted.messages;
    if (progress) progress(static_cast<double>(from.position_bytes()) / static_cast<double>(from.size_bytes()));
  }
  if (const auto failure = log.finish()) throw InputError(path, "", "", "cannot be written whole: " + *failure);
  converted.skipped_bytes = from.skipped_bytes();
  converted.whole = from.whole();
  return converted;
}

}  // namespace

Converted convertToMcap(const std::string& log, const std::string& mcap, const std::optional<RecordedScene>& scene,
                        const std::vector<mcap::Attachment>& attachments, const mcap::WriterSettings& settings,
                        const ConversionProgress& progress) {
  LogReader from(log);
  const UnfinishedFile file(mcap);
  McapLog to(file.name(), scene, attachments, settings);
  const Converted converted = copyTo(to, from, mcap, progress);
  file.keep();
  return converted;
}

Converted convertToLcm(const std::string& mcap, const std::string& log, const ConversionProgress& progress) {
  LogReader from(mcap);
  const UnfinishedFile file(log);
  LogWriter to(file.name());
  const Converted converted = copyTo(to, from, log, progress);
  file.keep();
  return converted;
}

}  // namespace angio::recording
