// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <string>

#include "angio/cli/namespace.hpp"

namespace angio::cli {

/// A progress bar on stderr for work of more than two seconds; silent when stderr is no terminal.
class ProgressBar {
 public:
  /// @param title  What is going on. @param total  How many steps there are, at least 1.
  ProgressBar(std::string title, int total);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar();  ///< Clears the line.

  /// `done` of the steps are behind us; `note` stands at the end of the line.
  void show(int done, const std::string& note = "");

 private:
  std::string title_;
  int total_;
  bool terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point began_, last_;
};

}  // namespace angio::cli
