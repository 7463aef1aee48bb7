// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/film_writer.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/videoio.hpp>
#include <regex>
#include <string_view>

#include "angio/base/big_endian.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::results {
namespace {

namespace fs = std::filesystem;

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
    const std::uint64_t small = bigEndian<std::uint32_t>(&header[0]);
    const std::uint64_t box = small == 1 && got == 16 ? bigEndian<std::uint64_t>(&header[8]) : small;
    if (box < 8 || box > size - at) return false;
    indexed = indexed || std::string_view(reinterpret_cast<const char*>(&header[4]), 4) == "moov";
    at += box;
  }
  return indexed;
}

// Whether an MP4 file on its disk has this many pictures, of which the last can be read. A video writer does not say
// when a write failed.
bool isWholeFilm(const std::string& path, int pictures) {
  if (!isOnDisk(path) || !hasWholeBoxes(path)) return false;
  cv::VideoCapture film(path, cv::CAP_FFMPEG);
  if (!film.isOpened() || std::lround(film.get(cv::CAP_PROP_FRAME_COUNT)) != pictures) return false;
  film.set(cv::CAP_PROP_POS_FRAMES, pictures - 1);
  cv::Mat last;
  return film.read(last) && !last.empty();
}

}  // namespace

FilmWriter::FilmWriter(const std::string& path, double frame_rate_hz)
    : path_(path), partial_(path + ".partial-" + std::to_string(getpid()) + ".mp4"), rate_hz_(frame_rate_hz) {
  requireBetween(path, "frame_rate_hz", frame_rate_hz, 0.1, 1000);
  requireFolderOf(path);
  static const std::regex kNumbered(R"([^%]*%(0[1-9])?d[^%]*\.(png|jpg))"), kFilm(R"([^%]*\.mp4)");
  numbered_ = std::regex_match(path, kNumbered);
  if (!numbered_ && !std::regex_match(path, kFilm)) {
    throw InputError(path, "", "", "must be film.mp4, or pictures such as frame%04d.png");
  }
}

FilmWriter::~FilmWriter() {
  writer_.release();
  std::error_code ignored;
  fs::remove(partial_, ignored);
}

void FilmWriter::write(const cv::Mat& picture) {
  if (numbered_) {
    writeImage(formatted(path_.c_str(), pictures_), picture);
  } else {
    if (pictures_ == 0) {
      size_ = picture.size();
      // MPEG-4 part 2: what Debian's OpenCV writes without other packages, and every player plays.
      const int codec = cv::VideoWriter::fourcc('m', 'p', '4', 'v');
      if (!writer_.open(partial_, cv::CAP_FFMPEG, codec, rate_hz_, size_)) {
        throw InputError(path_, "", "", "cannot be written as a film");
      }
    }
    if (picture.size() != size_) throw InputError(path_, "picture", "", "must have the size of the first one");
    writer_.write(picture);
  }
  ++pictures_;
}

void FilmWriter::finish() {
  if (numbered_) return;
  if (pictures_ == 0) throw InputError(path_, "", "", "would be a film without pictures");
  writer_.release();
  if (!isWholeFilm(partial_, pictures_)) {
    throw InputError(path_, "", "", "cannot be written whole: is the disk full?");
  }
  std::error_code error;
  fs::rename(partial_, path_, error);
  if (error) throw InputError(path_, "", "", "cannot be written: " + error.message());
}

}  // namespace angio::results
