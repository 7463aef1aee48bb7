// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/case_files.hpp"

#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"

namespace angio::io {
namespace {

// A rounded identity in a file is one.
constexpr double kSamePlace = 1e-6;

// What stands in a list, or, for one, in its place.
std::vector<YamlField> entriesOf(const YamlField& field) {
  if (field.node->kind != YamlNode::Kind::kSequence) return {field};
  return field.items("must be a list");
}

// As many entries as there are views.
std::vector<YamlField> entriesOf(const YamlField& field, std::size_t views) {
  auto entries = entriesOf(field);
  if (entries.size() != views) {
    field.refuse(views == 1 ? "must be one: there is one camera"
                            : "must be a list of " + std::to_string(views) + ", one for each camera");
  }
  return entries;
}

std::vector<Eigen::Vector2d> cornersIn(const YamlField& field) {
  std::vector<Eigen::Vector2d> corners;
  for (const YamlField& entry : entriesOf(field)) {
    const auto xy = entry.numbers(2);
    corners.emplace_back(xy[0], xy[1]);
  }
  // Around a convex polygon one turns once, always to the same side.
  const std::size_t n = corners.size();
  double turned = 0, turned_either_way = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d a = corners[(i + 1) % n] - corners[i], b = corners[(i + 2) % n] - corners[(i + 1) % n];
    const double turn = std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
    turned += turn;
    turned_either_way += std::abs(turn);
  }
  if (n < 3 || std::abs(std::abs(turned) - 2 * kPi) > 1e-6 || turned_either_way > std::abs(turned) + 1e-6) {
    field.refuse("must be the corners of a convex polygon, in order");
  }
  return corners;
}

// R, A, S from L, P, S, and back.
Pose turnedFrame() {
  Pose T = Pose::Identity();
  T.linear().diagonal() << -1, -1, 1;
  return T;
}

// One set is read by one of these, which remembers the cameras and poses that many cases share.
class CaseReader {
 public:
  explicit CaseReader(const std::string& path) : path_(path), folder_(std::filesystem::path(path).parent_path()) {}

  CaseSet read() {
    const YamlNode root = readYaml(path_);
    YamlMap map(path_, root, "case set");
    const auto sequence = map.find("sequence"), period = map.find("frame_period_s");
    const auto tree = map.find("tree"), frame = map.find("frame");
    const auto camera = map.find("camera"), T_view_first = map.find("T_view_first");
    if (frame) isRas(*frame);
    const YamlField cases = map.need("cases");
    map.refuseOthers();
    CaseSet result;
    result.sequence = sequence && sequence->flag();
    if (period) result.frame_period_s = period->between(1e-3, 3600);
    for (const YamlField& one : cases.items("must be a list of at least one case", 1)) {
      result.cases.push_back(readCase(*one.node, {tree, frame}, {camera, T_view_first}));
    }
    return result;
  }

 private:
  // What is said of the tree, and of the axes that poses have it in.
  struct Tree {
    std::optional<YamlField> file, frame;
  };

  // What is said of the cameras in one place, the set's or a case's.
  struct Cameras {
    std::optional<YamlField> camera, T_view_first;
  };

  Case readCase(const YamlNode& node, const Tree& set_tree, const Cameras& set_cameras) {
    YamlMap map(path_, node, "case");
    Case result;
    const YamlField name = map.need("name");
    result.name = name.text();
    if (!names_.insert(result.name).second) name.refuse("must not be given twice");
    const Tree own_tree{map.find("tree"), map.find("frame")};
    const Cameras own{map.find("camera"), map.find("T_view_first")};
    const auto centerline = map.find("centerline"), image = map.find("image");
    const YamlField initial_pose = map.need("initial_pose");
    const auto truth_pose = map.find("truth_pose"), truth_displacements = map.find("truth_displacements");
    map.refuseOthers();

    const auto tree = own_tree.file ? own_tree.file : set_tree.file,
               camera = own.camera ? own.camera : set_cameras.camera;
    if (!tree) throw missing(node, "tree");
    if (!camera) throw missing(node, "camera");
    if (!centerline && !image) throw missing(node, "centerline or image");
    result.tree_path = existingFile(*tree);
    auto T_view_first = own.T_view_first;
    // The set's poses are of several views: a case's one camera of its own has none.
    if (!T_view_first && !(own.camera && entriesOf(*own.camera).size() == 1)) T_view_first = set_cameras.T_view_first;
    result.views = readViews(*camera, T_view_first);
    const auto setPaths = [&](const YamlField& field, std::optional<std::string> View::*path) {
      const auto entries = entriesOf(field, result.views.size());
      for (std::size_t v = 0; v < entries.size(); ++v) result.views[v].*path = existingFile(entries[v]);
    };
    if (centerline) setPaths(*centerline, &View::centerline_path);
    if (image) setPaths(*image, &View::image_path);
    result.initial_pose = readShared(initial_pose, poses_, readPose).T_camera_model;
    if (truth_pose) result.truth_pose = readShared(*truth_pose, poses_, readPose).T_camera_model;
    if (truth_displacements) result.truth_displacements_path = existingFile(*truth_displacements);
    const auto frame = own_tree.frame ? own_tree.frame : set_tree.frame;
    if (frame && isRas(*frame) && readShared(*tree, trees_that_say_, saysItsFrame)) toLps(*frame, result);
    return result;
  }

  static bool isRas(const YamlField& frame) {
    const std::string name = frame.text();
    if (name != "LPS" && name != "RAS") frame.refuse("must be LPS or RAS: the axes of the tree that poses are of");
    return name == "RAS";
  }

  // Poses are of the tree as it is read.
  static void toLps(const YamlField& frame, Case& one) {
    if (one.truth_displacements_path)
      frame.refuse("must be LPS where truth_displacements stand beside a tree that says its axes");
    one.initial_pose = one.initial_pose * turnedFrame();
    if (one.truth_pose) one.truth_pose = *one.truth_pose * turnedFrame();
  }

  InputError missing(const YamlNode& node, const std::string& key) const {
    return InputError(path_ + ":" + std::to_string(node.line), key, "", "is missing");
  }

  // The views with their cameras and where these stand; what was seen comes later.
  std::vector<View> readViews(const YamlField& camera, const std::optional<YamlField>& T_view_first) {
    const auto cameras = entriesOf(camera);
    if (cameras.empty()) camera.refuse("must be at least one camera");
    std::vector<std::optional<YamlField>> poses(cameras.size());
    if (T_view_first) {
      const auto listed = entriesOf(*T_view_first);
      if (listed.size() != cameras.size() && listed.size() + 1 != cameras.size()) {
        T_view_first->refuse("must be a list of " + std::to_string(cameras.size()) +
                             ", one for each camera, or without the first");
      }
      std::copy(listed.rbegin(), listed.rend(), poses.rbegin());
    }
    std::vector<View> views;
    for (std::size_t v = 0; v < cameras.size(); ++v) {
      if (cameras[v].node->kind == YamlNode::Kind::kMap) {
        YamlMap map(path_, *cameras[v].node, cameras[v].key);
        views.push_back({readShared(map.need("camera"), cameras_, readCamera), {}, {}, {}, {}});
        const auto own = map.find("T_view_first"), corners = map.find("collimator_px");
        map.refuseOthers();
        if (own) poses[v] = own;
        if (corners) views.back().collimator_px = cornersIn(*corners);
      } else {
        views.push_back({readShared(cameras[v], cameras_, readCamera), {}, {}, {}, {}});
      }
      views.back().T_view_first = placeOf(v, cameras[v], poses[v]);
    }
    return views;
  }

  Pose placeOf(std::size_t view, const YamlField& camera, const std::optional<YamlField>& pose) {
    if (!pose) {
      if (view == 0) return Pose::Identity();
      throw InputError(camera.place(), "T_view_first", "", "is missing: where does " + camera.key + " stand");
    }
    const Pose& T = readShared(*pose, view_poses_, readViewPose);
    if (view > 0) return T;
    if (!T.matrix().isApprox(Pose::Identity().matrix(), kSamePlace)) {
      pose->refuse("must be the identity: it is where the first view stands");
    }
    return Pose::Identity();
  }

  std::string existingFile(const YamlField& field) const {
    const std::string file = (folder_ / field.text()).string();
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
      throw InputError(field.place(), field.key, file,
                       std::filesystem::exists(file, error) ? "is not a file" : "no such file");
    }
    return file;
  }

  template <typename Value>
  const Value& readShared(const YamlField& field, std::map<std::string, Value>& known,
                          Value (*read_file)(const std::string& path)) const {
    const std::string file = existingFile(field);
    const auto at = known.find(file);
    if (at != known.end()) return at->second;
    try {
      return known.emplace(file, read_file(file)).first->second;
    } catch (const InputError& error) {
      throw error.within(field.place());
    }
  }

  std::string path_;
  std::filesystem::path folder_;
  std::set<std::string> names_;
  std::map<std::string, bool> trees_that_say_;  // Whether a tree's file says its axes.
  std::map<std::string, XrayCamera> cameras_;
  std::map<std::string, PoseFile> poses_;
  std::map<std::string, Pose> view_poses_;
};

}  // namespace

CaseSet readCaseSet(const std::string& path) { return CaseReader(path).read(); }

namespace {

using Json = nlohmann::ordered_json;

// One set is written by one of these, which remembers what cameras and view poses it has written.
class CaseWriter {
 public:
  explicit CaseWriter(const std::string& path) : path_(path), folder_(std::filesystem::path(path).parent_path()) {}

  void write(const CaseSet& set) {
    if (set.cases.empty()) throw InputError(path_, "cases", "", "must be a list of at least one case");
    const std::string tree = relative(set.cases.front().tree_path);
    const Json cameras = camerasOf(set.cases.front());
    Json json;
    if (set.sequence) json["sequence"] = true;
    if (set.frame_period_s) json["frame_period_s"] = *set.frame_period_s;
    json["tree"] = tree;
    json["camera"] = cameras;
    for (const Case& one : set.cases) {
      checkCase(one);
      Json& entry = json["cases"].emplace_back(Json{{"name", one.name}});
      if (const std::string own = relative(one.tree_path); own != tree) entry["tree"] = own;
      if (const Json own = camerasOf(one); own != cameras) entry["camera"] = own;
      addPaths(one, "centerline", &View::centerline_path, entry);
      addPaths(one, "image", &View::image_path, entry);
      const std::string number = formatted("%04zu", json["cases"].size() - 1);
      entry["initial_pose"] = poseFile("initial_" + number, one.initial_pose);
      if (one.truth_pose) entry["truth_pose"] = poseFile("truth_" + number, *one.truth_pose);
      if (one.truth_displacements_path) entry["truth_displacements"] = relative(*one.truth_displacements_path);
    }
    writeWholeFile(path_, asYaml(json));
  }

 private:
  void checkCase(const Case& one) {
    if (!names_.insert(one.name).second) throw InputError(path_, "name", one.name, "must not be given twice");
    if (one.tree_path.empty()) throw InputError(path_, "tree", "", "is missing");
    if (one.views.empty()) throw InputError(path_, "camera", "", "must be at least one camera");
  }

  void addPaths(const Case& one, const char* key, std::optional<std::string> View::*field, Json& entry) const {
    std::vector<std::string> paths;
    for (const View& view : one.views) {
      if (!view.centerline_path && !view.image_path) throw InputError(path_, "centerline or image", "", "is missing");
      if (view.*field) paths.push_back(relative(*(view.*field)));
    }
    if (paths.empty()) return;
    if (paths.size() != one.views.size()) throw InputError(path_, key, one.name, "must be given for all views or none");
    entry[key] = paths;
  }

  std::string relative(const std::string& path) const {
    const auto whole = [](const std::filesystem::path& p) { return std::filesystem::absolute(p).lexically_normal(); };
    const std::filesystem::path inside = whole(path).lexically_relative(whole(folder_.empty() ? "." : folder_));
    const bool outside = inside.empty() || *inside.begin() == "..";
    return outside ? whole(path).string() : inside.string();
  }

  std::string beside(const std::string& name) const { return (folder_ / name).string(); }

  std::string poseFile(const std::string& name, const Pose& pose) const {
    writePose(beside(name + ".yaml"), {pose, {}});
    return name + ".yaml";
  }

  Json camerasOf(const Case& one) {
    Json views = Json::array();
    for (const View& view : one.views) {
      Json entry = {{"camera", nameOf("camera", view.camera, cameras_)}};
      if (!views.empty()) entry["T_view_first"] = nameOf("view", view.T_view_first, view_poses_);
      for (const Eigen::Vector2d& corner : view.collimator_px) {
        entry["collimator_px"].push_back({corner.x(), corner.y()});
      }
      views.push_back(std::move(entry));
    }
    return views;
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
