// SPDX-License-Identifier: GPL-2.0-or-later
// What a check of a machine has found, row by row.
#include <algorithm>

#include "angio/base/formatted.hpp"
#include "angio/perception/frame_geometry.hpp"
#include "angio/types/channels.hpp"
#include "angio/types/time_stamp.hpp"
#include "machine_check_parts.hpp"

namespace angio::machine_check {
namespace {

constexpr double kMaxFrameAge_s = 0.3;  // What the supervisor lets pass.

}  // namespace

void MachineCheck::Parts::checkStates(std::vector<CheckRow>& rows) const {
  const char* name = kCArmStateChannel;
  rows.insert(rows.end(), {states.rateRow(name, 50, 200), states.sequenceRow(name), states.clockRow(name)});
  const std::string asked = "radians and metres, within the limits";
  if (states.count() == 0) {
    rows.push_back({"joints", CheckVerdict::kNotSeen, "no state came", asked});
  } else if (implausible) {
    rows.push_back({"joints", CheckVerdict::kFail, *implausible, asked});
  } else {
    std::string measured;
    for (int i = 0; i < kCArmJointCount; ++i) {
      measured += (i ? ", " : "") + inUnits(i, history.newest()->joints[i]);
    }
    rows.push_back({"joints", CheckVerdict::kPass, measured, asked});
  }
}

void MachineCheck::Parts::checkFrames(std::vector<CheckRow>& rows) const {
  const char* name = kXrayFrameChannel;
  rows.insert(rows.end(), {frames.rateRow(name, 3, 60), frames.sequenceRow(name), frames.clockRow(name)});
  const std::string late = "of the states' clock, and 300 ms late at most";
  const std::string focal = "fx is distance / spacing, and all is the calibration's, within 1 %";
  if (!newest_frame) {
    rows.push_back({"frame age", CheckVerdict::kNotSeen, "no frame came", late});
    rows.push_back({"frame geometry", CheckVerdict::kNotSeen, "no frame came", focal});
    return;
  }
  if (states.count() == 0) {
    rows.push_back({"frame age", CheckVerdict::kNotSeen, "no state came", late});
  } else {
    const auto far = differentEpochs({kXrayFrameChannel, "", newest_frame->time_us},
                                     {kCArmStateChannel, "", history.newest()->time_us});
    const std::string ages = formatted("%.0f ms behind the newest state, %.0f ms at most",
                                       1e3 * sum_age_s / static_cast<double>(frames.count()), 1e3 * oldest_frame_s);
    rows.push_back(verdictRow("frame age", oldest_frame_s <= kMaxFrameAge_s, far.value_or(ages), late));
  }
  const auto wrong = contradiction(newest_frame->camera, settings.carm);
  const XrayCamera::Parameters& k = newest_frame->camera.parameters();
  rows.push_back(verdictRow("frame geometry", !wrong,
                            wrong.value_or(formatted("%d x %d px, fx %.1f px", k.width_px, k.height_px, k.fx_px)),
                            focal));
}

std::vector<CheckRow> MachineCheck::rows() const {
  const Parts& p = *parts_;
  std::vector<CheckRow> rows;
  p.checkStates(rows);
  p.checkFrames(rows);
  rows.push_back(p.image.orientationRow());
  if (!p.settings.move) {
    rows.push_back({"motion", CheckVerdict::kNotSeen, "it was not to be moved", "--move"});
    return rows;
  }
  rows.insert(rows.end(), p.found.begin(), p.found.end());
  const auto add = [&](CheckRow row, bool moved) {
    if (!moved) row.verdict = CheckVerdict::kNotSeen, row.measured = "it did not move";
    rows.push_back(row);
  };
  const double share = p.velocity_share.value_or(0), latency_s = p.latency_s.value_or(0);
  add(verdictRow("velocities", asExpected(share), formatted("%.2f of the motion, of the worst joint", share),
                 "joint_velocity is what joint_position changes by, 0.75 to 1.3 times"),
      p.velocity_share.has_value());
  add(verdictRow("latency", latency_s <= kMaxLatency_s, formatted("%.0f ms", 1e3 * latency_s),
                 formatted("%.0f ms at most from a command to motion", 1e3 * kMaxLatency_s)),
      p.latency_s.has_value());
  return rows;
}

bool passed(const std::vector<CheckRow>& rows) {
  return std::none_of(rows.begin(), rows.end(), [](const CheckRow& r) { return r.verdict == CheckVerdict::kFail; });
}

std::string table(const std::vector<CheckRow>& rows) {
  static constexpr const char* kVerdicts[] = {"pass", "FAIL", "not seen"};
  std::string text;
  for (const CheckRow& r : rows) {
    text += formatted("%-8s  %-24s  ", kVerdicts[static_cast<int>(r.verdict)], r.name.c_str()) + r.measured;
    if (r.verdict == CheckVerdict::kFail) text += "  (asked: " + r.asked + ")";
    text += "\n";
  }
  return text;
}

}  // namespace angio::machine_check
