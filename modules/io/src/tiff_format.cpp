// SPDX-License-Identifier: GPL-2.0-or-later
#include "tiff_format.hpp"

#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"
#include "dicom_pixels.hpp"

namespace angio::io {
namespace {

constexpr tmsize_t kMaxBlock = tmsize_t{1} << 29;  // 8192 x 8192 x 3 channels of 16 bits fit.
// Deflate, the closest of the usual ways to pack, makes a thousand bytes of one.
constexpr tmsize_t kMaxFromNothing = tmsize_t{1} << 24, kMaxUnpacked = 4096;

// A TIFF file in memory, as libtiff reads or writes it.
struct TiffMemory {
  std::string_view read;  // What is read; else `written` is written, up to `max_bytes`.
  std::size_t max_bytes = 0;
  std::string written;
  std::size_t position = 0;
  std::string message;  // libtiff's first one.

  std::string_view content() const { return read.empty() ? std::string_view(written) : read; }
};

TiffMemory& memoryOf(thandle_t handle) { return *static_cast<TiffMemory*>(handle); }

int onError(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  char text[256];
  std::vsnprintf(text, sizeof text, format, arguments);
  if (memoryOf(user).message.empty()) memoryOf(user).message = text;
  return 1;  // Handled: the global handler, which prints, is not asked.
}

int onWarning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

tmsize_t readBytes(thandle_t handle, void* to, tmsize_t count) {
  TiffMemory& memory = memoryOf(handle);
  const std::string_view content = memory.content();
  const std::size_t at = std::min(memory.position, content.size());
  const std::size_t n = std::min(content.size() - at, static_cast<std::size_t>(std::max<tmsize_t>(count, 0)));
  std::memcpy(to, content.data() + at, n);
  memory.position += n;
  return static_cast<tmsize_t>(n);
}

tmsize_t writeBytes(thandle_t handle, void* from, tmsize_t count) {
  TiffMemory& memory = memoryOf(handle);
  const std::size_t end = memory.position + static_cast<std::size_t>(count);
  if (end > memory.max_bytes) return 0;
  if (end > memory.written.size()) memory.written.resize(end);
  std::memcpy(memory.written.data() + memory.position, from, static_cast<std::size_t>(count));
  memory.position = end;
  return count;
}

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  TiffMemory& memory = memoryOf(handle);
  const toff_t start = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? memory.position : memory.content().size();
  memory.position = static_cast<std::size_t>(start + offset);
  return memory.position;
}

toff_t sizeOf(thandle_t handle) { return memoryOf(handle).content().size(); }

int closeNothing(thandle_t) { return 0; }

using TiffPointer = std::unique_ptr<TIFF, void (*)(TIFF*)>;

// `mode`: "rm" or "wm". "m": no memory mapping, so none of its functions is needed.
TiffPointer open(TiffMemory& memory, const char* mode) {
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxBlock);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), onError, &memory);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), onWarning, nullptr);
  return {TIFFClientOpenExt("image", mode, &memory, readBytes, writeBytes, seek, closeNothing, sizeOf, nullptr, nullptr,
                            options.get()),
          TIFFClose};
}

TiffMemory reading(const std::string& content) { return {content, 0, {}, 0, {}}; }

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

InputError broken(const std::string& path, const TiffMemory& memory) {
  return InputError(
      path, "", "",
      "is not a readable TIFF image: " + (memory.message.empty() ? std::string("broken data") : memory.message));
}

bool writePage(TIFF* tiff, const cv::Mat& page, std::size_t number, std::size_t count) {
  const int bytes = static_cast<int>(page.elemSize());
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(page.cols));
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(page.rows));
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8 * bytes);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
  TIFFSetField(tiff, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL);
  TIFFSetField(tiff, TIFFTAG_ZIPQUALITY, 1);  // Noise packs hardly better with more work.
  TIFFSetField(tiff, TIFFTAG_SUBFILETYPE, FILETYPE_PAGE);
  TIFFSetField(tiff, TIFFTAG_PAGENUMBER, static_cast<int>(number), static_cast<int>(count));
  constexpr int kStripBytes = 1 << 18;  // Big enough to pack well, small enough for every reader.
  const int strip_rows = std::clamp(kStripBytes / (page.cols * bytes), 1, page.rows);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, static_cast<std::uint32_t>(strip_rows));
  cv::Mat strip;  // libtiff's predictor works in place.
  for (int row = 0, n = 0; row < page.rows; row += strip_rows, ++n) {
    page.rowRange(row, std::min(row + strip_rows, page.rows)).copyTo(strip);
    const auto size = static_cast<tmsize_t>(strip.total() * strip.elemSize());
    if (TIFFWriteEncodedStrip(tiff, static_cast<std::uint32_t>(n), strip.data, size) != size) return false;
  }
  return TIFFWriteDirectory(tiff) != 0;
}

}  // namespace

cv::Mat decodeTiff(const std::string& path, const std::string& content, int page) {
  TiffMemory memory = reading(content);
  const TiffPointer tiff = open(memory, "rm");
  if (!tiff || (page > 0 && !TIFFSetDirectory(tiff.get(), static_cast<tdir_t>(page)))) throw broken(path, memory);
  const TiffLayout layout = readLayout(path, tiff.get());
  cv::Mat image(static_cast<int>(layout.height), static_cast<int>(layout.width),
                CV_MAKETYPE(layout.bits == 16 ? CV_16U : CV_8U, layout.channels));
  if (!readBlocks(tiff.get(), layout, content.size(), image)) throw broken(path, memory);
  if (layout.photometric == PHOTOMETRIC_MINISWHITE) {
    cv::subtract(cv::Scalar::all(layout.bits == 16 ? 65535 : 255), image, image);
  }
  return image;
}

int countTiffPages(const std::string& path, const std::string& content) {
  TiffMemory memory = reading(content);
  const TiffPointer tiff = open(memory, "rm");
  if (!tiff) throw broken(path, memory);
  int pages = 1;
  for (; !TIFFLastDirectory(tiff.get()); ++pages) {
    if (pages == kMaxPages) throw InputError(path, "pages", "", "must not be more than " + std::to_string(kMaxPages));
    if (!TIFFReadDirectory(tiff.get())) throw broken(path, memory);
  }
  return pages;
}

std::string encodeTiff(const std::string& path, const std::vector<cv::Mat>& pages, std::size_t max_bytes) {
  TiffMemory memory{{}, max_bytes, {}, 0, {}};
  {
    const TiffPointer tiff = open(memory, "wm");
    bool written = tiff != nullptr;
    for (std::size_t n = 0; written && n < pages.size(); ++n)
      written = writePage(tiff.get(), pages[n], n, pages.size());
    if (!written) {
      throw InputError(path, "", "", "the frames cannot be encoded within " + std::to_string(max_bytes) + " bytes");
    }
  }
  return std::move(memory.written);
}

}  // namespace angio::io
