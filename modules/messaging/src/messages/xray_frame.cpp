// SPDX-License-Identifier: GPL-2.0-or-later
#include "messages/xray_frame.hpp"

#include <cstring>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/imaging/png.hpp"

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "16-bit pixels are copied to the wire as they lie in memory, which must be little-endian"
#endif

namespace angio::messaging::wire {

using Wire = angio_lcm::xray_frame_t;

namespace {

// A byte of deflate gives at most 1032.
constexpr std::int64_t kMaxDeflated = 1032;

std::optional<double> known(double value) { return value == 0 ? std::nullopt : std::optional<double>(value); }

int matTypeOf(const Wire& frame) { return frame.bits == 8 ? CV_8UC1 : CV_16UC1; }

std::int64_t imageBytes(const Wire& frame) { return std::int64_t{frame.width} * frame.height * (frame.bits / 8); }

std::vector<std::uint8_t> rawPixels(const cv::Mat& image) {
  std::vector<std::uint8_t> pixels;
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  pixels.reserve(row_bytes * static_cast<std::size_t>(image.rows));
  for (int y = 0; y < image.rows; ++y) {  // Row by row: an image may be a window into a larger one.
    pixels.insert(pixels.end(), image.ptr(y), image.ptr(y) + row_bytes);
  }
  return pixels;
}

cv::Mat rawImage(const Wire& frame) {
  if (imageBytes(frame) != frame.size) {
    throw InputError("", "size", formatValue(frame.size), "must be width * height * bits / 8");
  }
  cv::Mat image(frame.height, frame.width, matTypeOf(frame));
  std::memcpy(image.data, frame.pixels.data(), frame.pixels.size());
  return image;
}

// The image must be what the message's own fields say before memory is taken for it: a few bytes can claim a large one.
cv::Mat pngImage(const Wire& frame) {
  const std::string_view content(reinterpret_cast<const char*>(frame.pixels.data()), frame.pixels.size());
  const auto header = pngHeader(content);
  const bool as_said = header && header->width_px == static_cast<std::uint32_t>(frame.width) &&
                       header->height_px == static_cast<std::uint32_t>(frame.height) && header->bits == frame.bits &&
                       header->grey;
  if (!as_said) throw InputError("", "pixels", "", "must be a grey PNG of the message's width, height and bits");
  if (imageBytes(frame) > kMaxDeflated * frame.size) {
    throw InputError("", "size", formatValue(frame.size), "is too small for the image it promises");
  }
  cv::Mat image = decodePng("pixels", content);
  if (image.type() != matTypeOf(frame)) throw InputError("", "pixels", "", "must be grey");
  return image;
}

}  // namespace

Wire Description<XrayFrame>::pack(const XrayFrame& frame, ImageEncoding encoding) {
  const auto& p = frame.camera.parameters();
  Wire packed{};
  packed.utime = frame.time_us;
  packed.sequence = frame.sequence;
  packed.width = p.width_px;
  packed.height = p.height_px;
  packed.bits = frame.image.depth() == CV_8U ? 8 : 16;
  packed.encoding = static_cast<std::int8_t>(encoding);
  packed.fx = p.fx_px;
  packed.fy = p.fy_px;
  packed.cx = p.cx_px;
  packed.cy = p.cy_px;
  packed.pixel_spacing = p.pixel_spacing_m.value_or(0);
  packed.source_detector_distance = p.source_detector_distance_m.value_or(0);
  packed.pixels = encoding == ImageEncoding::kPng ? encodePng(frame.image) : rawPixels(frame.image);
  packed.size = static_cast<std::int32_t>(packed.pixels.size());
  return packed;
}

XrayFrame Description<XrayFrame>::unpack(const Wire& packed) {
  if (packed.bits != 8 && packed.bits != 16) throw InputError("", "bits", formatValue(packed.bits), "must be 8 or 16");
  XrayCamera::Parameters p;
  p.width_px = packed.width;
  p.height_px = packed.height;
  p.fx_px = packed.fx;
  p.fy_px = packed.fy;
  p.cx_px = packed.cx;
  p.cy_px = packed.cy;
  p.pixel_spacing_m = known(packed.pixel_spacing);
  p.source_detector_distance_m = known(packed.source_detector_distance);
  const XrayCamera camera(p);  // Refuses sizes that are not positive, before they are multiplied.
  switch (packed.encoding) {
    case Wire::RAW:
      return {packed.utime, packed.sequence, rawImage(packed), camera};
    case Wire::PNG:
      return {packed.utime, packed.sequence, pngImage(packed), camera};
  }
  throw InputError("", "encoding", formatValue(packed.encoding), "must be RAW (0) or PNG (1)");
}

std::optional<std::string> Description<XrayFrame>::broken(const XrayFrame& frame) {
  FieldRules rules;
  rules.number("utime", frame.time_us, kUtime);
  if (rules.broken()) return rules.broken();
  const cv::Mat& image = frame.image;
  if (image.dims != 2 || (image.type() != CV_8UC1 && image.type() != CV_16UC1)) {
    return "image: must be of type CV_8UC1 or CV_16UC1";
  }
  if (image.cols != frame.camera.width_px() || image.rows != frame.camera.height_px()) {
    return "image = " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
           ": must be of its camera's size";
  }
  if (static_cast<double>(image.total()) * static_cast<double>(image.elemSize()) > kMaxMessage) {
    return "image: is too large for one message";
  }
  return std::nullopt;
}

std::string Description<XrayFrame>::line(const XrayFrame& frame) {
  const auto& p = frame.camera.parameters();
  return formatted("%d x %d, %d bit, f %.0f px, centre %.1f %.1f px", p.width_px, p.height_px,
                   static_cast<int>(8 * frame.image.elemSize()), p.fx_px, p.cx_px, p.cy_px);
}

}  // namespace angio::messaging::wire
