// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/polygon_files.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {
namespace {

constexpr double kMaxPixel_px = 65536;
// Numbers of a few letters become sixteen bytes each, and lists of them twice that while they grow.
constexpr std::size_t kMaxAnnotations = std::size_t{128} << 20;

// As a message has it. Lists are not written out: one in another, a file of some 100 KB exhausts the stack.
std::string jsonText(const nlohmann::json& value) {
  if (value.is_structured()) return value.is_array() ? "(list of " + std::to_string(value.size()) + ")" : "(map)";
  return value.dump().substr(0, 40);
}

const nlohmann::json& memberOf(const std::string& place, const nlohmann::json& object, const char* key,
                               bool (nlohmann::json::*is)() const noexcept, const char* rule) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || found == object.end()) throw InputError(place, key, "", "is missing");
  if (!((*found).*is)()) throw InputError(place, key, jsonText(*found), rule);
  return *found;
}

double pixelIn(const std::string& place, const nlohmann::json& value) {
  const bool sane = value.is_number() && std::abs(value.get<double>()) <= kMaxPixel_px;
  if (!sane) throw InputError(place, "segmentation", jsonText(value), "must be pixels of a detector");
  return value.get<double>();
}

int sizeIn(const std::string& place, const nlohmann::json& image, const char* key) {
  const nlohmann::json& value = memberOf(place, image, key, &nlohmann::json::is_number, "must be a number");
  const double size_px = value.get<double>();
  if (!(size_px >= 1 && size_px <= kMaxPixel_px))
    throw InputError(place, key, value.dump(), "must be pixels of an image");
  return static_cast<int>(size_px);
}

std::vector<Eigen::Vector2d> polygonIn(const std::string& place, const nlohmann::json& numbers) {
  if (!numbers.is_array() || numbers.size() < 6 || numbers.size() % 2 != 0) {
    throw InputError(place, "segmentation", jsonText(numbers),
                     "must be lists x1, y1, x2, y2, ... of at least three corners");
  }
  std::vector<Eigen::Vector2d> corners;
  for (std::size_t k = 0; k < numbers.size(); k += 2) {
    corners.emplace_back(pixelIn(place, numbers[k]), pixelIn(place, numbers[k + 1]));
  }
  return corners;
}

}  // namespace

std::vector<AnnotatedImage> readCocoPolygons(const std::string& path) {
  const nlohmann::json file = nlohmann::json::parse(readWholeFile(path, kMaxAnnotations), nullptr, false);
  if (file.is_discarded()) throw InputError(path, "", "", "is not JSON");
  const auto folder = std::filesystem::path(path).parent_path();
  const char* const list = "must be a list";

  std::map<std::string, AnnotatedImage> by_id;
  for (const nlohmann::json& image : memberOf(path, file, "images", &nlohmann::json::is_array, list)) {
    const std::string place = path + ": images";
    const std::string name = memberOf(place, image, "file_name", &nlohmann::json::is_string, "must be a name");
    const std::string id = memberOf(place, image, "id", &nlohmann::json::is_number, "must be a number").dump();
    auto found = folder / name;
    std::error_code ignored;  // A name that no file can have is one that is not there.
    if (!std::filesystem::exists(found, ignored)) found = folder / "images" / name;
    const AnnotatedImage entry{found.string(), sizeIn(place, image, "width"), sizeIn(place, image, "height"), {}};
    if (!by_id.emplace(id, entry).second) throw InputError(place, "id", id, "must not stand twice");
  }
  for (const nlohmann::json& annotation : memberOf(path, file, "annotations", &nlohmann::json::is_array, list)) {
    const std::string place = path + ": annotations";
    const std::string id =
        memberOf(place, annotation, "image_id", &nlohmann::json::is_number, "must be a number").dump();
    const auto image = by_id.find(id);
    if (image == by_id.end()) throw InputError(place, "image_id", id, "must be the id of one of the images");
    for (const nlohmann::json& polygon : memberOf(place, annotation, "segmentation", &nlohmann::json::is_array, list)) {
      image->second.polygons_px.push_back(polygonIn(place, polygon));
    }
  }
  std::vector<AnnotatedImage> images;
  for (auto& [id, image] : by_id) {
    if (!image.polygons_px.empty()) images.push_back(std::move(image));
  }
  if (images.empty()) throw InputError(path, "annotations", "0", "must be at least one polygon");
  std::sort(images.begin(), images.end(),
            [](const AnnotatedImage& a, const AnnotatedImage& b) { return a.image_path < b.image_path; });
  return images;
}

}  // namespace angio::io
