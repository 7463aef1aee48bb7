// SPDX-License-Identifier: GPL-2.0-or-later
#include "foxglove_schemas.hpp"

#include <functional>
#include <initializer_list>
#include <map>
#include <utility>

#include "foxglove_json.hpp"

namespace angio::recording {
namespace {

using Fields = std::initializer_list<std::pair<const char*, Json>>;

Json object(const char* title, Fields fields) {
  Json schema{{"title", title}, {"type", "object"}, {"properties", Json::object()}, {"required", Json::array()}};
  for (const auto& [name, field] : fields) {
    schema["properties"][name] = field;
    schema["required"].push_back(name);
  }
  return schema;
}

Json typed(const char* type) { return {{"type", type}}; }
Json text() { return typed("string"); }
Json number() { return typed("number"); }
Json whole() { return typed("integer"); }
Json yesOrNo() { return typed("boolean"); }
Json binary() { return {{"type", "string"}, {"contentEncoding", "base64"}}; }
Json listOf(const Json& items) { return {{"type", "array"}, {"items", items}}; }
Json numbers(int count) {
  Json list = listOf(number());
  list["minItems"] = list["maxItems"] = count;
  return list;
}

// Foxglove knows times and durations by these titles.
Json clock(const char* title) { return object(title, {{"sec", whole()}, {"nsec", whole()}}); }
Json time() { return clock("time"); }

Json vector(const char* title) { return object(title, {{"x", number()}, {"y", number()}, {"z", number()}}); }
Json point2() { return object("foxglove.Point2", {{"x", number()}, {"y", number()}}); }
Json quaternion() {
  return object("foxglove.Quaternion", {{"x", number()}, {"y", number()}, {"z", number()}, {"w", number()}});
}
Json pose() {
  return object("foxglove.Pose", {{"position", vector("foxglove.Vector3")}, {"orientation", quaternion()}});
}
Json color() { return object("foxglove.Color", {{"r", number()}, {"g", number()}, {"b", number()}, {"a", number()}}); }
Json keyValue() { return object("foxglove.KeyValuePair", {{"key", text()}, {"value", text()}}); }

Json compressedImage() {
  return object("foxglove.CompressedImage",
                {{"timestamp", time()}, {"frame_id", text()}, {"data", binary()}, {"format", text()}});
}

Json cameraCalibration() {
  return object("foxglove.CameraCalibration", {{"timestamp", time()},
                                               {"frame_id", text()},
                                               {"width", whole()},
                                               {"height", whole()},
                                               {"distortion_model", text()},
                                               {"D", listOf(number())},
                                               {"K", numbers(9)},
                                               {"R", numbers(9)},
                                               {"P", numbers(12)}});
}

Json frameTransforms() {
  const Json one = object("foxglove.FrameTransform", {{"timestamp", time()},
                                                      {"parent_frame_id", text()},
                                                      {"child_frame_id", text()},
                                                      {"translation", vector("foxglove.Vector3")},
                                                      {"rotation", quaternion()}});
  return object("foxglove.FrameTransforms", {{"transforms", listOf(one)}});
}

Json posesInFrame() {
  return object("foxglove.PosesInFrame", {{"timestamp", time()}, {"frame_id", text()}, {"poses", listOf(pose())}});
}

Json log() {
  return object("foxglove.Log", {{"timestamp", time()},
                                 {"level", whole()},
                                 {"message", text()},
                                 {"name", text()},
                                 {"file", text()},
                                 {"line", whole()}});
}

Json imageAnnotations() {
  const Json circle = object("foxglove.CircleAnnotation", {{"timestamp", time()},
                                                           {"position", point2()},
                                                           {"diameter", number()},
                                                           {"thickness", number()},
                                                           {"fill_color", color()},
                                                           {"outline_color", color()}});
  const Json points = object("foxglove.PointsAnnotation", {{"timestamp", time()},
                                                           {"type", whole()},
                                                           {"points", listOf(point2())},
                                                           {"outline_color", color()},
                                                           {"outline_colors", listOf(color())},
                                                           {"fill_color", color()},
                                                           {"thickness", number()}});
  const Json label = object("foxglove.TextAnnotation", {{"timestamp", time()},
                                                        {"position", point2()},
                                                        {"text", text()},
                                                        {"font_size", number()},
                                                        {"text_color", color()},
                                                        {"background_color", color()}});
  return object("foxglove.ImageAnnotations",
                {{"circles", listOf(circle)}, {"points", listOf(points)}, {"texts", listOf(label)}});
}

// Of the primitives of an entity only lines are written; the others are lists that stay empty.
Json sceneUpdate() {
  const Json lines = object("foxglove.LinePrimitive", {{"type", whole()},
                                                       {"pose", pose()},
                                                       {"thickness", number()},
                                                       {"scale_invariant", yesOrNo()},
                                                       {"points", listOf(vector("foxglove.Point3"))},
                                                       {"color", color()},
                                                       {"colors", listOf(color())},
                                                       {"indices", listOf(whole())}});
  const Json none = listOf(object("foxglove.EmptyPrimitive", {{"color", color()}}));
  const Json entity = object("foxglove.SceneEntity", {{"timestamp", time()},
                                                      {"frame_id", text()},
                                                      {"id", text()},
                                                      {"lifetime", clock("duration")},
                                                      {"frame_locked", yesOrNo()},
                                                      {"metadata", listOf(keyValue())},
                                                      {"arrows", none},
                                                      {"cubes", none},
                                                      {"spheres", none},
                                                      {"cylinders", none},
                                                      {"lines", listOf(lines)},
                                                      {"triangles", none},
                                                      {"texts", none},
                                                      {"models", none}});
  const Json deletion =
      object("foxglove.SceneEntityDeletion", {{"timestamp", time()}, {"type", whole()}, {"id", text()}});
  return object("foxglove.SceneUpdate", {{"deletions", listOf(deletion)}, {"entities", listOf(entity)}});
}

}  // namespace

std::string foxgloveSchema(const std::string& name) {
  static const std::map<std::string, std::function<Json()>> kSchemas{{"foxglove.CompressedImage", compressedImage},
                                                                     {"foxglove.CameraCalibration", cameraCalibration},
                                                                     {"foxglove.FrameTransforms", frameTransforms},
                                                                     {"foxglove.PosesInFrame", posesInFrame},
                                                                     {"foxglove.ImageAnnotations", imageAnnotations},
                                                                     {"foxglove.SceneUpdate", sceneUpdate},
                                                                     {"foxglove.Log", log}};
  Json schema = kSchemas.at(name)();
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  return schema.dump();
}

}  // namespace angio::recording
