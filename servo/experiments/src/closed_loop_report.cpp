// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/base/fnv1a.hpp"
#include "angio/base/formatted.hpp"
#include "angio/experiments/closed_loop.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"
#include "angio/results/overlay.hpp"

namespace angio::experiments {
namespace {

Json errorAsJson(const ViewError& e) {
  return {{"view_deg", radToDeg(e.direction_rad)}, {"target_mm", 1e3 * e.target_m}, {"roll_deg", radToDeg(e.roll_rad)}};
}

cv::Mat overlayOf(const ClosedLoopSnapshot& snapshot, const VesselTree& tree, const std::string& when) {
  OverlayScene scene;
  scene.image = snapshot.frame.image;
  scene.centerline = &snapshot.centerline;
  scene.trees.push_back({snapshot.predicted_T_camera_model, {}, kStartColor, "tree where the calibration puts it"});
  const RegistrationResult& r = snapshot.registration;
  const StatusStyle style = statusStyle(r.status);
  scene.trees.push_back({r.T_camera_model, r.displacements_m, style.color_bgr, "tree as registered: " + style.words});
  scene.R_camera_lps = snapshot.R_camera_lps;
  scene.caption = when + ": " + alignmentInWords(r.alignment);
  return drawOverlay(scene, tree, snapshot.frame.camera);
}

// Of the bits of all commands: two runs with the same one moved the arm alike, bit for bit.
std::string fingerprintOf(const std::vector<ClosedLoopFrame>& frames) {
  Fnv1a hash;
  for (const auto& f : frames) {
    const CArmCommand& c = f.command;
    for (const std::int64_t number : {c.time_us, c.sequence, c.frame_sequence, c.valid_for_us}) hash.add(number);
    hash.add(c.velocity.data(), sizeof(double) * kCArmJointCount);
  }
  return formatted("%016llx", static_cast<unsigned long long>(hash.value()));
}

PlotSeries seriesOf(const std::vector<ClosedLoopFrame>& frames, const std::string& name, int color,
                    double (*value)(const ClosedLoopFrame&)) {
  PlotSeries s{name, {}, {}, color};
  for (const auto& f : frames) {
    s.x.push_back(f.time_s);
    s.y.push_back(value(f));
  }
  return s;
}

// Errors of a task without a view to reach: the target's image from its place, in the second half of the run. What came
// before was still learnt from.
Json offAsJson(const std::vector<ClosedLoopFrame>& frames) {
  Json off_mm = Json::array();
  for (std::size_t k = frames.size() / 2; k < frames.size(); ++k) off_mm.push_back(1e3 * frames[k].target_off_m);
  return {{"rms_mm", figuresOf(off_mm, "rms")}, {"worst_mm", figuresOf(off_mm, "max")}};
}

// What the task is about, open against closed.
std::vector<Plot> errorPlots(const ClosedLoopRun& r) {
  const auto plot = [&](const char* title, const char* unit, double (*value)(const ClosedLoopFrame&)) {
    return Plot{title,
                {},
                {unit, true},
                {seriesOf(r.open, "open loop", 1, value), seriesOf(r.closed, "closed loop", 0, value)}};
  };
  if (!r.has_view) {
    return {plot("True distance of the target's image from its place, at the isocentre", "mm",
                 [](const ClosedLoopFrame& f) { return 1e3 * f.target_off_m; })};
  }
  return {plot("True error of the view: direction of the beam", "deg",
               [](const ClosedLoopFrame& f) { return radToDeg(f.true_error.direction_rad); }),
          plot("True error of the view: target from its place", "mm",
               [](const ClosedLoopFrame& f) { return 1e3 * f.true_error.target_m; })};
}

cv::Mat plotOf(const ClosedLoopRun& r) {
  std::vector<Plot> plots = errorPlots(r);
  plots.push_back(
      {"Commanded joint velocities, angles",
       {},
       {"deg/s"},
       {seriesOf(r.closed, "primary", 0, [](const ClosedLoopFrame& f) { return radToDeg(f.command.velocity[0]); }),
        seriesOf(r.closed, "secondary", 1, [](const ClosedLoopFrame& f) { return radToDeg(f.command.velocity[1]); })}});
  plots.push_back(
      {"Commanded joint velocities, table",
       {"time [s]"},
       {"mm/s"},
       {seriesOf(r.closed, "table x (left)", 2, [](const ClosedLoopFrame& f) { return 1e3 * f.command.velocity[2]; }),
        seriesOf(r.closed, "table y (down)", 3, [](const ClosedLoopFrame& f) { return 1e3 * f.command.velocity[3]; }),
        seriesOf(r.closed, "table z (head)", 4,
                 [](const ClosedLoopFrame& f) { return 1e3 * f.command.velocity[4]; })}});
  return drawPlots(plots, 940, 230);
}

// First frame, last frame and plot on one sheet: what a newcomer sees first.
cv::Mat sheetOf(const cv::Mat& first, const cv::Mat& last, const cv::Mat& plot) {
  cv::Mat below, sheet;
  const int half_px = 620;
  // Their captions may have different numbers of lines.
  const auto half = [&](const cv::Mat& picture) {
    cv::Mat resized;
    cv::resize(picture, resized, {half_px, half_px * picture.rows / picture.cols}, 0, 0, cv::INTER_AREA);
    return resized;
  };
  const cv::Mat pictures = sideBySide({half(first), half(last)});
  cv::resize(plot, below, {2 * half_px, plot.rows * 2 * half_px / plot.cols}, 0, 0, cv::INTER_CUBIC);
  cv::vconcat(pictures, below, sheet);
  return sheet;
}

// In a column of its own: without what parts columns.
std::string quotable(const std::optional<std::string>& reason) {
  std::string text = reason.value_or("");
  std::replace(text.begin(), text.end(), ',', ';');
  std::replace(text.begin(), text.end(), '"', '\'');
  return text;
}

}  // namespace

Json closedLoopSummary(const ClosedLoopRun& r) {
  using F = const ClosedLoopFrame&;
  Json summary = {{"frames", r.closed.size()}};
  summarise(r.closed,
            {{"", "registered", "sum", [](F f) { return f.status == RegistrationStatus::kConverged; }},
             {"", "held", "sum", [](F f) { return f.hold_reason.has_value(); }}},
            summary);
  summary["commands_fingerprint"] = fingerprintOf(r.closed);
  if (!r.closed.empty()) {
    const ClosedLoopFrame& last = r.closed.back();
    if (const auto& said = last.hold_reason ? last.hold_reason : last.task.remark) summary["said_last"] = *said;
  }
  if (r.has_view) {
    summary["final_error"] = {{"closed_loop", errorAsJson(r.closed_end)}, {"open_loop", errorAsJson(r.open_end)}};
    const auto settled_s = settlingTime_s(r);
    summary["settled_s"] = settled_s ? Json(*settled_s) : Json(nullptr);
    summary["way"] = {{"table_excursion_mm", 1e3 * r.max_table_excursion_m},
                      {"target_excursion_mm", 1e3 * r.max_target_excursion_m}};
  } else {
    summary["target_off"] = {{"closed_loop", offAsJson(r.closed)}, {"open_loop", offAsJson(r.open)}};
  }
  if (r.predicted) {
    summary["predicted_uncertainty"] = {{"view_deg", radToDeg(r.predicted->direction_rad)},
                                        {"target_mm", 1e3 * r.predicted->target_m}};
  }
  const char* figures = "p50 p99 max";
  summarise(r.closed,
            {{"", "latency_ms/render", figures, [](F f) { return 1e3 * f.render_s; }},
             {"", "latency_ms/image_to_centreline", figures, [](F f) { return 1e3 * f.image_s; }},
             {"", "latency_ms/registration", figures, [](F f) { return 1e3 * f.registration_s; }},
             {"", "latency_ms/control", figures, [](F f) { return 1e3 * f.control_s; }},
             {"", "latency_ms/frame_to_command", figures, [](F f) { return 1e3 * f.answer_s; }}},
            summary);
  return summary;
}

std::string closedLoopTable(const Json& summary) {
  std::string table =
      filled("{frames:%d} frames, {registered:%d} registered, {held:%d} held; commands {commands_fingerprint:%s}\n\n",
             summary);
  if (summary.contains("said_last")) table += filled("the last frame: {said_last:%s}\n\n", summary);
  if (summary.contains("target_off")) {
    table += filled(
        "target off its place       rms [mm]   worst [mm]\n"
        "closed loop            {closed_loop/rms_mm:%12.3f} {closed_loop/worst_mm:%12.3f}\n"
        "open loop              {open_loop/rms_mm:%12.3f} {open_loop/worst_mm:%12.3f}\n"
        "(the second half of the run, seen from the source at the isocentre's distance)\n",
        summary["target_off"]);
  } else {
    table += "final view error         view [deg]  target [mm]   roll [deg]\n";
    const std::string cells = "{view_deg:%12.3f} {target_mm:%12.3f} {roll_deg:%12.3f}\n";
    table += "closed loop            " + filled(cells, summary["final_error"]["closed_loop"]);
    table += "open loop              " + filled(cells, summary["final_error"]["open_loop"]);
    table += "settling time          ";
    table += summary["settled_s"].is_null() ? std::string("not settled\n") : filled("{settled_s:%10.2f} s\n", summary);
    table += filled(
        "way                    table at most {way/table_excursion_mm:%.1f} mm outside start and goal, target at most "
        "{way/target_excursion_mm:%.1f} mm further than at the start\n",
        summary);
  }
  if (summary.contains("predicted_uncertainty")) {
    table += filled("calibration's sigma    {view_deg:%12.3f} {target_mm:%12.3f}\n", summary["predicted_uncertainty"]);
  }
  table += "\nlatency                    p50 [ms]     p99 [ms]     max [ms]\n";
  for (const auto& [stage, t] : summary["latency_ms"].items()) {
    table += formatted("%-22s ", stage.c_str()) + filled("{p50:%12.2f} {p99:%12.2f} {max:%12.2f}\n", t);
  }
  return table;
}

std::string closedLoopTrace(const ClosedLoopRun& r) {
  std::string trace =
      "time_s,primary_deg,secondary_deg,table_x_mm,table_y_mm,table_z_mm,primary_deg_per_s,secondary_deg_per_s,"
      "table_x_mm_per_s,table_y_mm_per_s,table_z_mm_per_s,view_error_deg,target_error_mm,roll_deg,seen_view_error_deg,"
      "seen_target_error_mm,open_loop_view_error_deg,open_loop_target_error_mm,target_off_mm,open_loop_target_off_mm,"
      "status,held,model_residual_px,"
      "image_residual_px,points_2d,image_ms,registration_ms,control_ms,frame_to_command_ms,held_because,"
      "table_excursion_mm,target_excursion_mm\n";
  for (std::size_t k = 0; k < r.closed.size(); ++k) {
    const ClosedLoopFrame &f = r.closed[k], &o = r.open.at(k);
    trace += formatted("%.4f", f.time_s);
    const auto joints = [&](const CArmJoints& q) {
      for (int i = 0; i < kCArmJointCount; ++i) trace += formatted(",%.6f", i < 2 ? radToDeg(q[i]) : 1e3 * q[i]);
    };
    joints(f.joints);
    joints(f.command.velocity);
    trace += formatted(",%.5f,%.5f,%.5f", radToDeg(f.true_error.direction_rad), 1e3 * f.true_error.target_m,
                       radToDeg(f.true_error.roll_rad));
    trace += f.task.view_error ? formatted(",%.5f,%.5f", radToDeg(f.task.view_error->direction_rad),
                                           1e3 * f.task.view_error->target_m)
                               : ",,";
    trace += formatted(",%.5f,%.5f,%.4f,%.4f,%s,%d,%.4f,%.4f,%d,%.3f,%.3f,%.3f,%.3f,\"%s\",%.4f,%.4f\n",
                       radToDeg(o.true_error.direction_rad), 1e3 * o.true_error.target_m, 1e3 * f.target_off_m,
                       1e3 * o.target_off_m, statusName(f.status).c_str(), f.hold_reason ? 1 : 0, f.model_residual_px,
                       f.image_residual_px, f.points_2d, 1e3 * f.image_s, 1e3 * f.registration_s, 1e3 * f.control_s,
                       1e3 * f.answer_s, quotable(f.hold_reason).c_str(), 1e3 * f.table_excursion_m,
                       1e3 * f.target_excursion_m);
  }
  return trace;
}

void writeClosedLoop(const std::string& folder, const ClosedLoopRun& run, const VesselTree& tree, const Json& summary) {
  const std::string base = folder + "/";
  const cv::Mat first = overlayOf(*run.first, tree, "first frame");
  const cv::Mat last = overlayOf(*run.last, tree, "last frame"), plot = plotOf(run);
  writeImage(base + "overlay_first.png", first);
  writeImage(base + "overlay_last.png", last);
  writeImage(base + "plot.png", plot);
  writeImage(base + "sheet.jpg", sheetOf(first, last, plot));
  writeWholeFile(base + "trace.csv", closedLoopTrace(run));
  writeWholeFile(base + "summary.json", summary.dump(2) + "\n");
}

}  // namespace angio::experiments
