// SPDX-License-Identifier: GPL-2.0-or-later
#include "loop_warnings.hpp"

#include <cctype>
#include <iostream>
#include <utility>

namespace angio::apps {

std::string withoutNumbers(const std::string& line) {
  std::string words;
  for (const char c : line) {
    if (std::isdigit(static_cast<unsigned char>(c)) == 0) words += c;
  }
  return words;
}

void LoopWarnings::tellTrouble(const std::optional<std::string>& trouble) {
  std::string words = withoutNumbers(trouble.value_or(""));
  if (trouble && words != told_trouble_) std::cerr << program_ << ": " << *trouble << "\n";
  told_trouble_ = std::move(words);
}

void LoopWarnings::tellFocalLength(const std::optional<std::string>& warning) {
  if (!warning || std::exchange(told_focal_length_, true)) return;
  std::cerr << program_ << ": " << *warning << "\n";
}

}  // namespace angio::apps
