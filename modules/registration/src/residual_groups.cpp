// SPDX-License-Identifier: GPL-2.0-or-later
#include "residual_groups.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "line_step.hpp"
#include "oriented_frame.hpp"
#include "oriented_model.hpp"

namespace angio::registration {
namespace {

// Where vessels cross or run side by side in the image, its points belong now to one and now to the other.
constexpr std::size_t kOpen = 4;

// Sums over the points of a group; its means when it is closed.
class GroupSums {
 public:
  GroupSums(const MatchedView& view, double tolerance_px, const Grouping& grouping)
      : view_(&view), grouping_(&grouping), tolerance_px_(tolerance_px) {}

  std::size_t size() const { return size_; }

  // Another vessel, or a bend: the means would say nothing.
  bool breaksAt(const Eigen::Vector3d& at, const Eigen::Vector2d& normal) const {
    if (size_ == 0) return false;
    const double alike = normal.dot(normal_) / std::max(1e-9, normal.norm() * normal_.norm());
    return (at - sums_.at / sums_.weight).norm() > grouping_->reach_m || std::abs(alike) < grouping_->alike;
  }

  // Returns the point's weight.
  double add(const Eigen::Vector3d& at, const Eigen::Vector3d& displacement, const Eigen::Vector2d& pixel,
             Eigen::Vector2d normal) {
    if (size_ > 0 && normal.dot(normal_) < 0) normal = -normal;
    normal_ += normal;
    const Pose& T = view_->T_view_centered;
    Eigen::Matrix<double, 2, 3> J;
    const Eigen::Vector3d displaced = at + displacement;
    const auto projected = view_->camera.project(T * displaced, &J);
    if (!projected) return 0;
    const double left_px = normal.dot(*projected - pixel);
    const double weight = std::exp(-left_px * left_px / (2 * tolerance_px_ * tolerance_px_));
    const Eigen::Vector3d gradient = T.linear().transpose() * J.transpose() * normal;
    sums_.at += weight * at;
    sums_.gradient += weight * gradient;
    sums_.jacobian.head<3>() += weight * gradient;
    sums_.jacobian.tail<3>() += weight * displaced.cross(gradient);
    sums_.residual_px += weight * (left_px - gradient.dot(displacement));
    displacement_ += weight * displacement;
    sums_.pixel += weight * pixel;
    sums_.normal += weight * normal;
    left_px_ += weight * left_px;
    sums_.scatter_px2 += weight * left_px * left_px;
    sums_.weight += weight;
    ++size_;
    return weight;
  }

  void closeInto(std::vector<ResidualGroup>& groups) {
    if (sums_.weight > 0 && size_ >= grouping_->least) {
      ResidualGroup group = sums_;
      group.at /= sums_.weight;
      group.gradient /= sums_.weight;
      group.jacobian /= sums_.weight;
      group.pixel /= sums_.weight;
      group.normal /= sums_.weight;
      const double mean_px = left_px_ / sums_.weight;
      group.residual_px /= sums_.weight;
      if (grouping_->of_mean_place) {
        group.residual_px = mean_px - group.gradient.dot(displacement_) / sums_.weight;
      }
      group.scatter_px2 = std::max(0.0, sums_.scatter_px2 / sums_.weight - mean_px * mean_px);
      groups.push_back(group);
    }
  }

 private:
  const MatchedView* view_;
  const Grouping* grouping_;
  double tolerance_px_;
  ResidualGroup sums_;
  Eigen::Vector2d normal_ = Eigen::Vector2d::Zero();
  Eigen::Vector3d displacement_ = Eigen::Vector3d::Zero();
  double left_px_ = 0;
  std::size_t size_ = 0;
};

}  // namespace

std::vector<ResidualGroup> residualGroups(const std::vector<MatchedView>& views, const OrientedModel& model,
                                          const Eigen::Matrix3Xd& displaced, double tolerance_px,
                                          const Grouping& grouping) {
  std::vector<ResidualGroup> groups;
  double total = 0, grouped = 0;
  std::size_t points = 0;
  for (const MatchedView& view : views) points += static_cast<std::size_t>(view.image.size());
  const auto wanted = static_cast<std::size_t>(std::max(1, grouping.most));
  const std::size_t full = std::max(grouping.least, points / wanted);
  for (const MatchedView& view : views) {
    std::vector<GroupSums> open;
    const auto closeAll = [&] {
      for (GroupSums& sums : open) sums.closeInto(groups);
      open.clear();
    };
    std::size_t branch = 0;
    for (int j = 0; j < view.image.size(); ++j) {
      if (branch < view.image.begin.size() && j == view.image.begin[branch]) {
        closeAll();
        ++branch;
      }
      const auto& match = view.matches.of_point[j];
      const Eigen::Vector2d normal(match.normal_u, match.normal_v);
      if (match.edge < 0 || !(normal.squaredNorm() > 1e-6)) continue;
      const auto& [parent, child] = model.edges[match.edge];
      const double s = match.along;
      const Eigen::Vector3d at = (1 - s) * model.points.col(parent) + s * model.points.col(child);
      const Eigen::Vector3d moved = (1 - s) * displaced.col(parent) + s * displaced.col(child);
      auto takes = std::find_if(open.begin(), open.end(), [&](const GroupSums& g) { return !g.breaksAt(at, normal); });
      if (takes == open.end()) {
        if (open.size() == kOpen) {
          open.front().closeInto(groups);
          open.erase(open.begin());
        }
        takes = open.emplace(open.end(), view, tolerance_px, grouping);
      }
      total += takes->add(at, moved - at, {view.image.u[j], view.image.v[j]}, normal);
      if (takes->size() >= full) {
        takes->closeInto(groups);
        open.erase(takes);
      }
    }
    closeAll();
  }
  // Short vessels make more groups than there should be: the heaviest say the most.
  if (groups.size() > wanted) {
    std::nth_element(groups.begin(), groups.begin() + static_cast<std::ptrdiff_t>(wanted), groups.end(),
                     [](const ResidualGroup& a, const ResidualGroup& b) { return a.weight > b.weight; });
    groups.resize(wanted);
  }
  for (const ResidualGroup& group : groups) grouped += group.weight;
  for (ResidualGroup& group : groups) group.pull = group.weight * total / grouped;
  return groups;
}

}  // namespace angio::registration
