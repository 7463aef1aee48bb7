// SPDX-License-Identifier: GPL-2.0-or-later
#include "program_bus.hpp"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <stdexcept>
#include <utility>

#include "angio/base/formatted.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/messaging/disturbed_bus.hpp"

namespace angio::apps {
namespace {

using Clock = std::chrono::steady_clock;

class BadNetwork final : public DisturbedBus {
 public:
  BadNetwork(std::unique_ptr<Bus> bus, const DisturbanceSettings& settings)
      : DisturbedBus(*bus, settings, 1), bus_(std::move(bus)) {
    advance(monotonic_us());
  }

  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override {
    advance(monotonic_us());
    DisturbedBus::publish(channel, bytes);
  }

  void overhear(const std::string& channel, Handler handler) override { bus_->overhear(channel, std::move(handler)); }

  // Sends what is due meanwhile, to the millisecond.
  int handle(std::chrono::milliseconds timeout) override {
    const auto end = Clock::now() + timeout;
    for (;;) {
      advance(monotonic_us());
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
      const std::chrono::milliseconds most(nextDue_us() ? 1 : 1000);
      const int handled = bus_->handle(std::clamp(left, std::chrono::milliseconds(0), most));
      if (handled > 0 || Clock::now() >= end || bus_->ended()) return handled;
    }
  }

 private:
  std::unique_ptr<Bus> bus_;
};

}  // namespace

std::unique_ptr<Bus> openSharedBus(const std::string& url, const std::string& settings_path,
                                   const std::string& key_path, const std::string& program) {
  const auto tell = [program](const std::string& line) { std::cerr << program << ": " << line << "\n"; };
  auto bus = messaging::openSharedBus(url);
  if (!settings_path.empty()) {
    bus = std::make_unique<BadNetwork>(std::move(bus), readSettings(settings_path, DisturbanceSettings()));
  }
  return withKeyFile(std::move(bus), key_path, tell);
}

RunLog::RunLog(Bus& bus, const std::string& path, const std::string& program, const std::function<RecordedRun()>& run)
    : bus_(bus), path_(path), program_(program) {
  if (path.empty()) return;
  std::signal(SIGXFSZ, SIG_IGN);  // A limit on the size of files is an error of the log, not the end of the loop.
  if (namesMcap(path)) {
    recording_.emplace(bus, openMcap(path, run()));
  } else {
    recording_.emplace(bus, path);
  }
}

void RunLog::watch() {
  if (!recording_ || !recording_->failure() || std::exchange(told_, true)) return;
  std::cerr << program_ << ": " << *recording_->failure() << "\n";
}

void RunLog::finish() {
  if (!recording_) return;
  if (const auto failure = recording_->finish()) {
    std::cout.flush();
    throw std::runtime_error(*failure);
  }
  const double megabytes = 1e-6 * static_cast<double>(std::filesystem::file_size(path_));
  const double minutes = std::max(watch_.seconds(), 1e-3) / 60;
  std::cout << formatted("%s: %.1f MB recorded, %.0f MB a minute\n", path_.c_str(), megabytes, megabytes / minutes);
}

}  // namespace angio::apps
