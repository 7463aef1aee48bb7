// SPDX-License-Identifier: GPL-2.0-or-later
// angio-spy: what is on a bus, in a terminal.
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <iostream>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/messaging/bus.hpp"
#include "angio/messaging/log_reader.hpp"
#include "spy_table.hpp"

namespace angio::apps {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::string bus = "udpm://239.255.76.67:7667?ttl=0", json;
  double duration_s = 0;
  bool once = false;
};

constexpr double kOnce_s = 3;
constexpr std::chrono::milliseconds kRefresh(500);

volatile std::sig_atomic_t stopped = 0;

// Over the last picture: lines that have become shorter, and what is below, are cleared.
void redraw(const std::string& url, const std::string& table) {
  std::string screen = "\033[H" + url + "\n\n" + table;
  for (std::size_t end = screen.find('\n'); end != screen.npos; end = screen.find('\n', end + 4)) {
    screen.insert(end, "\033[K");
  }
  std::cout << screen << "\033[J" << std::flush;
}

std::vector<ChannelReport> listen(const Options& o) {
  const auto bus = openSharedBus(o.bus);
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-spy: " << *warning << "\n";
  BusMonitor monitor;
  bus->subscribeAll([&](const std::string& channel, const std::uint8_t* data, std::size_t size) {
    monitor.hear(channel, data, size, monotonic_us());
  });
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  const bool live = !o.once && isatty(STDOUT_FILENO) == 1;
  const double duration_s = o.duration_s > 0 ? o.duration_s : o.once ? kOnce_s : 0;
  const auto began = Clock::now();
  auto next = began;
  if (live) std::cout << "\033[2J";
  while (!stopped && !bus->ended() &&
         (duration_s <= 0 || Clock::now() - began < std::chrono::duration<double>(duration_s))) {
    bus->handle(std::chrono::milliseconds(50));
    if (live && Clock::now() >= next) {
      redraw(o.bus, monitorTable(monitor.report(monotonic_us())));
      next = Clock::now() + kRefresh;
    }
  }
  if (live) std::cout << "\033[H\033[J";
  return monitor.report(monotonic_us());
}

// A log tells its own time, so its rates are those of the recording.
std::vector<ChannelReport> readLog(const std::string& path) {
  LogReader log(path);
  BusMonitor monitor;
  std::int64_t last_us = 0, messages = 0;
  for (auto event = log.next(); event; event = log.next(), ++messages) {
    last_us = event->time_us;
    monitor.hear(event->channel, event->bytes.data(), event->bytes.size(), last_us);
  }
  if (messages == 0 && log.size_bytes() > 0) throw InputError(path, "", "", "holds no message of an LCM log");
  if (log.skipped_bytes() > 0) {
    std::cerr << "angio-spy: " << path << ": " << log.skipped_bytes() << " bytes are no messages\n";
  }
  return monitor.report(last_us);
}

int spy(const Options& o) {
  const auto log = logFileOf(o.bus);
  const auto channels = log ? readLog(*log) : listen(o);
  if (!o.json.empty()) writeWholeFile(o.json, monitorAsJson(channels).dump(2) + "\n");
  std::cout << monitorTable(channels);
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  CLI::App app("Shows what is on a bus: channels, rates, gaps, delays and last values. Ends with a table.",
               "angio-spy");
  angio::apps::describeProgram(app, "angio-spy --bus 'file://run.lcm?speed=0' --json run.json");
  angio::apps::Options o;
  app.add_option("--bus", o.bus, "Bus to listen on (LCM URL); file://name.lcm?speed=0 reads a whole log at once");
  app.add_option("--duration-s", o.duration_s, "How long; 0: until stopped, or 3 with --once")
      ->check(angio::apps::between(0, 86400));
  app.add_flag("--once", o.once, "Only the table at the end, also in a terminal");
  app.add_option("--json", o.json, "File for the same numbers");
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::spy(o); });
}
