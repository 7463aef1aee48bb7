// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/camera_files.hpp"

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"
#include "camera_formats.hpp"
#include "extension.hpp"

namespace angio {
namespace {

void refuseDistortion(const YamlField& distortion) {
  if (distortion.node->kind != YamlNode::Kind::kSequence) {
    if (distortion.number() != 0) distortion.refuse("must be zero: correct the distortion in the image first");
    return;
  }
  for (std::size_t i = 0; i < distortion.node->items.size(); ++i) {
    const YamlField item = distortion.item(i);
    if (item.number() != 0) item.refuse("must be zero: correct the distortion in the image first");
  }
}

XrayCamera readYamlCamera(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "camera");
  XrayCamera::Parameters p;
  const YamlField size = map.need("image_size_px");
  if (size.node->kind != YamlNode::Kind::kSequence || size.node->items.size() != 2) {
    size.refuse("must be a list of 2 integers: width, height");
  }
  p.width_px = size.item(0).integer();
  p.height_px = size.item(1).integer();
  requireBetween(size.item(0).place(), "image_size_px[0]", p.width_px, 1, kLargestImageSide);
  requireBetween(size.item(1).place(), "image_size_px[1]", p.height_px, 1, kLargestImageSide);
  p.fx_px = map.need("fx_px").positive();
  p.fy_px = map.need("fy_px").positive();
  p.cx_px = map.need("cx_px").number();
  p.cy_px = map.need("cy_px").number();
  if (const auto spacing = map.find("pixel_spacing_mm")) p.pixel_spacing_m = spacing->positive() / 1e3;
  if (const auto distance = map.find("source_detector_distance_mm")) {
    p.source_detector_distance_m = distance->positive() / 1e3;
  }
  if (const auto distortion = map.find("distortion")) refuseDistortion(*distortion);
  map.refuseOthers();
  try {
    return XrayCamera(p);
  } catch (const InputError& error) {
    throw error.within(path);
  }
}

struct CameraFormat {
  const char* extension;
  XrayCamera (*read)(const std::string& path);
};

constexpr CameraFormat kFormats[] = {
    {".yaml", readYamlCamera},
    {".yml", readYamlCamera},
    {".xml", readVispCamera},
};

}  // namespace

XrayCamera readCamera(const std::string& path) {
  const std::string extension = extensionOf(path);
  std::string known;
  for (const CameraFormat& format : kFormats) {
    if (extension == format.extension) return format.read(path);
    known += std::string(known.empty() ? "" : ", ") + format.extension;
  }
  throw InputError(path, "extension", extension, "must be one of " + known);
}

void writeCamera(const std::string& path, const XrayCamera& camera) {
  const auto& p = camera.parameters();
  std::string content = "image_size_px: [" + std::to_string(p.width_px) + ", " + std::to_string(p.height_px) + "]\n" +
                        "fx_px: " + exact(p.fx_px) + "\nfy_px: " + exact(p.fy_px) + "\ncx_px: " + exact(p.cx_px) +
                        "\ncy_px: " + exact(p.cy_px) + "\n";
  if (p.pixel_spacing_m) content += "pixel_spacing_mm: " + exactMillimetres(*p.pixel_spacing_m) + "\n";
  if (p.source_detector_distance_m) {
    content += "source_detector_distance_mm: " + exactMillimetres(*p.source_detector_distance_m) + "\n";
  }
  writeWholeFile(path, content);
}

}  // namespace angio
