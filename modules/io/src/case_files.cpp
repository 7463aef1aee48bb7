// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/case_files.hpp"

#include <filesystem>
#include <map>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/pose_files.hpp"
#include "yaml.hpp"

namespace angio {
namespace {

// One set is read by one of these, which remembers the cameras and poses that many cases share.
class CaseReader {
 public:
  explicit CaseReader(const std::string& path) : path_(path), folder_(std::filesystem::path(path).parent_path()) {}

  CaseSet read() {
    const YamlNode root = readYaml(path_);
    YamlMap map(path_, root, "case set");
    const auto sequence = map.find("sequence");
    const auto tree = map.find("tree");
    const auto camera = map.find("camera");
    const YamlField cases = map.need("cases");
    map.refuseOthers();
    CaseSet result;
    result.sequence = sequence && sequence->flag();
    if (cases.node->kind != YamlNode::Kind::kSequence || cases.node->items.empty()) {
      cases.refuse("must be a list of at least one case");
    }
    for (std::size_t i = 0; i < cases.node->items.size(); ++i) {
      result.cases.push_back(readCase(*cases.item(i).node, tree, camera));
    }
    return result;
  }

 private:
  Case readCase(const YamlNode& node, const std::optional<YamlField>& set_tree,
                const std::optional<YamlField>& set_camera) {
    YamlMap map(path_, node, "case");
    Case result;
    const YamlField name = map.need("name");
    result.name = name.text();
    if (!names_.insert(result.name).second) name.refuse("must not be given twice");
    const auto own_tree = map.find("tree"), own_camera = map.find("camera");
    const auto centerline = map.find("centerline"), image = map.find("image");
    const YamlField initial_pose = map.need("initial_pose");
    const auto truth_pose = map.find("truth_pose"), truth_displacements = map.find("truth_displacements");
    map.refuseOthers();

    const auto tree = own_tree ? own_tree : set_tree, camera = own_camera ? own_camera : set_camera;
    if (!tree) throw missing(node, "tree");
    if (!camera) throw missing(node, "camera");
    if (!centerline && !image) throw missing(node, "centerline or image");
    result.tree_path = existingFile(*tree);
    View view{readShared(*camera, cameras_, readCamera), std::nullopt, std::nullopt};
    if (centerline) view.centerline_path = existingFile(oneView(*centerline));
    if (image) view.image_path = existingFile(oneView(*image));
    result.views.push_back(std::move(view));
    result.initial_pose = readShared(initial_pose, poses_, readPose).T_camera_model;
    if (truth_pose) result.truth_pose = readShared(*truth_pose, poses_, readPose).T_camera_model;
    if (truth_displacements) result.truth_displacements_path = existingFile(*truth_displacements);
    return result;
  }

  InputError missing(const YamlNode& node, const std::string& key) const {
    return InputError(path_ + ":" + std::to_string(node.line), key, "", "is missing");
  }

  // The views of a case are a list, or, for one view, what would stand in it.
  static YamlField oneView(const YamlField& field) {
    if (field.node->kind != YamlNode::Kind::kSequence) return field;
    if (field.node->items.size() != 1) field.refuse("must be one view; cases with several views cannot be run yet");
    return field.item(0);
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
    const YamlField one = oneView(field);
    const std::string file = existingFile(one);
    const auto at = known.find(file);
    if (at != known.end()) return at->second;
    try {
      return known.emplace(file, read_file(file)).first->second;
    } catch (const InputError& error) {
      throw error.within(one.place());
    }
  }

  std::string path_;
  std::filesystem::path folder_;
  std::set<std::string> names_;
  std::map<std::string, XrayCamera> cameras_;
  std::map<std::string, PoseFile> poses_;
};

}  // namespace

CaseSet readCaseSet(const std::string& path) { return CaseReader(path).read(); }

}  // namespace angio
