// SPDX-License-Identifier: GPL-2.0-or-later
// A libFuzzer program for all readers: ANGIO_FUZZ_READER names the one that it tries.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "angio/test/temporary_folder.hpp"
#include "readers.hpp"

namespace {

using angio::test::FileReader;

const FileReader* chosen = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* const name = std::getenv("ANGIO_FUZZ_READER");
  for (const FileReader& reader : angio::test::fileReaders()) {
    if (name && reader.name == name) chosen = &reader;
  }
  if (chosen) return 0;
  std::fputs("ANGIO_FUZZ_READER must be one of", stderr);
  for (const FileReader& reader : angio::test::fileReaders()) std::fprintf(stderr, " %s", reader.name.c_str());
  std::fputs("\n", stderr);
  std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static const angio::test::TemporaryFolder folder;
  static const std::string path = angio::test::placeIn(folder.path(), *chosen);
  std::string content(reinterpret_cast<const char*>(bytes), size);
  if (chosen->mended) content = chosen->mended(std::move(content));
  std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
  angio::test::isRefused(*chosen, path);  // Anything else that is thrown ends the program, which is a finding.
  return 0;
}
