// SPDX-License-Identifier: GPL-2.0-or-later
#include "servo_settings.hpp"

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/io/settings_files.hpp"

namespace angio::apps {

void ServoSettings::visit(SettingsVisitor& v) {
  const auto section = [&v](const char* key, auto& settings) {
    v.section(key, [&](SettingsVisitor& inner) { settings.visit(inner); });
  };
  section("scenario", scenario);
  section("fluoroscopy", patient);
  tasks.visit(v);
  laws.visit(v);
  v.number("latency_ms", latency_ms, 0, 2000);
  extractors.visit(v);
  v.choice("method", method, {OrientedKernelSettings::kName, IterativePnpSettings::kName});
  v.choice("perception", perception, {"own", "bus"});
  v.integer("starts", starts, 0, 100000);
  section(OrientedKernelSettings::kName, oriented_kernel);
  v.section(IterativePnpSettings::kName, [&](SettingsVisitor& inner) {
    inner.section("search", [&](SettingsVisitor& s) { search.visit(s); });
    inner.section("tracking", [&](SettingsVisitor& s) { tracking.visit(s); });
  });
  section("tracker", tracker);
  section("limits", limits);
  section("supervisor", supervisor);
  section("safety", safety);
}

ServoLoopSettings ServoSettings::loop(const CArmCalibration& calibrated) const {
  const CArmGeometry& carm = calibrated.carm;
  ServoLoopSettings loop;
  loop.carm = carm;
  loop.T_dsa_cb = calibrated.T_dsa_cb;
  loop.R_lps_model = calibrated.R_lps_model;
  loop.limits = limits.limits(carm.source_detector_distance_m - carm.source_isocenter_distance_m);
  loop.task = tasks.chosen();
  loop.law = laws.chosen();
  loop.latency_s = 1e-3 * latency_ms;
  loop.external_registration = perception == Perceiver::kBus;
  loop.perception.extractor = extractors.chosen();
  loop.perception.search = loop.perception.tracking = oriented_kernel;
  if (method == Method::kIterativePnp) {
    loop.perception.useIterativePnp();
    loop.perception.search = search;
    loop.perception.tracking = tracking;
  }
  if (starts > 0) loop.perception.search_starts.count = starts;
  loop.perception.tracker = tracker;
  loop.supervisor = supervisor;
  loop.safety = safety;
  return loop;
}

ServoSettings readServoSettings(const std::string& path, ServoSettings usual) {
  if (path.empty()) return usual;
  const ServoSettings settings = readSettings(path, usual);
  try {
    settings.limits.check();
  } catch (const InputError& error) {
    throw error.within(path);
  }
  return settings;
}

}  // namespace angio::apps
