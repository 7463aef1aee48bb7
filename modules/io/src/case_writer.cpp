// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {
namespace {

// A text in double quotes, as YAML escapes it.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + "\"";
}

std::string listOf(const std::vector<std::string>& entries) {
  std::string result;
  for (const std::string& entry : entries) result += (result.empty() ? "" : ", ") + entry;
  return "[" + result + "]";
}

// One set is written by one of these, which remembers what cameras and view poses it has written.
class CaseWriter {
 public:
  explicit CaseWriter(const std::string& path) : path_(path), folder_(std::filesystem::path(path).parent_path()) {}

  void write(const CaseSet& set) {
    if (set.cases.empty()) throw InputError(path_, "cases", "", "must be a list of at least one case");
    std::string content = set.sequence ? "sequence: true\n" : "";
    const std::string camera = camerasOf(set.cases.front()), tree = relative(set.cases.front().tree_path);
    content += "tree: " + tree + "\ncamera: " + camera + "\ncases:\n";
    for (std::size_t i = 0; i < set.cases.size(); ++i) {
      const Case& one = set.cases[i];
      checkCase(one);
      content += "  - name: " + quoted(one.name) + "\n";
      const auto add = [&](const std::string& key, const std::string& value) {
        content += "    " + key + ": " + value + "\n";
      };
      if (const std::string own = relative(one.tree_path); own != tree) add("tree", own);
      if (const std::string own = camerasOf(one); own != camera) add("camera", own);
      addPaths(one, "centerline", &View::centerline_path, add);
      addPaths(one, "image", &View::image_path, add);
      char number[32];
      std::snprintf(number, sizeof number, "%04zu", i);
      add("initial_pose", poseFile("initial_", number, one.initial_pose));
      if (one.truth_pose) add("truth_pose", poseFile("truth_", number, *one.truth_pose));
      if (one.truth_displacements_path) add("truth_displacements", relative(*one.truth_displacements_path));
    }
    writeWholeFile(path_, content);
  }

 private:
  void checkCase(const Case& one) {
    if (!names_.insert(one.name).second) throw InputError(path_, "name", one.name, "must not be given twice");
    if (one.tree_path.empty()) throw InputError(path_, "tree", "", "is missing");
    if (one.views.empty()) throw InputError(path_, "camera", "", "must be at least one camera");
  }

  template <typename Add>
  void addPaths(const Case& one, const std::string& key, std::optional<std::string> View::*field, const Add& add) {
    std::vector<std::string> paths;
    for (const View& view : one.views) {
      if (!view.centerline_path && !view.image_path) throw InputError(path_, "centerline or image", "", "is missing");
      if (view.*field) paths.push_back(relative(*(view.*field)));
    }
    if (paths.empty()) return;
    if (paths.size() != one.views.size()) throw InputError(path_, key, one.name, "must be given for all views or none");
    add(key, listOf(paths));
  }

  std::string relative(const std::string& path) const {
    const auto whole = [](const std::filesystem::path& p) { return std::filesystem::absolute(p).lexically_normal(); };
    const std::filesystem::path inside = whole(path).lexically_relative(whole(folder_.empty() ? "." : folder_));
    const bool outside = inside.empty() || *inside.begin() == "..";
    return quoted(outside ? whole(path).string() : inside.string());
  }

  std::string beside(const std::string& name) const { return (folder_ / name).string(); }

  std::string poseFile(const char* kind, const char* number, const Pose& pose) const {
    const std::string name = std::string(kind) + number + ".yaml";
    writePose(beside(name), {pose, {}});
    return name;
  }

  std::string camerasOf(const Case& one) {
    std::vector<std::string> views;
    for (const View& view : one.views) {
      std::string entry = "{camera: " + nameOf("camera", view.camera, cameras_);
      if (!views.empty()) entry += ", T_view_first: " + nameOf("view", view.T_view_first, view_poses_);
      std::vector<std::string> corners;
      for (const Eigen::Vector2d& corner : view.collimator_px) {
        corners.push_back(listOf({exact(corner.x()), exact(corner.y())}));
      }
      if (!corners.empty()) entry += ", collimator_px: " + listOf(corners);
      views.push_back(entry + "}");
    }
    return listOf(views);
  }

  static bool same(const Pose& a, const Pose& b) { return a.matrix() == b.matrix(); }
  static bool same(const XrayCamera& one, const XrayCamera& other) {
    const auto &a = one.parameters(), &b = other.parameters();
    return a.width_px == b.width_px && a.height_px == b.height_px && a.fx_px == b.fx_px && a.fy_px == b.fy_px &&
           a.cx_px == b.cx_px && a.cy_px == b.cy_px && a.pixel_spacing_m == b.pixel_spacing_m &&
           a.source_detector_distance_m == b.source_detector_distance_m;
  }
  static void writeTo(const std::string& path, const Pose& pose) { writePose(path, {pose, {}}); }
  static void writeTo(const std::string& path, const XrayCamera& camera) { writeCamera(path, camera); }

  // The file that holds a value; written when it is a new one.
  template <typename Value>
  std::string nameOf(const std::string& kind, const Value& value, std::vector<Value>& written) {
    std::size_t at = 0;
    while (at < written.size() && !same(written[at], value)) ++at;
    const std::string name = kind + (at == 0 ? "" : "_" + std::to_string(at + 1)) + ".yaml";
    if (at == written.size()) {
      writeTo(beside(name), value);
      written.push_back(value);
    }
    return name;
  }

  std::string path_;
  std::filesystem::path folder_;
  std::set<std::string> names_;
  std::vector<XrayCamera> cameras_;
  std::vector<Pose> view_poses_;
};

}  // namespace

void writeCaseSet(const std::string& path, const CaseSet& set) { CaseWriter(path).write(set); }

}  // namespace angio::io
