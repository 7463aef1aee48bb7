// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/camera_files.hpp"

#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/io/format_table.hpp"
#include "angio/io/mayacam_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xml.hpp"
#include "angio/io/yaml.hpp"

namespace angio::io {
namespace {

// The widest detector a camera file may name, as in XrayCamera [px].
constexpr int kMaxImageSide = 32768;

constexpr double kMaxOffset_mm = 1000;  // Of an encoder; beyond it the file is in other units.

// The old forms, which all say that there is none.
bool isNoDistortion(const YamlField& distortion) {
  if (distortion.node->kind == YamlNode::Kind::kScalar) {
    if (distortion.node->scalar == "none" || distortion.number() == 0) return true;
    distortion.refuse("must be zero, or a map with a model");
  }
  if (distortion.node->kind != YamlNode::Kind::kSequence) return false;
  for (std::size_t i = 0; i < distortion.node->items.size(); ++i) {
    const YamlField item = distortion.item(i);
    if (item.number() != 0) item.refuse("must be zero: a distortion is a map with a model");
  }
  return true;
}

DetectorDistortion polynomialIn(const YamlField& field, YamlMap& map, const XrayCamera& camera) {
  DisplacementPolynomial shift;
  shift.order = map.need("order").integer(1, DisplacementPolynomial::kMaxOrder);
  const auto count = static_cast<std::size_t>(DisplacementPolynomial::termCount(shift.order));
  const std::vector<double> center = map.need("centre_px").numbers(2);
  const std::vector<double> x = map.need("shift_x_px").numbers(count), y = map.need("shift_y_px").numbers(count);
  shift.coefficients_px.resize(2, static_cast<Eigen::Index>(count));
  for (std::size_t k = 0; k < count; ++k) shift.coefficients_px.col(static_cast<Eigen::Index>(k)) << x[k], y[k];
  const auto distortion = DetectorDistortion::polynomial({center[0], center[1]}, map.need("unit_px").positive(), shift);
  map.refuseOthers();
  distortion.check(field.place(), camera.width_px(), camera.height_px());
  return distortion;
}

std::optional<DetectorDistortion> distortionIn(const YamlField& field, const XrayCamera& camera) {
  if (isNoDistortion(field)) return std::nullopt;
  YamlMap map(field.path, *field.node, field.key);
  const YamlField model = map.need("model");
  if (model.text() == "polynomial") return polynomialIn(field, map, camera);
  const bool radial = model.text() == "radial";
  if (!radial && model.text() != "intensifier") model.refuse("must be one of radial, intensifier, polynomial");
  const auto number = [&](const char* key) {
    const auto found = map.find(key);
    return found ? found->number() : 0;
  };
  const double k1 = number("k1"), k2 = number("k2");
  DetectorDistortion distortion = DetectorDistortion::radial(camera, k1, k2);
  if (radial) {
    distortion.skew_px = number("skew_px");
  } else {
    const double s1_rad = degToRad(number("s1_deg")), s2_rad = degToRad(number("s2_deg"));
    distortion = DetectorDistortion::intensifier(camera, {k1, k2, s1_rad, s2_rad});
    if (const auto center = map.find("centre_px")) {
      const auto numbers = center->numbers(2);
      distortion.center_px = {numbers[0], numbers[1]};
    }
  }
  map.refuseOthers();
  distortion.check(field.place(), camera.width_px(), camera.height_px());
  return distortion;
}

CameraDistanceLaw distanceLawIn(const YamlField& field) {
  YamlMap map(field.path, *field.node, field.key);
  CameraDistanceLaw law;
  law.offset_m = 1e-3 * map.need("offset_mm").between(-kMaxOffset_mm, kMaxOffset_mm);
  if (const auto slope = map.find("principal_point_slope_px_per_mm")) {
    const auto numbers = slope->numbers(2);
    law.principal_point_slope_px_per_m = 1e3 * Eigen::Vector2d(numbers[0], numbers[1]);
  }
  map.refuseOthers();
  return law;
}

CameraFile readYamlCamera(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "camera");
  XrayCamera::Parameters p;
  const auto sides = map.need("image_size_px").items("must be a list of 2 integers: width, height", 2, 2);
  p.width_px = sides[0].integer(1, kMaxImageSide);
  p.height_px = sides[1].integer(1, kMaxImageSide);
  p.fx_px = map.need("fx_px").positive();
  p.fy_px = map.need("fy_px").positive();
  p.cx_px = map.need("cx_px").number();
  p.cy_px = map.need("cy_px").number();
  if (const auto spacing = map.find("pixel_spacing_mm")) p.pixel_spacing_m = spacing->positive() / 1e3;
  if (const auto distance = map.find("source_detector_distance_mm")) {
    p.source_detector_distance_m = distance->positive() / 1e3;
  }
  const auto distortion = map.find("distortion"), law = map.find("source_detector_distance");
  map.find("calibration");
  map.refuseOthers();
  try {
    CameraFile file{XrayCamera(p), {}, {}};
    if (distortion) file.distortion = distortionIn(*distortion, file.camera);
    if (law) {
      if (!p.source_detector_distance_m) law->refuse("must stand beside source_detector_distance_mm");
      file.distance_law = distanceLawIn(*law);
      if (!(*p.source_detector_distance_m + file.distance_law->offset_m > 0)) {
        law->refuse("must leave the detector in front of the source");
      }
    }
    return file;
  } catch (const InputError& error) {
    if (std::string(error.what()).rfind(path, 0) == 0) throw;
    throw error.within(path);
  }
}

// vpXmlParserCamera needs to be told the camera's name, takes 0 for what it cannot read and reports on the terminal, so
// its files are read here.
constexpr std::size_t kMaxXmlFile = std::size_t{1} << 20;

class VispFields {
 public:
  VispFields(const XmlDocument& document, const XmlElement& parent) : document_(document), parent_(parent) {}

  const XmlElement& need(const char* name) const {
    const auto found = parent_.childrenOf(name);
    if (found.size() != 1) {
      throw InputError(document_.placeOf(parent_), name, found.empty() ? "" : std::to_string(found.size()),
                       found.empty() ? "is missing" : "must not be given twice");
    }
    return *found[0];
  }
  double number(const char* name) const {
    return parseNumber(place(name), name, trimmed(document_.textOf(need(name))));
  }
  double positive(const char* name) const { return requirePositive(place(name), name, number(name)); }
  int side(const char* name) const {
    const int pixels = parseInteger(place(name), name, trimmed(document_.textOf(need(name))));
    requireBetween(place(name), name, pixels, 1, kMaxImageSide);
    return pixels;
  }

 private:
  std::string place(const char* name) const { return document_.placeOf(need(name)); }

  const XmlDocument& document_;
  const XmlElement& parent_;
};

CameraFile readXmlCamera(const std::string& path) {
  const XmlDocument document(path, readWholeFile(path, kMaxXmlFile));
  const auto cameras = document.root().childrenOf("camera");
  if (cameras.size() != 1) {
    throw InputError(document.placeOf(document.root()), "camera", std::to_string(cameras.size()),
                     "there must be just one");
  }
  const VispFields camera(document, *cameras[0]);
  XrayCamera::Parameters p;
  p.width_px = camera.side("image_width");
  p.height_px = camera.side("image_height");
  const XmlElement* plain_model = nullptr;
  std::string types;
  for (const XmlElement* const model : cameras[0]->childrenOf("model")) {
    const std::string type(trimmed(document.textOf(VispFields(document, *model).need("type"))));
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
    return {XrayCamera(p), {}, {}};
  } catch (const InputError& error) {
    throw error.within(path);
  }
}

nlohmann::ordered_json distortionAsJson(const DetectorDistortion& d) {
  const std::vector<double> center = {d.center_px.x(), d.center_px.y()};
  switch (d.model) {
    case DetectorDistortion::Model::kRadial:
      return {{"model", "radial"}, {"k1", d.bend.k1}, {"k2", d.bend.k2}, {"skew_px", d.skew_px}};
    case DetectorDistortion::Model::kIntensifier:
      return {{"model", "intensifier"},
              {"k1", d.bend.k1},
              {"k2", d.bend.k2},
              {"s1_deg", radToDeg(d.bend.s1_rad)},
              {"s2_deg", radToDeg(d.bend.s2_rad)},
              {"centre_px", center}};
    case DetectorDistortion::Model::kPolynomial:
      break;
  }
  const Eigen::Matrix2Xd& c = d.shift.coefficients_px;
  return {{"model", "polynomial"},
          {"order", d.shift.order},
          {"centre_px", center},
          {"unit_px", d.unit_px.x()},
          {"shift_x_px", std::vector<double>(c.row(0).begin(), c.row(0).end())},
          {"shift_y_px", std::vector<double>(c.row(1).begin(), c.row(1).end())}};
}

// Of the pose, which is there as well, a camera file has no use, and so none of its unit of length.
CameraFile readMayaCamera(const std::string& path) { return {readMayaCam(path, 1).camera, {}, {}}; }

struct CameraFormat {
  const char* extension;
  CameraFile (*read)(const std::string& path);
};

constexpr CameraFormat kCameraFormats[] = {
    {".yaml", readYamlCamera}, {".yml", readYamlCamera}, {".xml", readXmlCamera},
    {".txt", readMayaCamera},  {".csv", readMayaCamera},
};

}  // namespace

CameraFile CameraFile::at(double source_detector_distance_m) const {
  XrayCamera::Parameters p = camera.parameters();
  if (!distance_law || !p.source_detector_distance_m) {
    throw InputError("camera", "source_detector_distance", "", "is missing: K is known at one distance only");
  }
  requirePositive("camera", "source_detector_distance_mm", 1e3 * source_detector_distance_m);
  const double step_m = source_detector_distance_m - *p.source_detector_distance_m;
  const double stretch = 1 + step_m / (*p.source_detector_distance_m + distance_law->offset_m);
  p.fx_px *= stretch;
  p.fy_px *= stretch;
  p.cx_px += step_m * distance_law->principal_point_slope_px_per_m.x();
  p.cy_px += step_m * distance_law->principal_point_slope_px_per_m.y();
  p.source_detector_distance_m = source_detector_distance_m;
  CameraFile moved{XrayCamera(p), distortion, distance_law};
  if (distortion && distortion->model == DetectorDistortion::Model::kRadial) {
    moved.distortion =
        DetectorDistortion::radial(moved.camera, distortion->bend.k1, distortion->bend.k2, distortion->skew_px);
  }
  return moved;
}

CameraFile readCameraFile(const std::string& path) { return formatOf(path, kCameraFormats).read(path); }

XrayCamera readCamera(const std::string& path) {
  const CameraFile file = readCameraFile(path);
  if (!file.distortion) return file.camera;
  throw InputError(path, "distortion", "", "must be none here: correct the distortion in the image first");
}

nlohmann::ordered_json cameraAsJson(const CameraFile& file) {
  const auto& p = file.camera.parameters();
  nlohmann::ordered_json json = {{"image_size_px", {p.width_px, p.height_px}},
                                 {"fx_px", p.fx_px},
                                 {"fy_px", p.fy_px},
                                 {"cx_px", p.cx_px},
                                 {"cy_px", p.cy_px}};
  if (p.pixel_spacing_m) json["pixel_spacing_mm"] = millimetres(*p.pixel_spacing_m);
  if (p.source_detector_distance_m) json["source_detector_distance_mm"] = millimetres(*p.source_detector_distance_m);
  if (file.distortion) json["distortion"] = distortionAsJson(*file.distortion);
  if (const auto& law = file.distance_law) {
    const Eigen::Vector2d slope = 1e-3 * law->principal_point_slope_px_per_m;
    json["source_detector_distance"] = {{"offset_mm", 1e3 * law->offset_m},
                                        {"principal_point_slope_px_per_mm", {slope.x(), slope.y()}}};
  }
  return json;
}

void writeCamera(const std::string& path, const XrayCamera& camera) {
  writeWholeFile(path, asYaml(cameraAsJson({camera, {}, {}})));
}

}  // namespace angio::io
