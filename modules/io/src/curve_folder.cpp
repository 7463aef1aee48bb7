// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/curve_folder.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "tree_formats.hpp"

namespace angio::io {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExtension = ".mrk.json";
constexpr double kUnknownRadius_mm = 1;

// Where a curve hangs: its own point, and the tree's row.
struct Joint {
  Eigen::Index point;
  std::size_t row;
  bool same_place;
};

class CurveTree {
 public:
  CurveTree(const std::string& from, const std::vector<NamedCurve>& curves)
      : from_(from), curves_(curves), added_(curves.size()) {}

  std::vector<TreeRow> grown() {
    added_[0] = true;
    run(0, 0, 1, -1);
    std::size_t next = 0;
    for (std::size_t left = curves_.size() - 1; left > 0;) {
      for (; next < rows_.size(); ++next) left -= addAllAt(next);
      if (left > 0) left -= addNearest();
    }
    return std::move(rows_);
  }

 private:
  // Curves that have a point in common with the tree there.
  std::size_t addAllAt(std::size_t row) {
    std::size_t count = 0;
    for (std::size_t c = 0; c < curves_.size(); ++c) {
      if (added_[c]) continue;
      for (Eigen::Index i = 0; i < curves_[c].points_mm.cols(); ++i) {
        if (curves_[c].points_mm.col(i) != rows_[row].point_mm) continue;
        add(c, {i, row, true});
        ++count;
        break;
      }
    }
    return count;
  }

  // One that begins or ends inside a vessel of the tree.
  std::size_t addNearest() {
    for (std::size_t c = 0; c < curves_.size(); ++c) {
      if (added_[c]) continue;
      for (const Eigen::Index end : {Eigen::Index{0}, curves_[c].points_mm.cols() - 1}) {
        const Eigen::Vector3d p = curves_[c].points_mm.col(end);
        const auto nearest = std::min_element(rows_.begin(), rows_.end(), [&](const TreeRow& a, const TreeRow& b) {
          return (a.point_mm - p).squaredNorm() < (b.point_mm - p).squaredNorm();
        });
        if ((nearest->point_mm - p).norm() > nearest->radius_mm.value_or(kUnknownRadius_mm)) continue;
        add(c, {end, static_cast<std::size_t>(nearest - rows_.begin()), false});
        return 1;
      }
    }
    const NamedCurve& alone = curves_[std::find(added_.begin(), added_.end(), false) - added_.begin()];
    throw InputError(alone.place, "controlPoints", alone.name,
                     "must begin, end or have a point on another curve of " + from_);
  }

  void add(std::size_t c, const Joint& joint) {
    added_[c] = true;
    const int row = static_cast<int>(joint.row);
    if (joint.same_place) {
      run(c, joint.point + 1, 1, row);
      run(c, joint.point - 1, -1, row);
    } else {
      run(c, joint.point, joint.point == 0 ? 1 : -1, row);
    }
  }

  // Appends a curve's points from one on, up to its end or to a point that the tree has.
  void run(std::size_t c, Eigen::Index from, int step, int parent) {
    const NamedCurve& curve = curves_[c];
    for (Eigen::Index i = from; i >= 0 && i < curve.points_mm.cols(); i += step) {
      const Eigen::Vector3d p = curve.points_mm.col(i);
      if (parent >= 0 && p == rows_[parent].point_mm) continue;  // No edge without a length.
      if (!known_.insert(positionOf(p)).second) return;
      if (rows_.size() == static_cast<std::size_t>(kMaxPoints)) {
        throw InputError(from_, "controlPoints", "", "must not exceed " + std::to_string(kMaxPoints));
      }
      const int id = static_cast<int>(rows_.size());
      rows_.push_back({0, id, p, curve.radii_mm[i], parent});
      parent = id;
    }
  }

  const std::string& from_;
  const std::vector<NamedCurve>& curves_;
  std::vector<bool> added_;
  std::set<Position> known_;
  std::vector<TreeRow> rows_;
};

}  // namespace

std::vector<NamedCurve> readCurveFolder(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code failed;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed)) {
    if (endsWith(at->path().filename().string(), kExtension)) files.push_back(at->path().string());
  }
  if (failed) throw InputError(folder, "", "", "cannot be listed: " + failed.message());
  if (files.empty()) throw InputError(folder, "", "", std::string("is a folder without a file *") + kExtension);
  std::sort(files.begin(), files.end());
  std::vector<NamedCurve> curves;
  for (const std::string& file : files) {
    const std::string name = fs::path(file).filename().string();
    for (NamedCurve& curve : readMrkJsonCurves(file)) {
      curve.name = name.substr(0, name.size() - std::string(kExtension).size());
      curves.push_back(std::move(curve));
    }
  }
  return curves;
}

VesselTree joinedCurves(const std::string& from, const std::vector<NamedCurve>& curves) {
  if (curves.empty()) throw InputError(from, "curves", "0", "must be at least one");
  return treeOfRows(from, CurveTree(from, curves).grown());
}

std::vector<std::string> branchNames(const VesselTree& tree, const std::vector<NamedCurve>& curves) {
  std::map<Position, std::set<std::size_t>> curves_at;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    for (const auto& p_mm : curves[c].points_mm.colwise()) {
      curves_at[positionOf(p_mm / 1e3)].insert(c);  // As the tree's were.
    }
  }
  std::vector<std::string> names;
  const TreeTopology map(tree);
  for (int branch = 0; branch < map.branchCount(); ++branch) {
    std::vector<int> on(curves.size(), 0);
    for (const int i : map.points(branch)) {
      const auto found = curves_at.find(positionOf(tree.points().col(i)));
      if (found == curves_at.end()) continue;
      for (const std::size_t c : found->second) ++on[c];
    }
    const auto most = std::max_element(on.begin(), on.end());
    const bool named = most != on.end() && *most > 0;
    names.push_back(named ? curves[most - on.begin()].name : "");
  }
  return names;
}

const NamedCurve& curveOfName(const std::string& from, const std::vector<NamedCurve>& curves, const std::string& name) {
  const NamedCurve* found = nullptr;
  for (const NamedCurve& curve : curves) {
    if (curve.name != name && !endsWith(curve.name, " " + name)) continue;
    if (found) throw InputError(from, "curve", name, "must be the name of one curve: " + found->name + " and another");
    found = &curve;
  }
  if (!found) throw InputError(from, "curve", name, "must be the name of a curve, or its last word");
  return *found;
}

}  // namespace angio::io
