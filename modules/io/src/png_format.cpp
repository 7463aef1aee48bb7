// SPDX-License-Identifier: GPL-2.0-or-later
#include <png.h>

#include <csetjmp>
#include <cstring>
#include <vector>

#include "angio/base/errors.hpp"
#include "image_formats.hpp"

namespace angio {
namespace {

// Everything libpng works on lives here, outside the functions that it may leave with longjmp: no destructor is
// skipped.
struct PngReading {
  const std::string& content;
  std::size_t done = 0;
  std::string message;
  png_structp png = nullptr;
  png_infop info = nullptr;
  std::jmp_buf at_error;
  cv::Mat image;
  std::vector<png_bytep> rows;

  explicit PngReading(const std::string& bytes) : content(bytes) {}
  PngReading(const PngReading&) = delete;
  PngReading& operator=(const PngReading&) = delete;
  ~PngReading() { png_destroy_read_struct(&png, &info, nullptr); }
};

[[noreturn]] void onError(png_structp png, png_const_charp message) {
  auto& reading = *static_cast<PngReading*>(png_get_error_ptr(png));
  reading.message = message;
  std::longjmp(reading.at_error, 1);
}

void onWarning(png_structp, png_const_charp) {}

void readBytes(png_structp png, png_bytep to, std::size_t count) {
  auto& reading = *static_cast<PngReading*>(png_get_io_ptr(png));
  if (count > reading.content.size() - reading.done) png_error(png, "the file ends too early");
  std::memcpy(to, reading.content.data() + reading.done, count);
  reading.done += count;
}

// Holds no object with a destructor while libpng runs.
bool readHeader(PngReading& reading) {
  if (setjmp(reading.at_error)) return false;
  png_set_user_limits(reading.png, kLargestSide, kLargestSide);
  png_set_chunk_malloc_max(reading.png, 1 << 20);
  png_set_read_fn(reading.png, &reading, readBytes);
  png_read_info(reading.png, reading.info);
  png_set_expand(reading.png);  // Palettes and less than eight bits.
  png_set_swap(reading.png);    // Sixteen bits stand in network order.
  png_set_interlace_handling(reading.png);
  png_read_update_info(reading.png, reading.info);
  return true;
}

bool readPixels(PngReading& reading) {
  if (setjmp(reading.at_error)) return false;
  png_read_image(reading.png, reading.rows.data());
  png_read_end(reading.png, nullptr);
  return true;
}

}  // namespace

cv::Mat decodePng(const std::string& path, const std::string& content) {
  PngReading reading(content);
  const auto broken = [&] { return InputError(path, "", "", "is not a readable PNG image: " + reading.message); };
  reading.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reading, onError, onWarning);
  if (reading.png) reading.info = png_create_info_struct(reading.png);
  if (!reading.info) throw InputError(path, "", "", "cannot be read: libpng does not start");
  if (!readHeader(reading)) throw broken();

  const int width = static_cast<int>(png_get_image_width(reading.png, reading.info));
  const int height = static_cast<int>(png_get_image_height(reading.png, reading.info));
  const int channels = png_get_channels(reading.png, reading.info);
  const int bits = png_get_bit_depth(reading.png, reading.info);
  if (channels != 1 && channels != 3) {
    throw InputError(path, "channels", std::to_string(channels), "must be 1, or 3 that are equal; no transparency");
  }
  reading.image.create(height, width, CV_MAKETYPE(bits == 16 ? CV_16U : CV_8U, channels));
  for (int r = 0; r < height; ++r) reading.rows.push_back(reading.image.ptr(r));
  if (!readPixels(reading)) throw broken();
  return reading.image;
}

}  // namespace angio
