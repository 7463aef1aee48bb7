// SPDX-License-Identifier: GPL-2.0-or-later
// A libFuzzer program for the nodes on a bus: each input is datagrams one after another.
#include "node_datagrams.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static angio::test::NodesOnSocket nodes;
  nodes.receive(bytes, size);  // What it throws ends the program, which is a finding.
  return 0;
}
