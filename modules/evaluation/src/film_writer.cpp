// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/film_writer.hpp"

#include <unistd.h>

#include <filesystem>
#include <opencv2/videoio.hpp>
#include <regex>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/image_files.hpp"
#include "film_check.hpp"

namespace angio::evaluation {

class FilmOutput {
 public:
  virtual ~FilmOutput() = default;
  virtual void write(const cv::Mat& picture) = 0;
  virtual void finish() = 0;
  int pictures = 0;
};

namespace {

namespace fs = std::filesystem;

// Numbered pictures.
class Pictures final : public FilmOutput {
 public:
  explicit Pictures(const std::string& pattern) : pattern_(pattern) {}
  void write(const cv::Mat& picture) override {
    writeImage(formatted(pattern_.c_str(), pictures), picture);
    ++pictures;
  }
  void finish() override {}

 private:
  std::string pattern_;
};

// MPEG-4 part 2 in an MP4 file: what Debian's OpenCV writes without other packages, and every player plays.
class Film final : public FilmOutput {
 public:
  Film(const std::string& path, double frame_rate_hz)
      : path_(path), partial_(path + ".partial-" + std::to_string(getpid()) + ".mp4"), rate_hz_(frame_rate_hz) {}
  ~Film() override {
    writer_.release();
    std::error_code ignored;
    fs::remove(partial_, ignored);
  }

  void write(const cv::Mat& picture) override {
    if (pictures == 0) {
      size_ = picture.size();
      const int codec = cv::VideoWriter::fourcc('m', 'p', '4', 'v');
      if (!writer_.open(partial_, cv::CAP_FFMPEG, codec, rate_hz_, size_)) {
        throw InputError(path_, "", "", "cannot be written as a film");
      }
    }
    if (picture.size() != size_) throw InputError(path_, "picture", "", "must have the size of the first one");
    writer_.write(picture);
    ++pictures;
  }

  void finish() override {
    if (pictures == 0) throw InputError(path_, "", "", "would be a film without pictures");
    writer_.release();
    if (!isWholeFilm(partial_, pictures)) {
      throw InputError(path_, "", "", "cannot be written whole: is the disk full?");
    }
    std::error_code error;
    fs::rename(partial_, path_, error);
    if (error) throw InputError(path_, "", "", "cannot be written: " + error.message());
  }

 private:
  std::string path_, partial_;
  double rate_hz_;
  cv::Size size_;
  cv::VideoWriter writer_;
};

}  // namespace

FilmWriter::FilmWriter(const std::string& path, double frame_rate_hz) {
  requireBetween(path, "frame_rate_hz", frame_rate_hz, 0.1, 1000);
  const fs::path folder = fs::path(path).parent_path();
  std::error_code ignored;
  if (!folder.empty() && !fs::is_directory(folder, ignored))
    throw InputError(path, "", "", "its folder does not exist");
  static const std::regex kNumbered(R"([^%]*%(0[1-9])?d[^%]*\.(png|jpg))"), kFilm(R"([^%]*\.mp4)");
  if (std::regex_match(path, kNumbered)) {
    output_ = std::make_unique<Pictures>(path);
  } else if (std::regex_match(path, kFilm)) {
    output_ = std::make_unique<Film>(path, frame_rate_hz);
  } else {
    throw InputError(path, "", "", "must be film.mp4, or pictures such as frame%04d.png");
  }
}

FilmWriter::FilmWriter(FilmWriter&&) noexcept = default;
FilmWriter& FilmWriter::operator=(FilmWriter&&) noexcept = default;
FilmWriter::~FilmWriter() = default;

void FilmWriter::write(const cv::Mat& picture) { output_->write(picture); }
void FilmWriter::finish() { output_->finish(); }
int FilmWriter::pictures() const { return output_->pictures; }

}  // namespace angio::evaluation
