// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_tracer.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "angio/base/checked.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/imaging/device_contrast.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "tree_viterbi.hpp"

namespace angio::navigation {
namespace {

constexpr double kMarkerWeight = 2;  // Nats for each time that a band is as dark as the catheter, beyond its ratio ...
constexpr double kMaxMarker = 12;    // ... up to this: what is darker still is no better.
constexpr double kExpectedStd_m = 8e-3;  // How far from the believed tip a tip is no surprise.
constexpr double kMaxSurprise = 6;       // Nats: the image is believed before the belief.
constexpr double kFirstLevel = 6;        // Times the noise: a catheter before one has been traced.
constexpr double kMinLevel = 3;
constexpr double kMaxUnseen = 0.5;
constexpr double kTipStd_m = 0.3e-3;  // Of a tip across a vessel that has no width.
constexpr double kSeen_px = 1;
constexpr double kLackWeight = 0.5;   // Errors of a line are alike from frame to frame.
constexpr double kFrameWorth = 0.3;   // Of a frame whose errors were its own: a bend or a deflection stays for many.
constexpr double kFloor = -12;        // Nats: no frame is surer than that.
constexpr double kLevelShare = 0.35;  // Of a trace, that is less dark than its catheter is taken to be.
constexpr int kLongLost = 5;          // Frames.
constexpr double kKeep = 0.8;         // Of the catheter's contrast from frame to frame.

}  // namespace

class CatheterTracer::Impl {
 public:
  Impl(const VesselTree& tree, const CatheterTracerSettings& settings)
      : settings_(checked("catheter tracer", settings)), places_(tree), walk_(places_, 1e-3 * settings.slack_mm) {}

  std::optional<CatheterTrace> trace(const cv::Mat& image, const SeenPose& pose, const TipBelief& expected,
                                     const TipOffset& offset) {
    const Eigen::Vector3d tip_camera = pose.T_camera_model * expected.tip.tip_model;
    if (!(tip_camera.z() > 0)) return std::nullopt;
    px_per_m_ = pose.camera.parameters().fx_px / tip_camera.z();
    const WalkArea area = areaAround(places_, expected, 1e-3 * settings_.behind_mm, 1e-3 * settings_.ahead_mm);
    const auto projection = projected(area, pose);
    if (!projection) return std::nullopt;
    const DeviceContrast seen = deviceContrast(image, projection->window, 1e-3 * settings_.diameter_mm * px_per_m_);
    const bool first = !level_;
    auto found = best(area, *projection, seen, first ? kFirstLevel * seen.noise : *level_);
    if (found && first) found = best(area, *projection, seen, *level_);
    // One that is lost for long may be so because its contrast was taken for another's.
    lost_ = found ? 0 : lost_ + 1;
    if (lost_ >= kLongLost) level_.reset();
    if (found) weigh(area, *projection, pose, offset, *found);
    return found;
  }

 private:
  struct ProjectedArea {
    Eigen::Matrix2Xf px;  // Of the area's places.
    cv::Rect window;
  };

  std::optional<ProjectedArea> projected(const WalkArea& area, const SeenPose& pose) const {
    ProjectedArea projection;
    projection.px.resize(2, static_cast<Eigen::Index>(area.places.size()));
    Eigen::AlignedBox2f box;
    for (std::size_t k = 0; k < area.places.size(); ++k) {
      const auto u = pose.camera.project(pose.T_camera_model * places_.points_m[area.places[k]]);
      if (!u || !u->allFinite()) return std::nullopt;
      projection.px.col(static_cast<Eigen::Index>(k)) = u->cast<float>();
      box.extend(u->cast<float>());
    }
    const double margin = walk_.reach(area) * TreeViterbi::kStep_m * px_per_m_ + 20;
    projection.window =
        cv::Rect(cv::Point(static_cast<int>(box.min().x() - margin), static_cast<int>(box.min().y() - margin)),
                 cv::Point(static_cast<int>(box.max().x() + margin), static_cast<int>(box.max().y() + margin)));
    projection.window &= cv::Rect(0, 0, pose.camera.width_px(), pose.camera.height_px());
    if (projection.window.width < 20 || projection.window.height < 20) return std::nullopt;
    return projection;
  }

  std::optional<CatheterTrace> best(const WalkArea& area, const ProjectedArea& projection, const DeviceContrast& seen,
                                    double level) {
    level = std::max(level, kMinLevel * seen.noise);
    walk_.run(area, projection.px, px_per_m_, seen, level);
    const TreeViterbi& walk = walk_;
    double most = -1e300;
    int end = -1, end_u = 0;
    for (std::size_t k = 0; k < area.places.size(); ++k) {
      if (area.from_tip_m[k] > 1e-3 * settings_.ahead_mm) continue;
      const double off = area.from_tip_m[k] / kExpectedStd_m, surprise = std::min(0.5 * off * off, kMaxSurprise);
      const TreeViterbi::Scores& score = walk.score(static_cast<int>(k));
      const TreeViterbi::Scores& dark = walk.dark(static_cast<int>(k));
      for (int u = 0; u < score.size(); ++u) {
        const double ratio = dark.data()[u] / level;
        if (ratio < settings_.marker_ratio) continue;
        const double value =
            score.data()[u] - surprise + std::min(kMarkerWeight * (ratio - settings_.marker_ratio), kMaxMarker);
        if (value > most) most = value, end = static_cast<int>(k), end_u = u;
      }
    }
    if (end < 0) return std::nullopt;
    return described(walk.backFrom(end, end_u), seen, level);
  }

  // The band's middle: where its darkness is, to a part of a pixel.
  Eigen::Vector2d bandAt(const DeviceContrast& seen, const Eigen::Vector2d& about) const {
    Eigen::Vector2d middle = about;
    const double reach = std::max(2.0, 0.75e-3 * settings_.marker_length_mm * px_per_m_);
    const int n = static_cast<int>(std::ceil(reach));
    for (int round = 0; round < 3; ++round) {
      const double half = 0.5 * seen.at(middle.x(), middle.y());
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      double weight = 0;
      for (int y = -n; y <= n; ++y) {
        for (int x = -n; x <= n; ++x) {
          const double w = std::max(seen.at(middle.x() + x, middle.y() + y) - half, 0.0);
          sum += w * Eigen::Vector2d(x, y);
          weight += w;
        }
      }
      if (!(weight > 0)) break;
      middle += sum / weight;
    }
    return middle;
  }

  std::optional<CatheterTrace> described(const std::vector<Eigen::Vector2d>& line, const DeviceContrast& seen,
                                         double level) {
    if (line.size() < 6) return std::nullopt;
    CatheterTrace result;
    std::vector<float> dark;
    for (std::size_t i = 0; i + 3 < line.size(); ++i) {
      dark.push_back(seen.at(line[i].x(), line[i].y()));
      result.unseen_share += dark.back() < 0.5 * level;
    }
    result.unseen_share /= static_cast<double>(dark.size());
    if (result.unseen_share > kMaxUnseen) return std::nullopt;
    // Where it runs along the beam it is darker than it is.
    const auto low = dark.begin() + static_cast<std::ptrdiff_t>(kLevelShare * static_cast<double>(dark.size()));
    std::nth_element(dark.begin(), low, dark.end());
    level_ = level_ ? kKeep * *level_ + (1 - kKeep) * *low : *low;

    const Eigen::Vector2d band = bandAt(seen, line.back());
    result.marker = seen.at(band.x(), band.y()) / level;
    // From the band's middle half its length on, as foreshortened as the catheter before it.
    const Eigen::Vector2d before = line[line.size() - 4];
    const Eigen::Vector2d along = (band - before) / 3e-3 * 0.5e-3 * settings_.marker_length_mm;
    std::vector<Eigen::Vector2d> points(line.begin(), line.end() - 1);
    while (!points.empty() && (points.back() - band).norm() < 0.5e-3 * px_per_m_) points.pop_back();
    points.push_back(band);
    if (along.norm() > 0.1) points.push_back(band + along);
    result.seen.points_px.resize(2, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) {
      result.seen.points_px.col(static_cast<Eigen::Index>(i)) = points[i];
    }
    result.seen.std_px = std::max(0.5, 0.5 * TreeViterbi::kStep_m * px_per_m_);
    return result;
  }

  // What each place is worth as the tip's: by the seen tip's distance from it, loose across the vessel and tight along
  // it, and by what the line to it lacks of a catheter's.
  void weigh(const WalkArea& area, const ProjectedArea& projection, const SeenPose& pose, const TipOffset& offset,
             CatheterTrace& trace) const {
    const Eigen::Vector2d tip = trace.seen.points_px.rightCols<1>();
    double best = -1e300;
    for (std::size_t k = 0; k < area.places.size(); ++k) {
      if (area.from_tip_m[k] > 1e-3 * settings_.ahead_mm) continue;
      const int place = area.places[k];
      const Eigen::Vector2d off = tip - projection.px.col(static_cast<Eigen::Index>(k)).cast<double>();
      const auto lacks = walk_.lack(static_cast<int>(k), off.cast<float>());
      if (!lacks) continue;
      const Eigen::Vector3d p = pose.T_camera_model * places_.points_m[place];
      Eigen::Matrix<double, 2, 3> J;
      pose.camera.project(p, &J);
      const Beside beside = besideAxis(place, pose, offset);
      Eigen::Matrix<double, 3, 6> moved;
      moved << Eigen::Matrix3d::Identity(), -skew(p - pose.T_camera_model.translation());
      const Eigen::Matrix2d S = J * (beside.covariance + moved * pose.covariance * moved.transpose()) * J.transpose() +
                                kSeen_px * kSeen_px * Eigen::Matrix2d::Identity();
      const Eigen::Vector2d left = off - J * beside.mean_m, weighed = S.inverse() * left;
      const double value = -0.5 * left.dot(weighed) - 0.5 * std::log(S.determinant()) - kLackWeight * *lacks;
      const Eigen::Vector3d end = p + beside.mean_m + beside.covariance * J.transpose() * weighed;
      // What the image leaves open of it: above all how far it is deflected along the beam.
      const Eigen::Matrix3d unseen =
          beside.covariance - beside.covariance * J.transpose() * S.inverse() * J * beside.covariance;
      const double end_std_m = std::sqrt(std::max(
          Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(unseen, Eigen::EigenvaluesOnly).eigenvalues()[2], 0.0));
      trace.evidence.places.push_back(
          {places_.branch[place], places_.arc_m[place], value, pose.T_camera_model.inverse() * end, end_std_m});
      if (value > best) best = value, trace.evidence.residual_px = off.norm();
    }
    for (PlaceEvidence& one : trace.evidence.places)
      one.log_evidence = std::max(kFrameWorth * (one.log_evidence - best), kFloor);
    trace.evidence.elsewhere = kFloor;
  }

  // Where a tip's end is against the axis, camera frame.
  struct Beside {
    Eigen::Vector3d mean_m;
    Eigen::Matrix3d covariance;
  };
  Beside besideAxis(int place, const SeenPose& pose, const TipOffset& offset) const {
    const TreeFrame& frame = places_.frames[place];
    const double room_m = std::max(places_.radius_m[place] - 0.5e-3 * settings_.diameter_mm, 0.0);
    Eigen::Matrix<double, 3, 2> sideways;
    sideways << frame.normal, frame.binormal;
    sideways = (pose.T_camera_model.linear() * sideways).eval();
    const Eigen::Vector3d along = pose.T_camera_model.linear() * frame.along;
    // The wall holds what would deflection further.
    const double held = std::min(1.0, room_m / std::max(offset.mean_m.norm(), 1e-9));
    const double spread = std::min(1.0, 0.5 * room_m * room_m / std::max(0.5 * offset.covariance.trace(), 1e-12));
    const double along_m = 1e-3 * settings_.along_std_mm;
    Beside result{held * sideways * offset.mean_m, along_m * along_m * along * along.transpose()};
    result.covariance += sideways * (spread * offset.covariance + kTipStd_m * kTipStd_m * Eigen::Matrix2d::Identity()) *
                         sideways.transpose();
    return result;
  }

  CatheterTracerSettings settings_;
  WalkPlaces places_;
  TreeViterbi walk_;
  double px_per_m_ = 0;
  int lost_ = 0;                 // Frames.
  std::optional<double> level_;  // The catheter's contrast.
};

CatheterTracer::CatheterTracer(const VesselTree& tree, const CatheterTracerSettings& settings)
    : impl_(std::make_unique<Impl>(tree, settings)) {}
CatheterTracer::~CatheterTracer() = default;

std::optional<CatheterTrace> CatheterTracer::trace(const cv::Mat& image, const SeenPose& pose,
                                                   const TipBelief& expected, const TipOffset& offset) {
  return impl_->trace(image, pose, expected, offset);
}

}  // namespace angio::navigation
