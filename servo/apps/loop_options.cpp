// SPDX-License-Identifier: GPL-2.0-or-later
#include "loop_options.hpp"

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"

namespace angio::apps {

void LoopOptions::addTo(CLI::App& app) {
  const ServoSettings usual;
  const auto& view = usual.tasks.of<ViewTaskSettings>();
  app.add_option("--task", task, "What to do")->check(CLI::IsMember(usual.tasks.names()))->default_str("view");
  app.add_option("--view-primary-deg", view_primary_deg, "Desired view of the anatomy: LAO positive, RAO negative")
      ->check(between(-110, 110))
      ->default_str(formatValue(view.primary_deg));
  app.add_option("--view-secondary-deg", view_secondary_deg, "Desired view of the anatomy: CRA positive, CAU negative")
      ->check(between(-55, 55))
      ->default_str(formatValue(view.secondary_deg));
  app.add_option("--view-from", view_from,
                 "Who says which view: settings (or the angles here), or bus: VIEW_REQUEST, as of angio-navigate")
      ->check(CLI::IsMember({"settings", "bus"}))
      ->default_str("settings");
  app.add_option("--perception", perception,
                 "Who registers frames: own, or bus: another program says REGISTRATION of each (angio-register --bus)")
      ->check(CLI::IsMember({"own", "bus"}))
      ->default_str("own");
  app.add_option(
         "--centre-on", center_on,
         "What centre keeps: target, a point of the tree, or catheter_tip, of which angio-navigate says where it is")
      ->check(CLI::IsMember({"target", "catheter_tip"}))
      ->default_str("target");
}

bool LoopOptions::given() const {
  return !(task.empty() && view_from.empty() && perception.empty() && center_on.empty()) || view_primary_deg ||
         view_secondary_deg;
}

void LoopOptions::applyTo(ServoSettings& settings) const {
  if (!task.empty()) settings.tasks.choose(task);
  ViewTaskSettings& view = settings.tasks.of<ViewTaskSettings>();
  view.primary_deg = view_primary_deg.value_or(view.primary_deg);
  view.secondary_deg = view_secondary_deg.value_or(view.secondary_deg);
  if (view_from == "bus") {
    const TaskSettings chosen = settings.tasks.chosen();
    if (!std::holds_alternative<ViewTaskSettings>(chosen)) {
      throw InputError("command line", "--view-from", view_from, "needs the task view, and not " + nameOf(chosen));
    }
    view.goal = ViewGoal::kRequested;
  }
  if (!perception.empty()) {
    settings.perception = perception == "bus" ? ServoSettings::Perceiver::kBus : ServoSettings::Perceiver::kOwn;
  }
  if (!center_on.empty()) {
    const TaskSettings chosen = settings.tasks.chosen();
    if (!std::holds_alternative<CenterTaskSettings>(chosen)) {
      throw InputError("command line", "--centre-on", center_on, "needs the task centre, and not " + nameOf(chosen));
    }
    settings.tasks.of<CenterTaskSettings>().on =
        center_on == "catheter_tip" ? CenterOn::kCatheterTip : CenterOn::kTarget;
  }
}

}  // namespace angio::apps
