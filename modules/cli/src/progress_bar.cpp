// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/cli/progress_bar.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace angio::cli {
namespace {

constexpr int kWidth = 32;
constexpr double kShortWork_s = 2.0;  // Work that is over by then needs no bar.

}  // namespace

ProgressBar::ProgressBar(std::string title, int total)
    : title_(std::move(title)),
      total_(std::max(1, total)),
      terminal_(isatty(STDERR_FILENO) == 1),
      began_(std::chrono::steady_clock::now()),
      last_(began_) {}

ProgressBar::~ProgressBar() {
  if (drawn_) std::fprintf(stderr, "\r\033[K");
}

void ProgressBar::show(int done, const std::string& note) {
  if (!terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  const double elapsed_s = std::chrono::duration<double>(now - began_).count();
  const double share = std::clamp(static_cast<double>(done) / total_, 0.0, 1.0);
  // Worth showing once it is known to be long: from the first half second on when the estimate says so.
  const double expected_s = share > 0 ? elapsed_s / share : 0;
  if (elapsed_s < 0.5 || expected_s < kShortWork_s) return;
  if (drawn_ && done < total_ && std::chrono::duration<double>(now - last_).count() < 0.1) return;
  last_ = now;
  drawn_ = true;
  std::string bar(static_cast<std::size_t>(kWidth * share + 0.5), '#');
  bar.resize(kWidth, '.');
  std::fprintf(stderr, "\r\033[K%s [%s] %3.0f %% %3.0f s left  %s", title_.c_str(), bar.c_str(), 100 * share,
               expected_s - elapsed_s, note.c_str());
  std::fflush(stderr);
}

}  // namespace angio::cli
