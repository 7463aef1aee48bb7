// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/recording/mcap_log.hpp"

#include <condition_variable>
#include <deque>
#include <filesystem>
#include <limits>
#include <map>
#include <mutex>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

#include "angio/base/appended_file.hpp"
#include "angio/base/errors.hpp"
#include "angio/messaging/any_message.hpp"
#include "angio/messaging/message_json.hpp"
#include "foxglove_schemas.hpp"
#include "foxglove_topics.hpp"

namespace angio::recording {
namespace {

// What may wait to be written [bytes]: half a minute of frames of 512 x 512 pixels of 16 bit.
constexpr std::size_t kMaxWaiting_bytes = std::size_t{1} << 28;

}  // namespace

struct McapLog::State {
  State(const std::string& path, std::optional<RecordedScene> scene, mcap::WriterSettings settings)
      : file(path), writer(file, std::move(settings)), topics(std::move(scene)) {
    for (const auto& [type, schema] : jsonSchemas()) {
      schemas[type] = writer.add(mcap::Schema{"angio." + type, "jsonschema", schema});
    }
  }

  std::uint16_t channel(const std::string& topic, const char* encoding, std::uint16_t schema) {
    const auto known = channels.find(topic);
    if (known != channels.end()) return known->second;
    return channels[topic] = writer.add(mcap::Channel{schema, topic, encoding, {}});
  }

  std::uint16_t foxgloveChannel(const FoxgloveTopic& topic) {
    const auto [schema, is_new] = schemas.try_emplace(topic.schema, std::uint16_t{0});
    if (is_new) schema->second = writer.add(mcap::Schema{topic.schema, "jsonschema", foxgloveSchema(topic.schema)});
    return channel(topic.name, "json", schema->second);
  }

  // How many messages of the bus stand in whole chunks.
  std::int64_t keptMessages() {
    while (!begun.empty() && begun.front() < writer.messagesInChunks()) {
      begun.pop_front();
      ++kept;
    }
    return kept;
  }

  // Ends the file, which keeps its whole chunks; what is said of that.
  std::string failureOf(const std::string& why) {
    (void)file.finish();
    return file.path() + ": recording ended: " + why + "; it holds the first " + std::to_string(keptMessages()) +
           " messages" + (file.endsWhole() ? "" : ", and perhaps a piece of a chunk");
  }

  AppendedFile file;
  mcap::Writer writer;
  FoxgloveTopics topics;
  std::map<std::string, std::uint16_t> schemas, channels;
  std::int64_t messages = 0, kept = 0;
  std::deque<std::int64_t> begun;  // Of each message of the bus that is in no whole chunk yet, its place in the file.
  std::optional<std::string> failure;
  bool finished = false;

  // What is handed to the worker; all that follows is the mutex's. While there is a worker, what stands above is its.
  std::int64_t heard = 0;
  std::thread worker;
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<LogEvent> waiting;
  std::size_t waiting_bytes = 0;
  bool ends = false;
  std::optional<std::string> cause;
};

McapLog::McapLog(const std::string& path, std::optional<RecordedScene> scene, std::vector<mcap::Attachment> attachments,
                 mcap::WriterSettings settings) {
  std::error_code ignored;
  const bool is_new = !std::filesystem::exists(path, ignored);
  try {
    state_ = std::make_unique<State>(path, std::move(scene), std::move(settings));
    for (mcap::Attachment& attachment : attachments) {
      if (attachment.log_time_ns == 0) attachment.log_time_ns = 1000 * static_cast<std::uint64_t>(wallClock_us());
      state_->writer.attach(attachment);
    }
  } catch (const InputError&) {
    throw;
  } catch (const std::runtime_error& error) {
    if (is_new) std::filesystem::remove(path, ignored);
    throw InputError(path, "", "", std::string("cannot be written: ") + error.what());
  }
}

McapLog::~McapLog() { (void)finish(); }

void McapLog::record(const LogEvent& event) {
  State& s = *state_;
  const auto time_ns = 1000 * static_cast<std::uint64_t>(event.time_us);
  const auto write = [&](std::uint16_t channel, std::string data) {
    s.writer.write({channel, static_cast<std::uint32_t>(event.number), time_ns, time_ns, std::move(data)});
  };
  s.begun.push_back(s.writer.messages());
  write(s.channel(event.channel, mcap::kLcmEncoding, 0), {event.bytes.begin(), event.bytes.end()});
  ++s.messages;
  s.keptMessages();
  const auto decoded = decodeAny(event.bytes.data(), event.bytes.size());
  if (!decoded.value) return;
  write(s.channel("/angio/" + event.channel, "json", s.schemas.at(typeOf(*decoded.value))), jsonOf(*decoded.value));
  s.topics.show(event.channel, *decoded.value, event.time_us, [&](const FoxgloveTopic& topic, std::string json) {
    write(s.foxgloveChannel(topic), std::move(json));
  });
}

// Images are packed meanwhile, as a loop waits for no file. Waits itself when the disk is too slow for long.
void McapLog::write(const std::string& channel, const std::uint8_t* data, std::size_t size) {
  State& s = *state_;
  if (failure() || s.finished) return;
  LogEvent event;
  event.number = s.heard++;
  event.time_us = wallClock_us();
  event.channel = channel;
  event.bytes.assign(data, data + size);
  if (!s.worker.joinable()) s.worker = std::thread([this] { recordWaiting(); });
  std::unique_lock<std::mutex> lock(s.mutex);
  s.changed.wait(lock, [&] { return s.waiting_bytes <= kMaxWaiting_bytes; });
  s.waiting_bytes += size;
  s.waiting.push_back(std::move(event));
  s.changed.notify_all();
}

void McapLog::recordWaiting() {
  State& s = *state_;
  std::unique_lock<std::mutex> lock(s.mutex);
  for (;;) {
    s.changed.wait(lock, [&s] { return !s.waiting.empty() || s.ends; });
    if (s.waiting.empty()) return;
    const LogEvent event = std::move(s.waiting.front());
    s.waiting.pop_front();
    const bool failed = s.cause.has_value();
    lock.unlock();
    std::optional<std::string> cause;
    if (!failed) cause = tryRecord(event);
    lock.lock();
    if (cause) s.cause = s.failureOf(*cause);
    s.waiting_bytes -= event.bytes.size();
    s.changed.notify_all();
  }
}

std::optional<std::string> McapLog::tryRecord(const LogEvent& event) {
  try {
    record(event);
  } catch (const std::exception& error) {
    return error.what();
  }
  return std::nullopt;
}

void McapLog::write(const LogEvent& event) {
  State& s = *state_;
  if (failure() || s.finished) return;
  const std::string place = "message " + std::to_string(s.messages);
  if (event.time_us < 0 ||
      static_cast<std::uint64_t>(event.time_us) > std::numeric_limits<std::uint64_t>::max() / 1000) {
    throw InputError(place, "time_us", std::to_string(event.time_us), "must be from 1970 to 2554");
  }
  if (event.number < 0 || event.number > std::numeric_limits<std::uint32_t>::max()) {
    throw InputError(place, "number", std::to_string(event.number), "must have at most 32 bits");
  }
  if (const auto cause = tryRecord(event)) s.failure = s.failureOf(*cause);
}

// The worker's failure comes to its owner here.
const std::optional<std::string>& McapLog::failure() const {
  State& s = *state_;
  const std::lock_guard<std::mutex> lock(s.mutex);
  if (!s.failure) s.failure = s.cause;
  return s.failure;
}

std::optional<std::string> McapLog::finish() {
  State& s = *state_;
  if (std::exchange(s.finished, true)) return failure();
  if (s.worker.joinable()) {
    {
      const std::lock_guard<std::mutex> lock(s.mutex);
      s.ends = true;
    }
    s.changed.notify_all();
    s.worker.join();
  }
  if (failure()) return s.failure;
  try {
    s.writer.finish();
    if (const auto cause = s.file.finish()) s.failure = s.failureOf(*cause);
  } catch (const std::exception& error) {
    s.failure = s.failureOf(error.what());
  }
  return s.failure;
}

}  // namespace angio::recording
