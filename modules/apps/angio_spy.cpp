// SPDX-License-Identifier: GPL-2.0-or-later
// angio-spy: what is on a bus, in a terminal.
#include <unistd.h>

#include <chrono>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/messaging/bus.hpp"
#include "angio/messaging/bus_monitor.hpp"
#include "angio/messaging/log_reader.hpp"

namespace angio::apps {
namespace {

long long count(std::int64_t number) { return static_cast<long long>(number); }

std::string row(const ChannelReport& r) {
  const std::string latency = r.latency_s ? formatted("%.1f", 1e3 * *r.latency_s) : "-";
  std::string text = formatted("%-18s %-20s %8lld %7.1f %9.1f %8lld %5lld %5lld %6lld %8.2f %8s %8.1f\n",
                               r.channel.c_str(), r.type.c_str(), count(r.messages), r.rate_hz, 1e-3 * r.bytes_per_s,
                               count(r.missing), count(r.duplicates), count(r.late), count(r.undecodable), r.age_s,
                               latency.c_str(), 1e3 * r.delay_spread_s);
  if (!r.last_value.empty()) text += "    " + r.last_value + "\n";
  if (r.restarts > 0) text += formatted("    its sender began again %lld times\n", count(r.restarts));
  if (!r.last_error.empty()) text += "    not decoded: " + r.last_error + "\n";
  return text;
}

struct Heard {
  std::vector<ChannelReport> channels;
  std::int64_t unlisted = 0;  // Messages of further channels.
};

Heard heardBy(const BusMonitor& monitor, std::int64_t now_us) { return {monitor.report(now_us), monitor.unlisted()}; }

// Channels as a table for people: one line of numbers and one of the last value each.
std::string monitorTable(const Heard& heard) {
  if (heard.channels.empty()) return "no messages\n";
  std::string text = formatted("%-18s %-20s %8s %7s %9s %8s %5s %5s %6s %8s %8s %8s\n", "channel", "type", "messages",
                               "Hz", "kB/s", "missing", "twice", "late", "broken", "age s", "delay ms", "+- ms");
  for (const auto& channel : heard.channels) text += row(channel);
  if (heard.unlisted > 0) text += formatted("%lld messages on further channels\n", count(heard.unlisted));
  return text;
}

// The same for programs: {"channels": {name: {...}}, "unlisted_messages": n}; latency_s is null where clocks do not
// allow it.
nlohmann::ordered_json monitorAsJson(const Heard& heard) {
  nlohmann::ordered_json all = {{"channels", nlohmann::ordered_json::object()}};
  for (const auto& r : heard.channels) {
    all["channels"][r.channel] = {{"type", r.type},
                                  {"messages", r.messages},
                                  {"bytes", r.bytes},
                                  {"rate_hz", r.rate_hz},
                                  {"bytes_per_s", r.bytes_per_s},
                                  {"missing", r.missing},
                                  {"duplicates", r.duplicates},
                                  {"late", r.late},
                                  {"restarts", r.restarts},
                                  {"undecodable", r.undecodable},
                                  {"age_s", r.age_s},
                                  {"latency_s", nullptr},
                                  {"delay_spread_s", r.delay_spread_s},
                                  {"last_value", r.last_value},
                                  {"last_error", r.last_error}};
    if (r.latency_s) all["channels"][r.channel]["latency_s"] = *r.latency_s;
  }
  all["unlisted_messages"] = heard.unlisted;
  return all;
}

using Clock = std::chrono::steady_clock;

struct Options {
  std::string bus = cli::kUsualBus, json, key_file;
  double duration_s = 0;
  bool once = false;
};

constexpr double kOnce_s = 3;
constexpr std::chrono::milliseconds kRefresh(500);

// Over the last picture: lines that have become shorter, and what is below, are cleared.
void redraw(const std::string& url, const std::string& table) {
  std::string screen = "\033[H" + url + "\n\n" + table;
  for (std::size_t end = screen.find('\n'); end != screen.npos; end = screen.find('\n', end + 4)) {
    screen.insert(end, "\033[K");
  }
  std::cout << screen << "\033[J" << std::flush;
}

Heard listen(const Options& o, std::optional<std::map<std::string, std::int64_t>>& refused) {
  const auto tell = [](const std::string& line) { std::cerr << "angio-spy: " << line << "\n"; };
  const auto bus = withKeyFile(openSharedBus(o.bus), o.key_file, tell);
  if (const auto warning = unprotectedWarning(o.bus, o.key_file)) std::cerr << "angio-spy: " << *warning << "\n";
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-spy: " << *warning << "\n";
  BusMonitor monitor;
  bus->subscribeAll([&](const std::string& channel, const std::uint8_t* data, std::size_t size) {
    monitor.hear(channel, data, size, monotonic_us());
  });
  const bool live = !o.once && isatty(STDOUT_FILENO) == 1;
  const double duration_s = o.duration_s > 0 ? o.duration_s : o.once ? kOnce_s : 0;
  const RunTime run(duration_s);
  auto next = Clock::now();
  if (live) std::cout << "\033[2J";
  while (!run.over() && !bus->ended()) {
    bus->handle(std::chrono::milliseconds(50));
    if (live && Clock::now() >= next) {
      redraw(o.bus, monitorTable(heardBy(monitor, monotonic_us())));
      next = Clock::now() + kRefresh;
    }
  }
  if (live) std::cout << "\033[H\033[J";
  if (const auto* keyed = dynamic_cast<const AuthenticatedBus*>(bus.get())) refused = keyed->causes();
  return heardBy(monitor, monotonic_us());
}

// A log tells its own time, so its rates are those of the recording.
Heard readLog(const std::string& path) {
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
  return heardBy(monitor, last_us);
}

int spy(const Options& o) {
  requireFolderOf(o.json);
  const auto log = logFileOf(o.bus);
  if (log && !o.key_file.empty()) {
    throw InputError("command line", "--key-file", o.key_file, "is for a live bus: logs hold plain messages");
  }
  std::optional<std::map<std::string, std::int64_t>> refused;  // By cause; nothing without a key.
  const Heard heard = log ? readLog(*log) : listen(o, refused);
  auto numbers = monitorAsJson(heard);
  if (refused) numbers["unauthenticated"] = *refused;
  if (!o.json.empty()) writeWholeFile(o.json, numbers.dump(2) + "\n");
  std::cout << monitorTable(heard);
  if (refused && refused->empty()) std::cout << "every message that must have one had a valid envelope\n";
  for (const auto& [cause, times] : refused.value_or(std::map<std::string, std::int64_t>())) {
    std::cout << formatted("refused %lld messages: ", count(times)) << cause << "\n";
  }
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Shows what is on a bus: channels, rates, gaps, delays and last values. Ends with a table.",
                          "angio-spy");
  angio::apps::describeProgram(app, "angio-spy --bus 'file://run.lcm?speed=0' --json run.json");
  angio::apps::Options o;
  app.addOption("--bus", o.bus,
                angio::cli::busHelp("Bus to listen on") + "; file://name.lcm?speed=0 reads a whole log at once");
  app.addOption("--key-file", o.key_file,
                "Key that the programs on the bus share: shows only what has a valid envelope, and says what had none");
  app.addOption("--duration-s", o.duration_s, "How long; 0: until stopped, or 3 with --once")
      ->check(angio::apps::between(0, 86400));
  app.addFlag("--once", o.once, "Only the table at the end, also in a terminal");
  app.addOption("--json", o.json, "File for the same numbers");
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::spy(o); });
}
