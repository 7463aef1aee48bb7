// SPDX-License-Identifier: GPL-2.0-or-later
// X-ray frames, raw or as PNG.
#include <angio_lcm/xray_frame_t.hpp>
#include <cstring>

#include "angio/imaging/png.hpp"
#include "codec_parts.hpp"

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "16-bit pixels are copied to the wire as they lie in memory, which must be little-endian"
#endif

namespace angio {
namespace {

// A byte of deflate gives at most 1032.
constexpr std::int64_t kMostDeflated = 1032;

std::optional<double> known(double value) { return value == 0 ? std::nullopt : std::optional<double>(value); }

std::vector<std::uint8_t> rawPixels(const cv::Mat& image) {
  std::vector<std::uint8_t> pixels;
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  pixels.reserve(row_bytes * static_cast<std::size_t>(image.rows));
  for (int y = 0; y < image.rows; ++y) {  // Row by row: an image may be a window into a larger one.
    pixels.insert(pixels.end(), image.ptr(y), image.ptr(y) + row_bytes);
  }
  return pixels;
}

cv::Mat rawImage(const angio_lcm::xray_frame_t& wire) {
  if (std::int64_t{wire.width} * wire.height * (wire.bits / 8) != wire.size) {
    throw InputError("", "size", shown(wire.size), "must be width * height * bits / 8");
  }
  cv::Mat image(wire.height, wire.width, wire.bits == 8 ? CV_8UC1 : CV_16UC1);
  std::memcpy(image.data, wire.pixels.data(), wire.pixels.size());
  return image;
}

// The image must be what the message's own fields say before memory is taken for it: a few bytes can claim a large one.
cv::Mat pngImage(const angio_lcm::xray_frame_t& wire) {
  const std::string_view content(reinterpret_cast<const char*>(wire.pixels.data()), wire.pixels.size());
  const auto header = pngHeader(content);
  const bool as_said = header && header->width_px == static_cast<std::uint32_t>(wire.width) &&
                       header->height_px == static_cast<std::uint32_t>(wire.height) && header->bits == wire.bits &&
                       header->grey;
  if (!as_said) throw InputError("", "pixels", "", "must be a grey PNG of the message's width, height and bits");
  if (std::int64_t{wire.width} * wire.height * (wire.bits / 8) > kMostDeflated * wire.size) {
    throw InputError("", "size", shown(wire.size), "is too small for the image it promises");
  }
  cv::Mat image = decodePng("pixels", content);
  if (image.type() != (wire.bits == 8 ? CV_8UC1 : CV_16UC1)) throw InputError("", "pixels", "", "must be grey");
  return image;
}

XrayFrame frameOf(const angio_lcm::xray_frame_t& wire) {
  if (wire.bits != 8 && wire.bits != 16) throw InputError("", "bits", shown(wire.bits), "must be 8 or 16");
  XrayCamera::Parameters p;
  p.width_px = wire.width;
  p.height_px = wire.height;
  p.fx_px = wire.fx;
  p.fy_px = wire.fy;
  p.cx_px = wire.cx;
  p.cy_px = wire.cy;
  p.pixel_spacing_m = known(wire.pixel_spacing);
  p.source_detector_distance_m = known(wire.source_detector_distance);
  const XrayCamera camera(p);  // Refuses sizes that are not positive, before they are multiplied.
  switch (wire.encoding) {
    case angio_lcm::xray_frame_t::RAW:
      return {wire.utime, wire.sequence, rawImage(wire), camera};
    case angio_lcm::xray_frame_t::PNG:
      return {wire.utime, wire.sequence, pngImage(wire), camera};
  }
  throw InputError("", "encoding", shown(wire.encoding), "must be RAW (0) or PNG (1)");
}

}  // namespace

std::vector<std::uint8_t> encode(const XrayFrame& frame, ImageEncoding encoding) {
  codec::requireSound<angio_lcm::xray_frame_t>(frame);
  const auto& p = frame.camera.parameters();
  angio_lcm::xray_frame_t wire{};
  wire.utime = frame.time_us;
  wire.sequence = frame.sequence;
  wire.width = p.width_px;
  wire.height = p.height_px;
  wire.bits = frame.image.depth() == CV_8U ? 8 : 16;
  wire.fx = p.fx_px;
  wire.fy = p.fy_px;
  wire.cx = p.cx_px;
  wire.cy = p.cy_px;
  wire.pixel_spacing = p.pixel_spacing_m.value_or(0);
  wire.source_detector_distance = p.source_detector_distance_m.value_or(0);
  wire.encoding = static_cast<std::int8_t>(encoding);
  wire.pixels = encoding == ImageEncoding::kPng ? encodePng(frame.image) : rawPixels(frame.image);
  wire.size = static_cast<std::int32_t>(wire.pixels.size());
  return codec::bytesOf(wire);
}

template <>
Decoded<XrayFrame> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<XrayFrame, angio_lcm::xray_frame_t>(codec::Tail::kBytes, data, size, frameOf);
}

}  // namespace angio
