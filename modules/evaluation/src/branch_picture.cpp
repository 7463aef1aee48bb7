// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/branch_picture.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/overlay.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::evaluation {
namespace {

constexpr double kMargin = 0.07;  // Of the larger extent, around a tree.
constexpr double kLabelPlaces[] = {0.5, 0.35, 0.65, 0.2, 0.8, 0.95};

std::optional<double> meanRadius(const VesselTree& tree, const std::vector<int>& points) {
  double length_m = 0, sum = 0;
  for (std::size_t k = 1; k < points.size(); ++k) {
    const auto &a = tree.radii()[points[k - 1]], &b = tree.radii()[points[k]];
    if (!a || !b) continue;
    const double edge_m = (tree.points().col(points[k]) - tree.points().col(points[k - 1])).norm();
    length_m += edge_m;
    sum += edge_m * 0.5 * (*a + *b);
  }
  return length_m > 0 ? std::optional(sum / length_m) : std::nullopt;
}

// Of each branch another colour than its parent's and siblings', as far as there are enough; used evenly.
std::vector<int> branchColors(const TreeTopology& map) {
  std::vector<int> colors(static_cast<std::size_t>(map.branchCount()), -1), used(kPlotColors, 0);
  const auto paint = [&](int branch, const std::set<int>& taken) {
    int best = -1;
    for (int c = 0; c < kPlotColors; ++c) {
      if (taken.count(c) == 0 && (best < 0 || used[c] < used[best])) best = c;
    }
    if (best < 0) best = branch % kPlotColors;
    colors[branch] = best;
    ++used[best];
    return best;
  };
  std::vector<int> open;
  for (int branch = 0; branch < map.branchCount(); ++branch) {
    if (map.parent(branch)) continue;
    paint(branch, {});
    open.push_back(branch);
  }
  while (!open.empty()) {
    const int branch = open.back();
    open.pop_back();
    std::set<int> taken{colors[branch]};
    for (const int child : map.children(branch)) {
      taken.insert(paint(child, taken));
      open.push_back(child);
    }
  }
  return colors;
}

// The largest of 1, 2 and 5 times a power of ten below a value.
double roundLength(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  return (value >= 5 * decade ? 5 : value >= 2 * decade ? 2 : 1) * decade;
}

// To the right and up in a view [mm].
Eigen::Vector2d seen(const Eigen::Matrix3d& R_camera_model, const Eigen::Vector3d& p_model) {
  const Eigen::Vector3d p = 1e3 * (R_camera_model * p_model);
  return {p.x(), -p.y()};
}

// The longest branch of each name bears it.
std::vector<std::string> labelWords(const std::vector<NumberedBranch>& branches) {
  std::vector<std::string> words;
  for (const NumberedBranch& branch : branches) {
    words.push_back(std::to_string(branch.number));
    const bool longest = std::none_of(branches.begin(), branches.end(), [&](const NumberedBranch& other) {
      return other.name == branch.name &&
             (other.length_m > branch.length_m || (other.length_m == branch.length_m && other.number < branch.number));
    });
    // Its last word, by which curveOfName finds it too.
    if (!branch.name.empty() && longest) words.back() += " " + branch.name.substr(branch.name.find_last_of(' ') + 1);
  }
  return words;
}

PlotSides sidesOf(const Eigen::Matrix3d& R_camera_lps) {
  const Eigen::Vector3d right = R_camera_lps.row(0), down = R_camera_lps.row(1);
  return {patientLetters(-right), patientLetters(right), patientLetters(-down), patientLetters(down)};
}

// Sets what a plot shows to a square about its middle, with a bar of a round length in the lower left corner.
void frame(Plot& plot, double side_mm) {
  const auto widened = [side_mm](const std::pair<double, double>& range) {
    const double middle = 0.5 * (range.first + range.second);
    return std::pair(middle - 0.5 * side_mm, middle + 0.5 * side_mm);
  };
  plot.x.range = widened(*plot.x.range);
  plot.y.range = widened(*plot.y.range);
  const double length_mm = roundLength(0.2 * side_mm);
  const Eigen::Vector2d from =
      Eigen::Vector2d(plot.x.range->first, plot.y.range->first) + Eigen::Vector2d::Constant(0.03 * side_mm);
  plot.series.push_back({"", {from.x(), from.x() + length_mm}, {from.y(), from.y()}, kInkColor});
  plot.series.back().marked = false;
  plot.texts.push_back({from.x(), from.y(), formatted("%g mm", length_mm), kInkColor, {0, -6}});
}

}  // namespace

std::vector<NumberedBranch> numberedBranches(const VesselTree& tree, const std::vector<std::string>& names) {
  const TreeTopology map(tree);
  std::vector<NumberedBranch> branches;
  for (int number = 0; number < map.branchCount(); ++number) {
    branches.push_back({number, names.empty() ? "" : names.at(number), map.parent(number), map.length_m(number),
                        meanRadius(tree, map.points(number))});
  }
  return branches;
}

BranchPicture branchPicture(const VesselTree& tree, const std::vector<NumberedBranch>& branches,
                            const Eigen::Matrix3d& R_lps_model, const std::string& note) {
  const TreeTopology map(tree);
  const std::vector<int> colors = branchColors(map);
  const std::vector<std::string> words = labelWords(branches);
  // Short branches have the least room for their numbers.
  std::vector<std::size_t> order(branches.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return branches[a].length_m < branches[b].length_m; });

  BranchPicture picture;
  picture.side_px = std::clamp(static_cast<int>(90 * std::sqrt(static_cast<double>(branches.size()))), 720, 2400);
  const std::pair<const char*, ViewAngles> views[] = {{"antero-posterior (0, 0)", {0, 0}},
                                                      {"lateral (LAO 90)", {degToRad(90), 0}}};
  double extent_mm = 0;
  for (const auto& [title, angles] : views) {
    const Eigen::Matrix3d R_camera_lps = viewRotation(angles), R_camera_model = R_camera_lps * R_lps_model;
    Plot plot{title, {picture.views.empty() ? note : ""}, {}};
    plot.bare = plot.equal_scale = true;
    plot.sides = sidesOf(R_camera_lps);
    Eigen::AlignedBox2d box;
    for (int branch = 0; branch < map.branchCount(); ++branch) {
      PlotSeries line;
      line.color = colors[branch];
      line.marked = false;
      for (const int i : map.points(branch)) {
        const Eigen::Vector2d p = seen(R_camera_model, tree.points().col(i));
        line.x.push_back(p.x());
        line.y.push_back(p.y());
        box.extend(p);
      }
      plot.series.push_back(std::move(line));
    }
    for (const std::size_t k : order) {
      const NumberedBranch& branch = branches[k];
      PlotLabel label{{}, words[k], colors[k]};
      for (const double share : kLabelPlaces) {
        const Eigen::Vector2d p = seen(R_camera_model, map.point({branch.number, share * branch.length_m}));
        label.places.emplace_back(p.x(), p.y());
      }
      plot.labels.push_back(std::move(label));
    }
    PlotSeries roots{"", {}, {}, kWarningColor, PlotSeries::Kind::kDots};
    std::set<int> named;  // Several branches may begin at one root.
    for (const NumberedBranch& branch : branches) {
      if (branch.parent || !named.insert(map.points(branch.number).front()).second) continue;
      const Eigen::Vector2d p = seen(R_camera_model, map.point({branch.number, 0}));
      roots.x.push_back(p.x());
      roots.y.push_back(p.y());
      plot.labels.push_back({{{p.x(), p.y()}}, "root", kWarningColor});
    }
    plot.series.push_back(std::move(roots));
    plot.x.range = {box.min().x(), box.max().x()};
    plot.y.range = {box.min().y(), box.max().y()};
    extent_mm = std::max(extent_mm, box.sizes().maxCoeff());
    picture.views.push_back(std::move(plot));
  }
  for (Plot& view : picture.views) frame(view, std::max(1.0, (1 + 2 * kMargin) * extent_mm));
  return picture;
}

void writeBranchPicture(const std::string& path, const BranchPicture& picture) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  if (extension == ".svg") {
    writeWholeFile(path, svgPlotFile(picture.views, picture.side_px, picture.side_px));
    return;
  }
  if (std::set<std::string>{".png", ".tif", ".tiff", ".jpg", ".jpeg"}.count(extension) == 0) {
    throw InputError(path, "extension", extension, "must be .svg, .png, .tif, .tiff, .jpg or .jpeg");
  }
  std::vector<cv::Mat> views;
  for (const Plot& view : picture.views) views.push_back(drawPlots({view}, picture.side_px, picture.side_px));
  writeImage(path, sideBySide(views));
}

}  // namespace angio::evaluation
