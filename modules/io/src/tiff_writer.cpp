// SPDX-License-Identifier: GPL-2.0-or-later
#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>

#include "angio/base/errors.hpp"
#include "image_formats.hpp"

namespace angio::io {
namespace {

struct TiffWriting {
  std::size_t max_bytes;
  std::string content;
  std::size_t position = 0;
};

int onError(TIFF*, void*, const char*, const char*, va_list) { return 1; }  // Handled: the global one would print.

tmsize_t readBytes(thandle_t handle, void* to, tmsize_t count) {
  auto& writing = *static_cast<TiffWriting*>(handle);
  const std::size_t at = std::min(writing.position, writing.content.size());
  const std::size_t n = std::min(writing.content.size() - at, static_cast<std::size_t>(std::max<tmsize_t>(count, 0)));
  std::memcpy(to, writing.content.data() + at, n);
  writing.position += n;
  return static_cast<tmsize_t>(n);
}

tmsize_t writeBytes(thandle_t handle, void* from, tmsize_t count) {
  auto& writing = *static_cast<TiffWriting*>(handle);
  const std::size_t end = writing.position + static_cast<std::size_t>(count);
  if (end > writing.max_bytes) return 0;
  if (end > writing.content.size()) writing.content.resize(end);
  std::memcpy(writing.content.data() + writing.position, from, static_cast<std::size_t>(count));
  writing.position = end;
  return count;
}

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  auto& writing = *static_cast<TiffWriting*>(handle);
  const toff_t start = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? writing.position : writing.content.size();
  writing.position = static_cast<std::size_t>(start + offset);
  return writing.position;
}

toff_t sizeOf(thandle_t handle) { return static_cast<TiffWriting*>(handle)->content.size(); }

int closeNothing(thandle_t) { return 0; }

using TiffPointer = std::unique_ptr<TIFF, void (*)(TIFF*)>;

TiffPointer open(TiffWriting& writing) {
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), onError, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), onError, nullptr);
  return {TIFFClientOpenExt("image", "wm", &writing, readBytes, writeBytes, seek, closeNothing, sizeOf, nullptr,
                            nullptr, options.get()),
          TIFFClose};
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

std::string encodeTiff(const std::string& path, const std::vector<cv::Mat>& pages, std::size_t max_bytes) {
  TiffWriting writing{max_bytes, {}, 0};
  {
    const TiffPointer tiff = open(writing);
    bool written = tiff != nullptr;
    for (std::size_t n = 0; written && n < pages.size(); ++n)
      written = writePage(tiff.get(), pages[n], n, pages.size());
    if (!written) {
      throw InputError(path, "", "", "the frames cannot be encoded within " + std::to_string(max_bytes) + " bytes");
    }
  }
  return std::move(writing.content);
}

}  // namespace angio::io
