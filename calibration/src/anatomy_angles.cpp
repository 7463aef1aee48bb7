// SPDX-License-Identifier: GPL-2.0-or-later
#include <set>

#include "angio/base/errors.hpp"
#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/io/yaml.hpp"

namespace angio::calibration {

AnatomyAngleSet readAnatomyAngles(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "angles");
  AnatomyAngleSet set;
  if (const auto machine = map.find("machine")) set.machine = machine->text();
  std::optional<double> common_m;
  if (const auto distance = map.find("source_isocentre_distance_mm")) common_m = 1e-3 * distance->positive();
  const YamlField views = map.need("views");
  if (views.node->kind != YamlNode::Kind::kSequence || views.node->items.empty())
    views.refuse("must be a list of views");
  std::set<std::string> names;
  for (std::size_t i = 0; i < views.node->items.size(); ++i) {
    const YamlField item = views.item(i);
    YamlMap view(path, *item.node, item.key);
    AnatomyAngles angles;
    const YamlField name = view.need("name");
    angles.name = name.text();
    if (!names.insert(angles.name).second) name.refuse("must be given once");
    angles.joints = readJoints(view);
    const auto run = view.find("run");
    angles.run = run ? run->text() : angles.name;
    angles.source_isocenter_distance_m = common_m;
    if (const auto own = view.find("source_isocentre_distance_mm"))
      angles.source_isocenter_distance_m = 1e-3 * own->positive();
    view.refuseOthers();
    set.views.push_back(std::move(angles));
  }
  map.refuseOthers();
  return set;
}

AnatomyAngles dicomAngles(const std::string& name, const std::string& path, int frame) {
  const XaGeometry geometry = XaRun(path).geometry(frame);
  if (!geometry.patient_angles) throw InputError(path, "(0018,1510) Positioner Primary Angle", "", "is missing");
  AnatomyAngles angles;
  angles.name = angles.run = name;
  angles.joints << geometry.patient_angles->primary_rad, geometry.patient_angles->secondary_rad, geometry.table_shift_m;
  angles.source_isocenter_distance_m = geometry.source_isocenter_distance_m;
  return angles;
}

}  // namespace angio::calibration
