// SPDX-License-Identifier: GPL-2.0-or-later
#include "film_check.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/videoio.hpp>
#include <string_view>

namespace angio::evaluation {
namespace {

bool isOnDisk(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool synced = ::fsync(file) == 0;
  return ::close(file) == 0 && synced;
}

// A file is a row of boxes: size (32 bit, big-endian, its 8 bytes of header included; 1: 64 bit behind the name), name
// (4 characters), content (ISO/IEC 14496-12, 4.2). The last ones end with the file, and "moov" is the index. The
// decoder would find this out as well, but say so on stderr.
bool hasWholeBoxes(const std::string& path) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  bool indexed = false;
  for (std::uint64_t at = 0; !error && at < size;) {
    std::array<unsigned char, 16> header{};
    file.seekg(static_cast<std::streamoff>(at));
    file.read(reinterpret_cast<char*>(header.data()), header.size());
    const auto got = file.gcount();
    file.clear();
    if (got < 8) return false;
    const auto number = [&](int begin, int count) {
      std::uint64_t value = 0;
      for (int i = 0; i < count; ++i) value = value << 8 | header[static_cast<std::size_t>(begin + i)];
      return value;
    };
    const std::uint64_t small = number(0, 4), box = small == 1 && got == 16 ? number(8, 8) : small;
    if (box < 8 || box > size - at) return false;
    indexed = indexed || std::string_view(reinterpret_cast<const char*>(&header[4]), 4) == "moov";
    at += box;
  }
  return indexed;
}

}  // namespace

bool isWholeFilm(const std::string& path, int pictures) {
  if (!isOnDisk(path) || !hasWholeBoxes(path)) return false;
  cv::VideoCapture film(path, cv::CAP_FFMPEG);
  if (!film.isOpened() || std::lround(film.get(cv::CAP_PROP_FRAME_COUNT)) != pictures) return false;
  film.set(cv::CAP_PROP_POS_FRAMES, pictures - 1);
  cv::Mat last;
  return film.read(last) && !last.empty();
}

}  // namespace angio::evaluation
