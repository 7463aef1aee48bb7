// SPDX-License-Identifier: GPL-2.0-or-later
#include "spy_table.hpp"

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"

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

}  // namespace

std::string monitorTable(const std::vector<ChannelReport>& channels) {
  if (channels.empty()) return "no messages\n";
  std::string text = formatted("%-18s %-20s %8s %7s %9s %8s %5s %5s %6s %8s %8s %8s\n", "channel", "type", "messages",
                               "Hz", "kB/s", "missing", "twice", "late", "broken", "age s", "delay ms", "+- ms");
  for (const auto& channel : channels) text += row(channel);
  return text;
}

nlohmann::ordered_json monitorAsJson(const std::vector<ChannelReport>& channels) {
  nlohmann::ordered_json all = {{"channels", nlohmann::ordered_json::object()}};
  for (const auto& r : channels) {
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
  return all;
}

}  // namespace angio::apps
