// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <utility>

namespace angio::apps {

/// Tells on stderr, a line each, what the user of a loop on a bus should know beside its answers to frames.
class LoopWarnings {
 public:
  /// @param program  Its name, at the beginning of each line.
  explicit LoopWarnings(std::string program) : program_(std::move(program)) {}

  /// To be called after each SupervisedNode::answer(). Tells SupervisedNode::trouble(), again only when it is another
  /// one, and once what the frames say against their focal length.
  template <typename Node>
  void tell(const Node& node) {
    tellTrouble(node.trouble());
    tellFocalLength(node.loop().focalLengthWarning());
  }

 private:
  void tellTrouble(const std::optional<std::string>& trouble);
  void tellFocalLength(const std::optional<std::string>& warning);

  std::string program_, told_trouble_;
  bool told_focal_length_ = false;
};

/// The line without its digits: two lines that differ in numbers only say the same.
std::string withoutNumbers(const std::string& line);

}  // namespace angio::apps
