// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/log_reader.hpp"

#include <array>
#include <filesystem>
#include <string_view>

#include "angio/base/errors.hpp"
#include "log_format.hpp"

namespace angio::messaging {
namespace {

std::uint64_t bigEndian(const char* bytes, int count) {
  std::uint64_t number = 0;
  for (int i = 0; i < count; ++i) number = number << 8 | static_cast<unsigned char>(bytes[i]);
  return number;
}

}  // namespace

LogReader::LogReader(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(path, "", "", "does not exist");
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path, "", "", "is not a regular file");
  size_ = static_cast<std::int64_t>(std::filesystem::file_size(path, error));
  file_.open(path, std::ios::binary);
  if (error || !file_) throw InputError(path, "", "", "cannot be read");
}

std::optional<LogEvent> LogReader::next() {
  std::array<char, kLogHeader_bytes> header{};
  while (size_ - position_ >= static_cast<std::int64_t>(kLogHeader_bytes)) {
    file_.seekg(position_);
    if (!file_.read(header.data(), header.size())) break;
    const auto channel_length = static_cast<std::int32_t>(bigEndian(&header[20], 4));
    const auto data_length = static_cast<std::int32_t>(bigEndian(&header[24], 4));
    const std::int64_t behind = size_ - position_ - static_cast<std::int64_t>(kLogHeader_bytes);
    const bool sound = bigEndian(header.data(), 4) == kLogMagic && channel_length > 0 &&
                       channel_length < static_cast<std::int32_t>(kLogMaxChannel_bytes) && data_length >= 0 &&
                       std::int64_t{channel_length} + data_length <= behind;
    if (!sound) {
      skipDamage();
      continue;
    }
    LogEvent event;
    event.position_bytes = position_;
    event.time_us = static_cast<std::int64_t>(bigEndian(&header[12], 8));
    event.channel.resize(static_cast<std::size_t>(channel_length));
    event.bytes.resize(static_cast<std::size_t>(data_length));
    file_.read(event.channel.data(), channel_length);
    file_.read(reinterpret_cast<char*>(event.bytes.data()), data_length);
    if (!file_) break;  // The file has become shorter while it is read.
    position_ += static_cast<std::int64_t>(kLogHeader_bytes) + channel_length + data_length;
    return event;
  }
  skipped_ += size_ - position_;
  position_ = size_;
  return std::nullopt;
}

void LogReader::skipDamage() {
  std::array<char, 1 << 16> block{};
  file_.seekg(position_ + 1);
  file_.read(block.data(), block.size());
  const std::string_view read(block.data(), static_cast<std::size_t>(file_.gcount()));
  file_.clear();
  const std::size_t found = read.find(std::string_view("\xED\xA1\xDA\x01", 4));
  // The word may begin in the last three bytes of the block.
  const std::size_t step = 1 + (found != read.npos ? found : read.size() > 3 ? read.size() - 3 : 0);
  position_ += static_cast<std::int64_t>(step);
  skipped_ += static_cast<std::int64_t>(step);
}

std::optional<std::string> logFileOf(const std::string& url) {
  const std::string scheme = "file://";
  const std::size_t options = url.find('?');
  if (url.compare(0, scheme.size(), scheme) != 0 || options == std::string::npos) return std::nullopt;
  const std::string rest = url.substr(options + 1) + "&";
  if (("&" + rest).find("&speed=0&") == std::string::npos) return std::nullopt;
  return url.substr(scheme.size(), options - scheme.size());
}

}  // namespace angio::messaging
