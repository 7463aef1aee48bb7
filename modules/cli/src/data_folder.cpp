// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/cli/data_folder.hpp"

#include <filesystem>

namespace angio::cli {

std::string exampleDataFile(const std::string& name) {
  std::error_code ignored;
  const auto programs = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
  const auto in_checkout = programs / ".." / ".." / "examples" / "data" / name;
  const auto installed = programs / ".." / "share" / "angio" / "data" / name;
  const auto chosen = std::filesystem::exists(installed, ignored) ? installed : in_checkout;
  return chosen.lexically_normal().string();
}

}  // namespace angio::cli
