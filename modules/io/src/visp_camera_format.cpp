// SPDX-License-Identifier: GPL-2.0-or-later
#include <cstring>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "camera_formats.hpp"
#include "xml.hpp"

// vpXmlParserCamera needs to be told the camera's name, takes 0 for what it cannot read and reports on the terminal, so
// its files are read here.

namespace angio::io {
namespace {

constexpr std::size_t kMaxXmlFile = std::size_t{1} << 20;

std::vector<vtkXMLDataElement*> childrenOf(vtkXMLDataElement& parent, const char* name) {
  std::vector<vtkXMLDataElement*> found;
  for (int i = 0; i < parent.GetNumberOfNestedElements(); ++i) {
    vtkXMLDataElement* const element = parent.GetNestedElement(i);
    if (std::strcmp(element->GetName(), name) == 0) found.push_back(element);
  }
  return found;
}

std::string_view stripped(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  return first == std::string_view::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

class VispFields {
 public:
  VispFields(const XmlDocument& document, vtkXMLDataElement& parent) : document_(document), parent_(parent) {}

  vtkXMLDataElement& need(const char* name) const {
    const auto found = childrenOf(parent_, name);
    if (found.size() != 1) {
      throw InputError(document_.placeOf(parent_), name, found.empty() ? "" : std::to_string(found.size()),
                       found.empty() ? "is missing" : "must not be given twice");
    }
    return *found[0];
  }
  double number(const char* name) const {
    return parseNumber(place(name), name, stripped(document_.textOf(need(name))));
  }
  double positive(const char* name) const { return requirePositive(place(name), name, number(name)); }
  int side(const char* name) const {
    const int pixels = parseInteger(place(name), name, stripped(document_.textOf(need(name))));
    requireBetween(place(name), name, pixels, 1, kMaxImageSide);
    return pixels;
  }

 private:
  std::string place(const char* name) const { return document_.placeOf(need(name)); }

  const XmlDocument& document_;
  vtkXMLDataElement& parent_;
};

}  // namespace

XrayCamera readVispCamera(const std::string& path) {
  const XmlDocument document(path, readWholeFile(path, kMaxXmlFile));
  const auto cameras = childrenOf(document.root(), "camera");
  if (cameras.size() != 1) {
    throw InputError(document.placeOf(document.root()), "camera", std::to_string(cameras.size()),
                     "there must be just one");
  }
  const VispFields camera(document, *cameras[0]);
  XrayCamera::Parameters p;
  p.width_px = camera.side("image_width");
  p.height_px = camera.side("image_height");
  vtkXMLDataElement* plain_model = nullptr;
  std::string types;
  for (vtkXMLDataElement* const model : childrenOf(*cameras[0], "model")) {
    const std::string type(stripped(document.textOf(VispFields(document, *model).need("type"))));
    types += (types.empty() ? "" : ", ") + type;
    if (type == "perspectiveProjWithoutDistortion") plain_model = model;
  }
  if (!plain_model) {
    throw InputError(document.placeOf(*cameras[0]), "model", types,
                     "must hold perspectiveProjWithoutDistortion: correct the distortion in the image first");
  }
  const VispFields model(document, *plain_model);
  p.fx_px = model.positive("px");
  p.fy_px = model.positive("py");
  p.cx_px = model.number("u0");
  p.cy_px = model.number("v0");
  try {
    return XrayCamera(p);
  } catch (const InputError& error) {
    throw error.within(path);
  }
}

}  // namespace angio::io
