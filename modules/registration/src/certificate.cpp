// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/certificate.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "certificate_box.hpp"
#include "explained_raster.hpp"
#include "pose_bounds.hpp"

namespace angio::registration {
namespace {

// A cell whose poses differ by less than this in the image is not divided any more.
constexpr double kMinRayCell_px = 0.2;
constexpr int kMaxDoubts = 1000;  // So many such cells, and it is over.
// Steps from the depth-mirrored pose to the best one near it.
constexpr double kMirrorTurn_rad = 0.05, kMirrorDepth_m = 0.01, kMirrorRay = 2e-3;
constexpr double kProgressEvery_s = 0.1;
constexpr int kMostCost = 3;  // Of a place that should be seen and is not explained.

// A part of the box that is still open: rotations, depths, and cells of rays on a grid.
struct Node {
  PoseCell cell;
  double half_ray = 0;
  std::vector<std::pair<std::int32_t, std::int32_t>> rays;  // Cells of the grid of that width.
  double volume = 1;                                        // Share of the box's rotations and depths.
};

// The open nodes by their bound, and what has become of the others.
class Search {
 public:
  Search(const VesselTree& tree, const XrayView& view, const Pose& center, const Pose& found,
         const CertificateSettings& settings)
      : settings_(settings),
        samples_(tree),
        raster_(view.centerline, view.camera),
        box_(tree, samples_, center, found, settings),
        view_(view),
        to_model_(-tree.centroid()) {}

  PoseCertificate run(const CertificateProgress& progress) {
    PoseCertificate result;
    {
      const auto pointsOfFound = [this](int unexplained) {
        const PoseBounds bounds(samples_, raster_, view_, box_.center().linear(), unexplained);
        return std::max(0, bounds.points(box_.found()));
      };
      const int explained = pointsOfFound(0);
      result.unexplained_cost = kMostCost;
      while (result.unexplained_cost > 1 && 2 * pointsOfFound(result.unexplained_cost) < explained)
        --result.unexplained_cost;
      unexplained_cost_ = result.unexplained_cost;
      found_ = pointsOfFound(unexplained_cost_);
      max_points_ = PoseBounds::maxPoints();
    }
    result.score = static_cast<double>(found_) / max_points_;
    result.bound = found_ > 0 ? static_cast<double>(max_points_) / found_ : HUGE_VAL;
    enough_ = static_cast<int>(std::ceil(settings_.alternative_share * found_ - 1e-9));
    if (found_ == 0 || !(box_.found().translation().z() > 0)) {
      result.reason = "the image explains nothing of the tree under the found pose";
      return result;
    }
    openRoot();
    Worker worker(*this);
    // Looked at first: it is what most often looks the same.
    PoseCell around;
    around.half.setConstant(kMirrorTurn_rad);
    around.half_depth = kMirrorDepth_m;
    stop_ = tryPose(box_.coordinates(box_.mirrored()), around, kMirrorRay, worker);
    const int threads =
        settings_.threads > 0 ? settings_.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    std::vector<std::thread> others;
    for (int k = 1; k < threads; ++k) {
      others.emplace_back([this] {
        Worker helper(*this);
        work(helper, {});
      });
    }
    work(worker, progress);
    for (auto& other : others) other.join();

    while (highest_ >= 0 && open_[highest_].empty()) --highest_;
    const int open = std::max({highest_, left_open_, doubtful_});
    result.seconds = began_.seconds();
    result.cells = cells_;
    result.proven = open < 0;
    // What was closed has less than enough.
    result.bound = static_cast<double>(std::max(open, enough_ - 1)) / found_;
    if (alternative_) {
      result.alternative = PoseCertificate::Alternative{
          *alternative_ * to_model_, static_cast<double>(alternative_points_) / found_, box_.distance_m(*alternative_)};
      result.reason = formatted("another pose, %.1f mm away, ", 1e3 * result.alternative->distance_m) +
                      formatted("has %.2f of the score", result.alternative->share);
    } else if (doubtful_ >= 0 && !outOfTime()) {
      result.reason = formatted("not proven: poses finer than the raster may have up to %.2f of the score",
                                static_cast<double>(doubtful_) / found_);
    } else if (open >= 0) {
      result.reason =
          formatted("not proven: bound %.2f of the score ", result.bound) + formatted("after %.0f s", result.seconds);
    }
    return result;
  }

 private:
  struct Worker {
    explicit Worker(const Search& s)
        : bounds(s.samples_, s.raster_, s.view_, s.box_.center().linear(), s.unexplained_cost_) {}
    PoseBounds bounds;
    std::vector<Node> children;
    int children_bound = 0;
    std::vector<std::pair<std::int32_t, std::int32_t>> kept;
    long cells = 0;
    double closed = 0;
  };
  enum class Ended { kDone, kOutOfTime, kAlternative, kTooSmall };

  void openRoot() {
    const Eigen::Vector3d t = box_.center().translation(), extent = box_.halfExtent();
    const double nearest = std::max(kNearest_m, t.z() - extent.z()), farthest = t.z() + extent.z();
    if (!(farthest > nearest)) throw InputError("", "box", "", "must be in front of the X-ray source");
    Node root;
    root.cell.half = box_.halfTurns();
    root.cell.depth = 0.5 * (nearest + farthest);
    root.cell.half_depth = 0.5 * (farthest - nearest);
    const auto range = [&](double low, double high, double& middle, double& half) {
      const double least = std::min(low / nearest, low / farthest), most = std::max(high / nearest, high / farthest);
      middle = 0.5 * (least + most);
      half = 0.5 * (most - least) + 1e-9;
    };
    double half_x = 0, half_y = 0;
    range(t.x() - extent.x(), t.x() + extent.x(), ray_x_, half_x);
    range(t.y() - extent.y(), t.y() + extent.y(), ray_y_, half_y);
    root_half_ray_ = root.half_ray = std::max(half_x, half_y);
    root.rays = {{0, 0}};
    open_.resize(static_cast<std::size_t>(max_points_) + 1);
    open_.back().push_back(std::move(root));
    highest_ = max_points_;
  }

  void work(Worker& w, const CertificateProgress& progress) {
    double shown_s = 0;
    std::unique_lock lock(mutex_);
    for (;;) {
      while (highest_ >= 0 && open_[highest_].empty()) --highest_;
      if (stop_ || (highest_ < 0 && in_work_.empty())) break;
      if (highest_ < 0) {
        changed_.wait(lock);
        continue;
      }
      const int bound = highest_;
      Node node = std::move(open_[bound].back());
      open_[bound].pop_back();
      const auto mine = in_work_.insert(bound);
      if (progress && began_.seconds() - shown_s > kProgressEvery_s) {
        shown_s = began_.seconds();
        progress(closed_, std::min(1.0, static_cast<double>(*in_work_.rbegin()) / std::max(1, found_)));
      }
      lock.unlock();
      const Ended ended = outOfTime() ? Ended::kOutOfTime : divide(node, w);
      lock.lock();
      in_work_.erase(mine);
      closed_ += w.closed;
      cells_ += w.cells;
      w.closed = 0;
      w.cells = 0;
      if (ended == Ended::kTooSmall) {
        // Not closed, and not divided: there is no proof any more, but there may be an alternative elsewhere.
        doubtful_ = std::max(doubtful_, bound);
        stop_ = stop_ || ++doubts_ >= kMaxDoubts;
      } else if (ended == Ended::kDone) {
        // A part has no more than the whole.
        const int its = std::min(w.children_bound, bound);
        for (Node& child : w.children) open_[its].push_back(std::move(child));
        if (!w.children.empty()) highest_ = std::max(highest_, its);
      } else {
        stop_ = true;
        left_open_ = std::max(left_open_, bound);
      }
      changed_.notify_all();
    }
    changed_.notify_all();
  }

  // Bounds a node's cells and divides what is left, in what moves the model most, until that is no ray.
  Ended divide(Node& node, Worker& w) {
    w.children.clear();
    w.children_bound = 0;
    const double max_turn_m = box_.maxTurn_m(node.cell);
    for (;;) {
      Eigen::AlignedBox2d rays;
      for (const auto& [i, j] : node.rays) {
        rays.extend(Eigen::Vector2d(rayOf(i, ray_x_, node.half_ray), rayOf(j, ray_y_, node.half_ray)));
      }
      const Eigen::Vector2d middle = 0.5 * (rays.min() + rays.max());
      w.bounds.prepare(node.cell, {middle.x(), middle.y(), 0.5 * rays.sizes().maxCoeff()}, node.half_ray);
      w.kept.clear();
      int bound = 0;
      std::pair<double, double> best{0, 0};
      long looked = 0;
      for (const auto& [i, j] : node.rays) {
        if ((++looked & 1023) == 0 && outOfTime()) return Ended::kOutOfTime;
        const double x = rayOf(i, ray_x_, node.half_ray), y = rayOf(j, ray_y_, node.half_ray);
        if (box_.outside(node.cell, x, y, node.half_ray) || box_.isFound(max_turn_m, x, y, node.half_ray)) continue;
        ++w.cells;
        const int most = w.bounds.pointsBound(x, y, enough_);
        if (most < 0) continue;
        w.kept.emplace_back(i, j);
        if (most > bound) {
          bound = most;
          best = {x, y};
        }
      }
      if (w.kept.empty()) {
        w.closed += node.volume;
        return Ended::kDone;
      }
      if (tryPose({node.cell.rotation, best.first, best.second, node.cell.depth}, node.cell, node.half_ray, w))
        return Ended::kAlternative;
      if (outOfTime()) return Ended::kOutOfTime;

      const auto& effects = w.bounds.effects_px();
      const auto widest = std::max_element(effects.begin(), effects.end()) - effects.begin();
      if (effects[widest] < kMinRayCell_px) return tryCorners(node, w) ? Ended::kAlternative : Ended::kTooSmall;
      if (widest == 4) {
        node.half_ray *= 0.5;
        node.rays.clear();
        for (const auto& [i, j] : w.kept) {
          for (int k = 0; k < 4; ++k) node.rays.emplace_back(2 * i + k % 2, 2 * j + k / 2);
        }
        continue;
      }
      node.rays = w.kept;
      node.volume *= 0.5;
      w.children_bound = bound;
      for (const double side : {-0.5, 0.5}) {
        Node child = node;
        if (widest == 3) {
          child.cell.depth += side * node.cell.half_depth;
          child.cell.half_depth *= 0.5;
        } else {
          child.cell.rotation[widest] += side * node.cell.half[widest];
          child.cell.half[widest] *= 0.5;
        }
        if (box_.outside(child.cell)) {
          w.closed += child.volume;
          continue;
        }
        w.children.push_back(std::move(child));
      }
      return Ended::kDone;
    }
  }

  // Whether a different pose of the box in a small cell is an alternative; its middle may be the found one.
  bool tryCorners(const Node& node, Worker& w) {
    for (const auto& [i, j] : w.kept) {
      for (int corner = 0; corner < 64; ++corner) {
        const auto side = [&](int k) { return (corner >> k) % 2 == 0 ? -1 : 1; };
        PoseCoordinates at{node.cell.rotation, rayOf(i, ray_x_, node.half_ray) + side(3) * node.half_ray,
                           rayOf(j, ray_y_, node.half_ray) + side(4) * node.half_ray,
                           node.cell.depth + side(5) * node.cell.half_depth};
        for (int k = 0; k < 3; ++k) at.rotation[k] += side(k) * node.cell.half[k];
        if (!box_.contains(at)) continue;
        const Pose T = box_.pose(at);
        if (!box_.isFound(T) && isAlternative(at, w.bounds.points(T, enough_))) return true;
      }
    }
    return false;
  }

  bool isAlternative(const PoseCoordinates& at, int points) {
    if (points < enough_) return false;
    const std::lock_guard lock(mutex_);
    if (points > alternative_points_) {
      alternative_ = box_.pose(at);
      alternative_points_ = points;
    }
    return true;
  }

  // Whether a pose, or one near to it, is an alternative.
  bool tryPose(const PoseCoordinates& at, const PoseCell& cell, double half_ray, Worker& w) {
    if (!box_.contains(at)) return false;
    const Pose T = box_.pose(at);
    if (box_.isFound(T)) return false;
    int points = w.bounds.points(T, best_points_ + 1);
    if (points < 0) return false;
    best_points_ = points;
    const PoseCoordinates top = climbed(at, points, cell, half_ray, w);
    best_points_ = std::max<int>(best_points_, points);
    return isAlternative(top, points);
  }

  // Up the score from a pose, in steps of its cell's size and smaller, among the different poses of the box.
  PoseCoordinates climbed(PoseCoordinates at, int& points, const PoseCell& cell, double half_ray, Worker& w) const {
    std::array<double, 6> step{cell.half.x(), cell.half.y(), cell.half.z(), half_ray, half_ray, cell.half_depth};
    const double pixel = 1 / view_.camera.parameters().fx_px;
    for (int k = 0; k < 3; ++k) step[k] = std::min(step[k], 0.1);
    for (int round = 0; round < 6; ++round) {
      for (bool better = true; better;) {
        better = false;
        for (int k = 0; k < 12; ++k) {
          PoseCoordinates to = at;
          const double by = (k % 2 == 0 ? 1 : -1) * std::max(step[k / 2], k / 2 < 5 ? pixel : 1e-3);
          if (k < 6) {
            to.rotation[k / 2] += by;
          } else {
            (k < 8 ? to.ray_x : k < 10 ? to.ray_y : to.depth) += by;
          }
          if (!box_.contains(to)) continue;
          const Pose T = box_.pose(to);
          if (box_.isFound(T)) continue;
          const int there = w.bounds.points(T, points + 1);
          if (there < 0) continue;
          points = there;
          at = to;
          better = true;
        }
      }
      for (double& s : step) s *= 0.5;
    }
    return at;
  }

  double rayOf(std::int32_t place, double middle, double half_ray) const {
    return middle - root_half_ray_ + (2 * place + 1) * half_ray;
  }
  bool outOfTime() const { return began_.seconds() >= settings_.seconds; }

  CertificateSettings settings_;
  TreeSamples samples_;
  ExplainedRaster raster_;
  CertificateBox box_;
  const XrayView& view_;
  Eigen::Translation3d to_model_;
  Stopwatch began_;
  int max_points_ = 0, found_ = 0,
      enough_ = 0;  // Points: the most, of the found pose, and those that make an alternative.
  int unexplained_cost_ = 1;
  double ray_x_ = 0, ray_y_ = 0, root_half_ray_ = 0;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::vector<Node>> open_;  // By bound.
  int highest_ = -1;                     // No node has a higher bound.
  std::multiset<int> in_work_;           // Bounds of nodes that are being divided.
  int left_open_ = -1;                   // Highest bound of nodes that were given up.
  bool stop_ = false;
  std::atomic<int> best_points_{0};
  std::optional<Pose> alternative_;  // Of the centred model.
  int alternative_points_ = 0;
  double closed_ = 0;
  long cells_ = 0;
  int doubts_ = 0, doubtful_ = -1;  // Cells that were too small to be divided, and their highest bound.
};

}  // namespace

double poseDistance_m(const VesselTree& tree, const Pose& a, const Pose& b) {
  const TreeSamples samples(tree);
  return CertificateBox(tree, samples, a, a, {}).distance_m(b * Eigen::Translation3d(tree.centroid()));
}

double certifiedScore(const VesselTree& tree, const XrayView& view, const Pose& T_camera_model, int unexplained_cost) {
  const TreeSamples samples(tree);
  const ExplainedRaster raster(view.centerline, view.camera);
  const PoseBounds bounds(samples, raster, view, Eigen::Matrix3d::Identity(), unexplained_cost);
  const int points = std::max(0, bounds.points(T_camera_model * Eigen::Translation3d(tree.centroid())));
  return static_cast<double>(points) / bounds.maxPoints();
}

PoseCertificate certify(const VesselTree& tree, const XrayView& view, const Pose& box_center, const Pose& found,
                        const CertificateSettings& settings, const CertificateProgress& progress) {
  requireBetween("certificate", "box_rotation_deg", settings.box_rotation_deg, 0, 180);
  requireBetween("certificate", "box_translation_mm", settings.box_translation_mm, 0, 1000);
  requireBetween("certificate", "rival_share", settings.alternative_share, 0.01, 1);
  requireBetween("certificate", "distance_mm", settings.distance_mm, 0, 1000);
  requireBetween("certificate", "seconds", settings.seconds, 0, 1e6);
  requireBetween("certificate", "threads", settings.threads, 0, 256);
  return Search(tree, view, box_center, found, settings).run(progress);
}

}  // namespace angio::registration
