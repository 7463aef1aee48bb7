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
constexpr double kLackWeight = 0.5;     // Errors of a line are alike from frame to frame.
constexpr double kFrameWorth = 0.3;     // Of a frame whose errors were its own: a bend or a deflection stays for many.
constexpr double kShown_m = 0.6e-3;     // Offsets that a frame leaves less sure than this are alike in many frames.
constexpr double kFloor = -12;          // Nats: no frame is surer than that.
constexpr double kLevelShare = 0.35;    // Of a trace, that is less dark than its catheter is taken to be.
constexpr double kLengthStd = 1.0 / 6;  // Of a deflection's length, in parts of it.
constexpr int kDirections = 36, kLengths = 2;  // That are tried, of the latter to either side.
constexpr double kAtTip_m = 2e-3;
constexpr double kGoesOn = 0.3;  // Nats a millimetre of way ahead: half of what a catheter's line is worth.
constexpr double kFurther = 3;   // Times as far ahead.
constexpr int kLongLost = 5;     // Frames.
constexpr double kKeep = 0.8;    // Of the catheter's contrast from frame to frame.

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
    auto found = within(1e-3 * settings_.ahead_mm, image, pose, expected, offset);
    // Its tip has sprung on by more, and what is as dark as a band in between runs along the beam.
    if (goes_on_) found = within(kFurther * 1e-3 * settings_.ahead_mm, image, pose, expected, offset);
    // One that is lost for long may be so because its contrast was taken for another's.
    lost_ = found ? 0 : lost_ + 1;
    if (lost_ >= kLongLost) level_.reset();
    return found;
  }

 private:
  // A tip no further ahead of the believed one than that.
  std::optional<CatheterTrace> within(double ahead_m, const cv::Mat& image, const SeenPose& pose,
                                      const TipBelief& expected, const TipOffset& offset) {
    ahead_m_ = ahead_m;
    goes_on_ = false;
    const WalkArea area = areaAround(places_, expected, 1e-3 * settings_.behind_mm, ahead_m);
    const auto projection = projected(area, pose);
    if (!projection) return std::nullopt;
    const DeviceContrast seen = deviceContrast(image, projection->window, 1e-3 * settings_.diameter_mm * px_per_m_);
    const bool first = !level_;
    auto found = best(area, *projection, seen, first ? kFirstLevel * seen.noise : *level_);
    if (found && first) found = best(area, *projection, seen, *level_);
    if (found) weigh(area, *projection, pose, offset, *found);
    return found;
  }

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
    goes_on_ = goesOn(area);
    double most = -1e300;
    int end = -1, end_u = 0;
    for (std::size_t k = 0; k < area.places.size(); ++k) {
      if (area.from_tip_m[k] > ahead_m_) continue;
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

  // Whether a dark line leads on to where it is looked for no more.
  bool goesOn(const WalkArea& area) const {
    float at_tip = -1e30f, at_edge = -1e30f;
    for (std::size_t k = 0; k < area.places.size(); ++k) {
      const int place = static_cast<int>(k);
      const bool is_behind = area.parent[k] < 0 || area.from_tip_m[area.parent[k]] > area.from_tip_m[k];
      if (area.from_tip_m[k] < kAtTip_m) at_tip = std::max(at_tip, walk_.score(place).maxCoeff());
      if (!is_behind && area.from_tip_m[k] > ahead_m_ - kAtTip_m)
        at_edge = std::max(at_edge, walk_.score(place).maxCoeff());
    }
    return at_edge - at_tip > kGoesOn * 1e3 * ahead_m_;
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
    TipOffset known;        // At the last place's ...
    double of_length = -1;  // ... length: in a wide vessel it is that of all.
    const Eigen::Vector2d tip = trace.seen.points_px.rightCols<1>();
    double best = -1e300, worth = kFrameWorth;
    std::vector<double> lacking;
    for (std::size_t k = 0; k < area.places.size(); ++k) {
      if (area.from_tip_m[k] > ahead_m_) continue;
      const int place = area.places[k];
      const Eigen::Vector2d off = tip - projection.px.col(static_cast<Eigen::Index>(k)).cast<double>();
      const auto lacks = walk_.lack(static_cast<int>(k), off.cast<float>());
      if (!lacks) continue;
      const Eigen::Vector3d p = pose.T_camera_model * places_.points_m[place];
      Eigen::Matrix<double, 2, 3> J;
      pose.camera.project(p, &J);
      const double length_m = std::min(offset.free_m, room(place));
      if (length_m != of_length) known = ofLength(offset, of_length = length_m);
      const Beside beside = besideAxis(place, pose);
      Eigen::Matrix<double, 3, 6> moved;
      moved << Eigen::Matrix3d::Identity(), -skew(p - pose.T_camera_model.translation());
      // Of the seen tip for a given offset.
      const Eigen::Matrix2d seen = J * (beside.rest + moved * pose.covariance * moved.transpose()) * J.transpose() +
                                   kSeen_px * kSeen_px * Eigen::Matrix2d::Identity();
      const TipOffset expected = withinWall(known, place);
      const Eigen::Matrix2d B = J * beside.sideways, S = seen + B * expected.covariance * B.transpose();
      const Eigen::Vector2d left = off - B * expected.mean_m;
      const double value = -0.5 * left.dot(S.inverse() * left) - 0.5 * std::log(S.determinant());
      const TipEndEstimate end = endOf(withinWall(offset, place), length_m, beside, J, seen, off);
      trace.evidence.places.push_back({places_.branch[place], places_.arc_m[place], value,
                                       pose.T_camera_model.inverse() * (p + end.from_axis_m), end.std_m});
      lacking.push_back(kLackWeight * *lacks);
      if (value - lacking.back() <= best) continue;
      best = value - lacking.back();
      trace.evidence.residual_px = off.norm();
      if (!(offset.free_m > 0)) worth = kFrameWorth * std::min(1.0, std::pow(kShown_m / end.std_m, 2));
    }
    best = -1e300;
    for (std::size_t k = 0; k < lacking.size(); ++k) {
      double& value = trace.evidence.places[k].log_evidence;
      value = worth * value - kFrameWorth * lacking[k];
      best = std::max(best, value);
    }
    for (PlaceEvidence& one : trace.evidence.places) one.log_evidence = std::max(one.log_evidence - best, kFloor);
    trace.evidence.elsewhere = kFloor;
  }

  // How far the wall lets a catheter be beside the axis [m].
  double room(int place) const { return std::max(places_.radius_m[place] - 0.5e-3 * settings_.diameter_mm, 0.0); }

  // The wall holds what would be deflected further.
  TipOffset withinWall(TipOffset offset, int place) const {
    const double room_m = room(place), variance = 0.5 * offset.covariance.trace();
    offset.mean_m *= std::min(1.0, room_m / std::max(offset.mean_m.norm(), 1e-9));
    offset.covariance *= std::min(1.0, 0.5 * room_m * room_m / std::max(variance, 1e-12));
    return offset;
  }

  // What takes an offset to the camera frame, and how far a tip's end is from where that puts it [m^2].
  struct Beside {
    Eigen::Matrix<double, 3, 2> sideways;
    Eigen::Matrix3d rest;
  };
  Beside besideAxis(int place, const SeenPose& pose) const {
    const TreeFrame& frame = places_.frames[place];
    Eigen::Matrix<double, 3, 2> sideways;
    sideways << frame.normal, frame.binormal;
    sideways = (pose.T_camera_model.linear() * sideways).eval();
    const Eigen::Vector3d along = 1e-3 * settings_.along_std_mm * (pose.T_camera_model.linear() * frame.along);
    return {sideways, along * along.transpose() + kTipStd_m * kTipStd_m * sideways * sideways.transpose()};
  }

  // Where a tip's end is against the axis by its seen place `off` beside the axis' image, camera axes.
  struct TipEndEstimate {
    Eigen::Vector3d from_axis_m;
    double std_m;  // In the direction of the largest variance: above all, how far along the beam it is deflected.
  };
  static TipEndEstimate endOf(const TipOffset& offset, double length_m, const Beside& beside,
                              const Eigen::Matrix<double, 2, 3>& J, const Eigen::Matrix2d& seen,
                              const Eigen::Vector2d& off) {
    const Eigen::Matrix2d B = J * beside.sideways;
    const Eigen::Matrix2d gain =
        offset.covariance * B.transpose() * (seen + B * offset.covariance * B.transpose()).inverse();
    // The length is asked last: it says how far along the beam what is seen across it leaves.
    const TipOffset found = ofLength(
        {offset.mean_m + gain * (off - B * offset.mean_m), offset.covariance - gain * B * offset.covariance, 0},
        length_m);
    const Eigen::Matrix<double, 3, 2> rest_gain = beside.rest * J.transpose() * seen.inverse();
    const Eigen::Matrix3d unseen =
        beside.sideways * found.covariance * beside.sideways.transpose() + beside.rest - rest_gain * J * beside.rest;
    const double variance =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(unseen, Eigen::EigenvaluesOnly).eigenvalues()[2];
    return {beside.sideways * found.mean_m + rest_gain * (off - B * found.mean_m), std::sqrt(std::max(variance, 0.0))};
  }

  CatheterTracerSettings settings_;
  WalkPlaces places_;
  TreeViterbi walk_;
  double px_per_m_ = 0;
  double ahead_m_ = 0;
  bool goes_on_ = false;         // A line ahead, beyond that.
  int lost_ = 0;                 // Frames.
  std::optional<double> level_;  // The catheter's contrast.
};

TipOffset ofLength(const TipOffset& offset, double length_m) {
  if (!(length_m > 0)) return offset;
  static const Eigen::Matrix<double, 2, kDirections> kUnits = [] {  // Asked for each place of each frame.
    Eigen::Matrix<double, 2, kDirections> units;
    for (int k = 0; k < kDirections; ++k) {
      units.col(k) << std::cos(2 * kPi * k / kDirections), std::sin(2 * kPi * k / kDirections);
    }
    return units;
  }();
  // No narrower than the directions are apart.
  const double apart_m = kPi / kDirections * length_m;
  const Eigen::Matrix2d information = (offset.covariance + apart_m * apart_m * Eigen::Matrix2d::Identity()).inverse();
  double sum = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (int i = -kLengths; i <= kLengths; ++i) {
    const double off = 2.0 * i / kLengths, length = length_m * (1 + kLengthStd * off);
    for (int k = 0; k < kDirections; ++k) {
      const Eigen::Vector2d x = length * kUnits.col(k), from = x - offset.mean_m;
      const double weight = length * std::exp(-0.5 * (from.dot(information * from) + off * off));
      sum += weight;
      mean += weight * x;
      second += weight * x * x.transpose();
    }
  }
  if (!(sum > 1e-12 * length_m)) return offset;
  TipOffset known = offset;
  known.mean_m = mean / sum;
  known.covariance = second / sum - known.mean_m * known.mean_m.transpose();
  return known;
}

CatheterTracer::CatheterTracer(const VesselTree& tree, const CatheterTracerSettings& settings)
    : impl_(std::make_unique<Impl>(tree, settings)) {}
CatheterTracer::~CatheterTracer() = default;

std::optional<CatheterTrace> CatheterTracer::trace(const cv::Mat& image, const SeenPose& pose,
                                                   const TipBelief& expected, const TipOffset& offset) {
  return impl_->trace(image, pose, expected, offset);
}

}  // namespace angio::navigation
