// SPDX-License-Identifier: GPL-2.0-or-later
#include "inspect_tree.hpp"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/evaluation/branch_picture.hpp"
#include "angio/io/curve_folder.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio::apps {
namespace {

std::string asTable(const std::vector<NumberedBranch>& branches) {
  std::size_t width = 4;
  for (const NumberedBranch& branch : branches) width = std::max(width, branch.name.size());
  const auto row = [width](const std::string& number, const std::string& name, const std::string& parent,
                           const std::string& length, const std::string& radius) {
    return formatted("%8s  ", number.c_str()) + name + std::string(width - name.size(), ' ') +
           formatted("%8s%14s%18s\n", parent.c_str(), length.c_str(), radius.c_str());
  };
  std::string table = "\n" + row("branch", "name", "parent", "length [mm]", "mean radius [mm]");
  for (const NumberedBranch& b : branches) {
    table +=
        row(std::to_string(b.number), withoutControls(b.name), b.parent ? std::to_string(*b.parent) : "root",
            formatted("%.2f", 1e3 * b.length_m), b.mean_radius_m ? formatted("%.2f", 1e3 * *b.mean_radius_m) : "-");
  }
  return table;
}

Json asJson(const std::vector<NumberedBranch>& branches) {
  Json rows = Json::array();
  for (const NumberedBranch& b : branches) {
    rows.push_back({{"number", b.number},
                    {"name", b.name},
                    {"parent", b.parent ? Json(*b.parent) : Json(nullptr)},
                    {"length_mm", 1e3 * b.length_m},
                    {"mean_radius_mm", b.mean_radius_m ? Json(1e3 * *b.mean_radius_m) : Json(nullptr)}});
  }
  return rows;
}

// Writes the picture and adds its table.
void showBranches(const VesselTree& tree, const TreeToInspect& o, Inspected& told) {
  const bool folder = std::filesystem::is_directory(o.file);
  const auto branches =
      numberedBranches(tree, folder ? branchNames(tree, readCurveFolder(o.file)) : std::vector<std::string>());
  const bool known = !o.calibration.empty();
  const Eigen::Matrix3d R_lps_model = known ? readCArmFile(o.calibration).R_lps_model : Eigen::Matrix3d::Identity();
  const std::string axes =
      known ? "by R_lps_model of the calibration" : "x, y, z of the file taken as L, P, S; --calibration: R_lps_model";
  writeBranchPicture(o.picture, branchPicture(tree, branches, R_lps_model, "patient's axes: " + axes));
  told.found.add("patient's axes", axes, "patient_axes", axes);
  if (o.json) {
    told.found.add("numbers", "", "branch_table", asJson(branches));
  } else {
    told.table = asTable(branches);
  }
}

}  // namespace

Inspected inspectTree(const TreeToInspect& o) {
  const VesselTree tree = readVesselTree(o.file);
  const Eigen::Vector3d low_mm = 1e3 * tree.points().rowwise().minCoeff();
  const Eigen::Vector3d high_mm = 1e3 * tree.points().rowwise().maxCoeff();
  const auto known =
      std::count_if(tree.radii().begin(), tree.radii().end(), [](const auto& r) { return r.has_value(); });
  Findings found;
  found.count("points", "points", tree.size());
  found.count("branches", "branches", static_cast<std::int64_t>(tree.branches().size()));
  found.length("length", "length_mm", tree.length());
  found.count("radii", "known_radii", known, " known");
  found.count("model id", "model_id", static_cast<std::int64_t>(modelId(tree)), " in messages");
  const bool said = saysItsFrame(o.file);
  found.add("axes", said ? "L, P, S, as the file says or turned to them" : "the file's own; it does not say which",
            "patient_frame", said ? Json("LPS") : Json(nullptr));
  for (const int axis : {0, 1, 2}) {
    const std::string name(1, "xyz"[axis]);
    found.add(name, inWords(low_mm[axis], "to ") + inWords(high_mm[axis], "mm"), name + "_mm",
              {low_mm[axis], high_mm[axis]});
  }
  Inspected told{found};
  if (!o.picture.empty()) showBranches(tree, o, told);
  return told;
}

}  // namespace angio::apps
