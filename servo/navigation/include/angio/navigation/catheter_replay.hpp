// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "angio/navigation/catheter_guide.hpp"
#include "angio/servo/replay.hpp"

namespace angio {

/// One frame of a catheter's log as it was answered again.
struct ReplayedCatheterFrame {
  const CatheterGuideReport& report;      ///< Borrowed for the call.
  std::optional<CatheterCommand> logged;  ///< What was commanded then, when the log holds it.
  double part = 0;                        ///< How much of the replay is done, 0 to 1.
};
using CatheterReplayWatcher = std::function<void(const ReplayedCatheterFrame&)>;

/// Sends a log through a catheter's guide again, as replay() does through the C-arm's loop: what CATHETER_INPUT names,
/// in its order. A command's sequence that begins again is a guide that was started again.
///
/// Throws InputError when the log cannot be read or holds no frame with its CATHETER_INPUT, and as CatheterGuide does.
ReplaySummary replayCatheter(const std::string& log_path, const CatheterStage& stage, const VesselTree& tree,
                             const TreePlace& start, const TreePlace& target, const CatheterGuideSettings& settings,
                             const CatheterReplayWatcher& watcher = {});

/// The first field in which two commands differ, in words with both values; nothing when all bits are equal.
std::optional<std::string> difference(const CatheterCommand& replayed, const CatheterCommand& logged);

}  // namespace angio
