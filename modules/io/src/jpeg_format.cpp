// SPDX-License-Identifier: GPL-2.0-or-later
#include "jpeg_format.hpp"

#include <csetjmp>
#include <cstddef>
#include <cstdio>
// libjpeg's header needs the two before it.
#include <jpeglib.h>

#include <cstdlib>
#include <vector>

#include "angio/base/errors.hpp"
#include "dicom_pixels.hpp"

namespace angio::io {
namespace {

// Quantisation moves the colour differences of a grey picture by a few levels; drawings in colour differ by dozens.
constexpr int kMaxColorDifference = 16, kNoColor = 128;

// Scans are decoded one after the other over the whole image: more than a progressive file has cost time only.
constexpr int kMaxScans = 200;

// Everything libjpeg works on lives here, outside the functions that it may leave with longjmp: no destructor is
// skipped.
struct JpegReading {
  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg_progress_mgr progress{};
  std::jmp_buf at_error{};
  char message[JMSG_LENGTH_MAX] = "";
  bool colored = false;
  cv::Mat image;
  std::vector<JSAMPLE> row;

  JpegReading() = default;
  JpegReading(const JpegReading&) = delete;
  JpegReading& operator=(const JpegReading&) = delete;
  ~JpegReading() { jpeg_destroy_decompress(&jpeg); }
};

JpegReading& readingOf(j_common_ptr jpeg) { return *static_cast<JpegReading*>(jpeg->client_data); }

[[noreturn]] void onJpegError(j_common_ptr jpeg) {
  JpegReading& reading = readingOf(jpeg);
  jpeg->err->format_message(jpeg, reading.message);
  std::longjmp(reading.at_error, 1);
}

// A warning, level -1, is of data that are missing or damaged: libjpeg would go on with grey.
void onJpegMessage(j_common_ptr jpeg, int level) {
  if (level < 0) onJpegError(jpeg);
}

void onJpegProgress(j_common_ptr jpeg) {
  if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number > kMaxScans) jpeg->err->error_exit(jpeg);
}

// Holds no object with a destructor while libjpeg runs.
bool readJpegHeader(JpegReading& reading, std::string_view content) {
  jpeg_decompress_struct& jpeg = reading.jpeg;
  jpeg.err = jpeg_std_error(&reading.errors);
  jpeg.client_data = &reading;
  reading.errors.error_exit = onJpegError;
  reading.errors.emit_message = onJpegMessage;
  if (setjmp(reading.at_error)) return false;
  jpeg_create_decompress(&jpeg);
  reading.progress.progress_monitor = onJpegProgress;
  jpeg.progress = &reading.progress;
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(content.data()),
               static_cast<unsigned long>(content.size()));
  jpeg_read_header(&jpeg, TRUE);
  return true;
}

bool readJpegPixels(JpegReading& reading) {
  if (setjmp(reading.at_error)) return false;
  jpeg_decompress_struct& jpeg = reading.jpeg;
  jpeg.out_color_space = jpeg.num_components == 1 ? JCS_GRAYSCALE : JCS_YCbCr;
  jpeg_start_decompress(&jpeg);
  const int width = reading.image.cols;
  while (jpeg.output_scanline < jpeg.output_height) {
    unsigned char* to = reading.image.ptr(static_cast<int>(jpeg.output_scanline));
    JSAMPROW row = jpeg.num_components == 1 ? to : reading.row.data();
    jpeg_read_scanlines(&jpeg, &row, 1);
    if (jpeg.num_components == 1) continue;
    for (int x = 0; x < width; ++x) {
      to[x] = row[3 * x];
      for (const int difference : {row[3 * x + 1] - kNoColor, row[3 * x + 2] - kNoColor}) {
        reading.colored = reading.colored || std::abs(difference) > kMaxColorDifference;
      }
    }
  }
  jpeg_finish_decompress(&jpeg);
  return true;
}

}  // namespace

cv::Mat decodeJpeg(const std::string& path, std::string_view content) {
  JpegReading reading;
  const auto broken = [&] {
    return InputError(path, "", "", "is not a readable JPEG image: " + std::string(reading.message));
  };
  if (!readJpegHeader(reading, content)) throw broken();
  const jpeg_decompress_struct& jpeg = reading.jpeg;
  const auto require = [&](bool holds, const char* field, unsigned value, const char* rule) {
    if (!holds) throw InputError(path, field, std::to_string(value), rule);
  };
  require(jpeg.image_width <= kMaxSide, "width", jpeg.image_width, "must be 1 to 8192 px");
  require(jpeg.image_height <= kMaxSide, "height", jpeg.image_height, "must be 1 to 8192 px");
  const auto components = static_cast<unsigned>(jpeg.num_components);
  require(components == 1 || (components == 3 && jpeg.jpeg_color_space == JCS_YCbCr), "channels", components,
          "must be one, or luminance and two of colour that say grey");
  reading.image.create(static_cast<int>(jpeg.image_height), static_cast<int>(jpeg.image_width), CV_8U);
  reading.row.resize(std::size_t{3} * jpeg.image_width);
  if (!readJpegPixels(reading)) throw broken();
  require(!reading.colored, "channels", components, "must be one, or all equal: no colours");
  return std::move(reading.image);
}

}  // namespace angio::io
