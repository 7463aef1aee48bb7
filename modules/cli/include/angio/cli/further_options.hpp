// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

namespace angio::cli {

/// Group of the options that --help leaves to --help-all: `option->group(kFurtherOptions)`.
constexpr const char* kFurtherOptions = "Further options";

}  // namespace angio::cli
