// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/png.hpp"

#include <png.h>
#include <zlib.h>

#include <csetjmp>
#include <cstring>
#include <stdexcept>

#include "angio/base/big_endian.hpp"
#include "angio/base/errors.hpp"

namespace angio::imaging {
namespace {

// Everything libpng works on lives here, outside the functions that it may leave with longjmp: no destructor is
// skipped.
struct PngWork {
  std::string_view content;  // What is read ...
  std::size_t done = 0;
  std::vector<std::uint8_t> written;  // ... or is written.
  std::string message;
  png_structp png = nullptr;
  png_infop info = nullptr;
  void (*destroy)(png_structp* png, png_infop* info);
  std::jmp_buf at_error;
  std::vector<png_bytep> rows;

  explicit PngWork(void (*destroy_it)(png_structp* png, png_infop* info)) : destroy(destroy_it) {}
  PngWork(const PngWork&) = delete;
  PngWork& operator=(const PngWork&) = delete;
  ~PngWork() { destroy(&png, &info); }
};

[[noreturn]] void onError(png_structp png, png_const_charp message) {
  auto& work = *static_cast<PngWork*>(png_get_error_ptr(png));
  work.message = message;
  std::longjmp(work.at_error, 1);
}

void onWarning(png_structp, png_const_charp) {}

void readBytes(png_structp png, png_bytep to, std::size_t count) {
  auto& reading = *static_cast<PngWork*>(png_get_io_ptr(png));
  if (count > reading.content.size() - reading.done) png_error(png, "the file ends too early");
  std::memcpy(to, reading.content.data() + reading.done, count);
  reading.done += count;
}

// Holds no object with a destructor while libpng runs.
bool readHeader(PngWork& reading) {
  if (setjmp(reading.at_error)) return false;
  png_set_user_limits(reading.png, kMaxPngSide, kMaxPngSide);
  png_set_chunk_malloc_max(reading.png, 1 << 20);
  png_set_read_fn(reading.png, &reading, readBytes);
  png_read_info(reading.png, reading.info);
  png_set_expand(reading.png);  // Palettes and less than eight bits.
  png_set_swap(reading.png);    // Sixteen bits stand in network order.
  png_set_interlace_handling(reading.png);
  png_read_update_info(reading.png, reading.info);
  return true;
}

bool readPixels(PngWork& reading) {
  if (setjmp(reading.at_error)) return false;
  png_read_image(reading.png, reading.rows.data());
  png_read_end(reading.png, nullptr);
  return true;
}

void appendBytes(png_structp png, png_bytep from, std::size_t count) {
  bool appended = true;
  try {
    auto& content = static_cast<PngWork*>(png_get_io_ptr(png))->written;
    content.insert(content.end(), from, from + count);
  } catch (const std::bad_alloc&) {  // Not through C.
    appended = false;
  }
  if (!appended) png_error(png, "no memory");
}

void flushNothing(png_structp) {}

bool writePixels(PngWork& writing, unsigned width, unsigned height, int bits) {
  if (setjmp(writing.at_error)) return false;
  png_set_write_fn(writing.png, &writing, appendBytes, flushNothing);
  png_set_IHDR(writing.png, writing.info, width, height, bits, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  // What the noise of an X-ray leaves to compress is in the differences' histogram: looking for repetitions takes four
  // times as long and saves no more.
  png_set_filter(writing.png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_level(writing.png, 1);
  png_set_compression_strategy(writing.png, Z_HUFFMAN_ONLY);
  png_write_info(writing.png, writing.info);
  if (bits == 16) png_set_swap(writing.png);
  png_write_image(writing.png, writing.rows.data());
  png_write_end(writing.png, nullptr);
  return true;
}

}  // namespace

std::optional<PngHeader> pngHeader(std::string_view content) {
  // Signature, and a first chunk IHDR of 13 bytes: width, height, bits, colour type, and three more, interlacing last.
  constexpr std::string_view kStart("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16);
  if (content.size() < kStart.size() + 13 || content.substr(0, kStart.size()) != kStart) return std::nullopt;
  return PngHeader{bigEndian<std::uint32_t>(&content[16]), bigEndian<std::uint32_t>(&content[20]), content[24],
                   content[25] == PNG_COLOR_TYPE_GRAY && content[28] == PNG_INTERLACE_NONE};
}

std::vector<std::uint8_t> encodePng(const cv::Mat& image) {
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_16UC1)) {
    throw std::invalid_argument("image: must be of type CV_8UC1 or CV_16UC1");
  }
  PngWork writing([](png_structp* png, png_infop* info) { png_destroy_write_struct(png, info); });
  writing.written.reserve(image.total() * image.elemSize());
  for (int r = 0; r < image.rows; ++r) writing.rows.push_back(const_cast<png_bytep>(image.ptr(r)));
  writing.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &writing, onError, onWarning);
  if (writing.png) writing.info = png_create_info_struct(writing.png);
  if (!writing.info || !writePixels(writing, static_cast<unsigned>(image.cols), static_cast<unsigned>(image.rows),
                                    image.depth() == CV_8U ? 8 : 16)) {
    throw std::runtime_error("an image cannot be written as PNG");
  }
  return std::move(writing.written);
}

cv::Mat decodePng(const std::string& place, std::string_view content) {
  PngWork reading([](png_structp* png, png_infop* info) { png_destroy_read_struct(png, info, nullptr); });
  reading.content = content;
  const auto broken = [&] { return InputError(place, "", "", "is not a readable PNG image: " + reading.message); };
  reading.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reading, onError, onWarning);
  if (reading.png) reading.info = png_create_info_struct(reading.png);
  if (!reading.info) throw InputError(place, "", "", "cannot be read: libpng does not start");
  if (!readHeader(reading)) throw broken();

  const int width = static_cast<int>(png_get_image_width(reading.png, reading.info));
  const int height = static_cast<int>(png_get_image_height(reading.png, reading.info));
  const int channels = png_get_channels(reading.png, reading.info);
  const int bits = png_get_bit_depth(reading.png, reading.info);
  if (channels != 1 && channels != 3) {
    throw InputError(place, "channels", std::to_string(channels), "must be 1, or 3 that are equal; no transparency");
  }
  cv::Mat image(height, width, CV_MAKETYPE(bits == 16 ? CV_16U : CV_8U, channels));
  for (int r = 0; r < height; ++r) reading.rows.push_back(image.ptr(r));
  if (!readPixels(reading)) throw broken();
  return image;
}

}  // namespace angio::imaging
