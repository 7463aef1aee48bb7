// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/xray_frame_t.hpp>

#include "angio/messaging/codec.hpp"
#include "description.hpp"

namespace angio::messaging::wire {

template <>
struct Description<XrayFrame> {
  using Wire = angio_lcm::xray_frame_t;
  using Packed = Wire;

  static Packed pack(const XrayFrame& frame, ImageEncoding encoding = ImageEncoding::kRaw);
  /// Throws InputError on a camera, a size or pixels that cannot be.
  static XrayFrame unpack(const Packed& packed);
  static std::optional<std::string> broken(const XrayFrame& frame);

  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.utime, kUtime);
    v.number("sequence", m.sequence);
    v.number("width", m.width);
    v.number("height", m.height);
    v.number("bits", m.bits);
    v.number("encoding", m.encoding);
    v.number("fx", m.fx);
    v.number("fy", m.fy);
    v.number("cx", m.cx);
    v.number("cy", m.cy);
    v.number("pixel_spacing", m.pixel_spacing);
    v.number("source_detector_distance", m.source_detector_distance);
    v.bytes("size", m.size, "pixels", m.pixels);
  };

  static std::string line(const XrayFrame& frame);
};

}  // namespace angio::messaging::wire
