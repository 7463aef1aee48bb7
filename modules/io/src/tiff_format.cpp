// SPDX-License-Identifier: GPL-2.0-or-later
#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "angio/base/errors.hpp"
#include "image_formats.hpp"

namespace angio::io {
namespace {

constexpr tmsize_t kMaxBlock = tmsize_t{1} << 29;  // 8192 x 8192 x 3 channels of 16 bits fit.
// Deflate, the closest of the usual ways to pack, makes a thousand bytes of one.
constexpr tmsize_t kMaxFromNothing = tmsize_t{1} << 24, kMaxUnpacked = 4096;

struct TiffReading {
  const std::string& content;
  std::size_t position = 0;
  std::string message;
};

int onError(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  char text[256];
  std::vsnprintf(text, sizeof text, format, arguments);
  auto& reading = *static_cast<TiffReading*>(user);
  if (reading.message.empty()) reading.message = text;
  return 1;  // Handled: the global handler, which prints, is not asked.
}

int onWarning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

tmsize_t readBytes(thandle_t handle, void* to, tmsize_t count) {
  auto& reading = *static_cast<TiffReading*>(handle);
  const std::size_t left = reading.content.size() - std::min(reading.position, reading.content.size());
  const std::size_t n = std::min(left, static_cast<std::size_t>(std::max<tmsize_t>(count, 0)));
  std::memcpy(to, reading.content.data() + std::min(reading.position, reading.content.size()), n);
  reading.position += n;
  return static_cast<tmsize_t>(n);
}

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  auto& reading = *static_cast<TiffReading*>(handle);
  const toff_t start = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? reading.position : reading.content.size();
  reading.position = static_cast<std::size_t>(start + offset);
  return reading.position;
}

toff_t sizeOf(thandle_t handle) { return static_cast<TiffReading*>(handle)->content.size(); }

tmsize_t writeNothing(thandle_t, void*, tmsize_t) { return 0; }

int closeNothing(thandle_t) { return 0; }

using TiffPointer = std::unique_ptr<TIFF, void (*)(TIFF*)>;

TiffPointer open(TiffReading& reading) {
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxBlock);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), onError, &reading);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), onWarning, nullptr);
  // "m": no memory mapping, so none of its functions is needed.
  return {TIFFClientOpenExt("image", "rm", &reading, readBytes, writeNothing, seek, closeNothing, sizeOf, nullptr,
                            nullptr, options.get()),
          TIFFClose};
}

struct TiffLayout {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 1, channels = 1, photometric = PHOTOMETRIC_MINISBLACK;
};

TiffLayout readLayout(const std::string& path, TIFF* tiff) {
  TiffLayout layout;
  std::uint16_t planar = PLANARCONFIG_CONTIG, sample_format = SAMPLEFORMAT_UINT, orientation = ORIENTATION_TOPLEFT;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &layout.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &layout.height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &layout.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &layout.channels);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &planar);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &sample_format);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ORIENTATION, &orientation);
  TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &layout.photometric);
  const auto require = [&](bool holds, const char* field, std::uint32_t value, const char* rule) {
    if (!holds) throw InputError(path, field, std::to_string(value), rule);
  };
  require(layout.width >= 1 && layout.width <= kMaxSide, "width", layout.width, "must be 1 to 8192 px");
  require(layout.height >= 1 && layout.height <= kMaxSide, "height", layout.height, "must be 1 to 8192 px");
  require(layout.bits == 8 || layout.bits == 16, "bits per sample", layout.bits, "must be 8 or 16");
  require(layout.channels == 1 || layout.channels == 3, "channels", layout.channels, "must be 1, or 3 that are equal");
  require(planar == PLANARCONFIG_CONTIG || layout.channels == 1, "planar configuration", planar, "must be contiguous");
  require(sample_format == SAMPLEFORMAT_UINT, "sample format", sample_format, "must be unsigned integers");
  require(orientation == ORIENTATION_TOPLEFT, "orientation", orientation, "must be top left");
  const bool grey = layout.photometric == PHOTOMETRIC_MINISBLACK || layout.photometric == PHOTOMETRIC_MINISWHITE;
  require(layout.channels == 1 ? grey : layout.photometric == PHOTOMETRIC_RGB, "photometric interpretation",
          layout.photometric, "must be grey, or RGB");
  return layout;
}

// A strip is a tile as wide as the image.
bool readBlocks(TIFF* tiff, const TiffLayout& layout, std::size_t file_bytes, cv::Mat& image) {
  const bool tiled = TIFFIsTiled(tiff) != 0;
  std::uint32_t block_width = layout.width, block_height = layout.height;
  if (tiled) {
    TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &block_width);
    TIFFGetField(tiff, TIFFTAG_TILELENGTH, &block_height);
  } else {
    TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &block_height);
    block_height = std::min(block_height, layout.height);
  }
  const tmsize_t size = tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff);
  if (block_width == 0 || block_height == 0 || size <= 0 || size > kMaxBlock) return false;
  // Memory is not given for pixels that the file has no room for.
  if (size > kMaxFromNothing && size / kMaxUnpacked > static_cast<tmsize_t>(file_bytes)) return false;
  const std::size_t pixel = image.elemSize(), stride = block_width * pixel;
  std::vector<unsigned char> block(static_cast<std::size_t>(size));
  for (std::uint32_t y = 0; y < layout.height; y += block_height) {
    for (std::uint32_t x = 0; x < layout.width; x += block_width) {
      const std::uint32_t rows = std::min(block_height, layout.height - y);
      const std::uint32_t columns = std::min(block_width, layout.width - x);
      const tmsize_t got = tiled ? TIFFReadEncodedTile(tiff, TIFFComputeTile(tiff, x, y, 0, 0), block.data(), size)
                                 : TIFFReadEncodedStrip(tiff, TIFFComputeStrip(tiff, y, 0), block.data(), size);
      if (got < static_cast<tmsize_t>((rows - 1) * stride + columns * pixel)) return false;
      for (std::uint32_t r = 0; r < rows; ++r) {
        std::memcpy(image.ptr(static_cast<int>(y + r)) + x * pixel, &block[r * stride], columns * pixel);
      }
    }
  }
  return true;
}

InputError broken(const std::string& path, const TiffReading& reading) {
  return InputError(
      path, "", "",
      "is not a readable TIFF image: " + (reading.message.empty() ? std::string("broken data") : reading.message));
}

}  // namespace

cv::Mat decodeTiff(const std::string& path, const std::string& content, int page) {
  TiffReading reading{content, 0, {}};
  const TiffPointer tiff = open(reading);
  if (!tiff || (page > 0 && !TIFFSetDirectory(tiff.get(), static_cast<tdir_t>(page)))) throw broken(path, reading);
  const TiffLayout layout = readLayout(path, tiff.get());
  cv::Mat image(static_cast<int>(layout.height), static_cast<int>(layout.width),
                CV_MAKETYPE(layout.bits == 16 ? CV_16U : CV_8U, layout.channels));
  if (!readBlocks(tiff.get(), layout, content.size(), image)) throw broken(path, reading);
  if (layout.photometric == PHOTOMETRIC_MINISWHITE) {
    cv::subtract(cv::Scalar::all(layout.bits == 16 ? 65535 : 255), image, image);
  }
  return image;
}

int countTiffPages(const std::string& path, const std::string& content) {
  TiffReading reading{content, 0, {}};
  const TiffPointer tiff = open(reading);
  if (!tiff) throw broken(path, reading);
  int pages = 1;
  for (; !TIFFLastDirectory(tiff.get()); ++pages) {
    if (pages == kMaxPages) throw InputError(path, "pages", "", "must not be more than " + std::to_string(kMaxPages));
    if (!TIFFReadDirectory(tiff.get())) throw broken(path, reading);
  }
  return pages;
}

}  // namespace angio::io
