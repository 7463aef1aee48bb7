// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

namespace angio::cli {

/// The bus of programs on this machine, unless an option names another.
constexpr const char* kUsualBus = "udpm://239.255.76.67:7667?ttl=0";

/// The text of --help for --key-file.
constexpr const char* kKeyFileHelp =
    "Key that the programs on the bus share (32 bytes or more, its owner's alone): unsigned messages are refused";

/// The text of --help for an option that takes the URL of a bus. @param what  What the program does on it.
inline std::string busHelp(const std::string& what) {
  return what +
         " (LCM URL): udpm://GROUP:PORT?ttl=0 is this machine alone, ttl=1 the local network; "
         "&recv_buf_size=BYTES is the receive buffer (4194304 unless given; at most net.core.rmem_max)";
}

}  // namespace angio::cli
