// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cctype>
#include <iostream>
#include <optional>
#include <string>
#include <utility>

namespace angio::apps {

/// The line without its digits: two lines that differ in numbers only say the same.
inline std::string withoutNumbers(std::string line) {
  const auto digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  line.erase(std::remove_if(line.begin(), line.end(), digit), line.end());
  return line;
}

/// Tells on stderr, a line each, what the user of a loop on a bus should know beside its answers to frames.
class LoopWarnings {
 public:
  /// @param program  Its name, at the beginning of each line.
  explicit LoopWarnings(std::string program) : program_(std::move(program)) {}

  /// To be called after each SupervisedNode::answer(). Tells SupervisedNode::trouble(), again only when it is another
  /// one, and once what the frames say against their focal length.
  template <typename Node>
  void tell(const Node& node) {
    const std::optional<std::string>& trouble = node.trouble();
    const std::string before = std::exchange(told_trouble_, withoutNumbers(trouble.value_or("")));
    if (trouble && told_trouble_ != before) std::cerr << program_ << ": " << *trouble << "\n";
    const auto warning = node.loop().focalLengthWarning();
    if (warning && !std::exchange(told_focal_length_, true)) std::cerr << program_ << ": " << *warning << "\n";
  }

 private:
  std::string program_, told_trouble_;
  bool told_focal_length_ = false;
};

}  // namespace angio::apps
