// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/live_overlay.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/formatted.hpp"
#include "angio/results/overlay.hpp"
#include "angio/results/text_band.hpp"
#include "angio/types/channels.hpp"
#include "drawing.hpp"

namespace angio::results {
namespace {

constexpr int kPanelLines = 8;    // So many lines of text have room at their full size.
constexpr double kSmaller = 0.9;  // By which letters shrink until more lines have room.
constexpr std::size_t kBarFrames = 256;
constexpr int kNarrowest_px = 320;
const cv::Scalar kGrey(150, 150, 150), kWhite(240, 240, 240), kTipColor(255, 220, 60), kTargetColor(250, 120, 255);

int barHeight_px(const TextStyle& style) { return static_cast<int>(std::lround(20 * style.size)) + 2; }

// The same for all pictures of a width: a film's have one size.
int panelHeight_px(int width_px) {
  const TextStyle style = textStyle(width_px);
  return kPanelLines * style.lineHeight_px() + 2 * style.margin_px() + barHeight_px(style);
}

constexpr std::size_t kMaxWaiting = 8;           // Half a second of frames: an answer later than that is of no use.
constexpr std::int64_t kSilence_us = 1'000'000;  // After it nobody is waited for.

bool silent(const std::optional<std::int64_t>& last_us, std::int64_t now_us) {
  return !last_us || now_us - *last_us > kSilence_us || now_us < *last_us;
}

bool saysConverged(const RegistrationMessage& registration) { return registration.status_text == "converged"; }

}  // namespace

cv::Scalar stateColor(ServoState state) {
  if (state == ServoState::kServo) return kConvergedColor;
  if (state == ServoState::kFault || state == ServoState::kEmergencyStop) return kRejectedColor;
  return state == ServoState::kIdle ? kGrey : kLimitedColor;
}

LiveOverlay::LiveOverlay(const VesselTree& tree, int width_px, const CArmGeometry& carm,
                         const Eigen::Matrix3d& R_patient_lps)
    : tree_(tree),
      model_id_(modelId(tree)),
      width_px_(std::max(width_px, kNarrowest_px)),
      carm_(carm),
      R_patient_lps_(R_patient_lps) {}

cv::Mat LiveOverlay::draw(const LiveScene& scene) {
  bar_.push_back(scene.status ? stateColor(scene.status->state) : kGroundColor);
  if (bar_.size() > kBarFrames) bar_.pop_front();
  const double scale = static_cast<double>(width_px_) / scene.frame.image.cols;
  const int height = std::max(1, static_cast<int>(std::lround(scale * scene.frame.image.rows)));
  const int panel_px = panelHeight_px(width_px_);
  // Even numbers of pixels: the common film formats take no others.
  cv::Mat canvas((height + panel_px + 1) / 2 * 2, (width_px_ + 1) / 2 * 2, CV_8UC3, kGroundColor);
  cv::Mat xray = canvas(cv::Rect(0, 0, width_px_, height));
  cv::resize(greyPicture(scene.frame.image), xray, xray.size(), 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  drawXray(xray, scene);
  if (scene.state) drawPatientLetters(xray, carm_.T_camera_patient(scene.state->joints).linear() * R_patient_lps_);
  drawPanel(canvas(cv::Rect(0, height, width_px_, panel_px)), scene);
  return canvas;
}

bool LiveOverlay::showsTree(const LiveScene& scene) const {
  const auto& r = scene.registration;
  return r && saysConverged(*r) && r->model_id == model_id_;
}

bool LiveOverlay::showsTip(const LiveScene& scene) const {
  const auto& tip = scene.tip;
  return tip && tip->status != CatheterTipStatus::kLost && tip->model_id == model_id_;
}

void LiveOverlay::drawXray(cv::Mat& canvas, const LiveScene& scene) const {
  if (!showsTree(scene)) return;
  const Pose& T_camera_model = scene.registration->T_camera_model;
  const double scale = static_cast<double>(canvas.cols) / scene.frame.image.cols;
  const auto onCanvas = [&](const Eigen::Vector2d& p_px) {
    return subpixel(scale * (p_px + Eigen::Vector2d(0.5, 0.5)) - Eigen::Vector2d(0.5, 0.5));
  };
  const auto pixel = [&](const Eigen::Vector3d& p_model) -> std::optional<cv::Point> {
    const auto p = scene.frame.camera.project(T_camera_model * p_model);
    if (!p) return std::nullopt;
    return onCanvas(*p);
  };
  const cv::Scalar color = scene.status ? stateColor(scene.status->state) : kConvergedColor;
  std::vector<std::optional<cv::Point>> points;
  for (const auto& p : tree_.points().colwise()) points.push_back(pixel(p));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int parent = tree_.parents()[i];
    if (parent < 0 || !points[i] || !points[parent]) continue;
    cv::line(canvas, *points[i], *points[parent], color, 2, cv::LINE_AA, kSubpixelBits);
  }
  for (Eigen::Index i = 1; i < scene.device_px.cols(); ++i) {
    cv::line(canvas, onCanvas(scene.device_px.col(i - 1)), onCanvas(scene.device_px.col(i)), kTipColor, 2, cv::LINE_AA,
             kSubpixelBits);
  }
  const int unit = 1 << kSubpixelBits;
  if (const auto target = scene.target_model ? pixel(*scene.target_model) : std::nullopt) {
    for (const cv::Point& arm : {cv::Point(12 * unit, 0), cv::Point(0, 12 * unit)}) {
      cv::line(canvas, *target - arm, *target + arm, kTargetColor, 2, cv::LINE_AA, kSubpixelBits);
    }
  }
  if (!showsTip(scene)) return;
  if (const auto tip = pixel(scene.tip->tip_model)) {
    cv::circle(canvas, *tip, 7 * unit, kTipColor, 2, cv::LINE_AA, kSubpixelBits);
  }
}

std::vector<BandEntry> LiveOverlay::panelEntries(const LiveScene& scene) const {
  std::vector<BandEntry> entries;
  const auto add = [&](const std::string& words, const cv::Scalar& color) { entries.push_back({words, color}); };
  add(scene.title, kWhite);
  const std::string frame = formatted("frame %lld, %.2f s", static_cast<long long>(scene.frame.sequence),
                                      1e-6 * static_cast<double>(scene.frame.time_us));
  if (const auto& s = scene.status) {
    add(frame + ", " + nameOf(s->state) + (s->reason.empty() ? "" : ": " + s->reason), stateColor(s->state));
    // Both are exactly zero while nothing is seen, and the first one for a task without a view.
    std::string view;
    if (s->view_error_rad != 0) {
      view = formatted("from the wanted view %.3f deg, %.2f mm", radToDeg(s->view_error_rad), 1e3 * s->target_error_m);
    } else if (s->target_error_m != 0) {
      view = formatted("from the wanted place %.2f mm", 1e3 * s->target_error_m);
    }
    const double spent_ms = 1e-3 * static_cast<double>(s->image_us + s->registration_us + s->control_us);
    add(view + (spent_ms > 0 ? formatted("%s%.0f ms", view.empty() ? "" : ", ", spent_ms) : ""), kWhite);
  } else {
    add(frame, kWhite);
  }
  if (const auto& r = scene.registration) {
    const bool other = saysConverged(*r) && r->model_id != model_id_;
    // The message has the mean over all vessels in view, those without contrast agent included.
    add("registration " + r->status_text.substr(0, 60) +
            (r->mean_residual_px > 0 ? formatted(", whole tree to image %.2f px", r->mean_residual_px) : "") +
            (other ? ", of another vessel tree" : ""),
        other               ? kLimitedColor
        : saysConverged(*r) ? kConvergedColor
                            : kRejectedColor);
  }
  if (const auto& q = scene.state) {
    add(formatted("C-arm %+.2f %+.2f deg, table %+.1f %+.1f %+.1f mm", radToDeg(q->joints[0]), radToDeg(q->joints[1]),
                  1e3 * q->joints[2], 1e3 * q->joints[3], 1e3 * q->joints[4]),
        kWhite);
  }
  const bool marked = showsTree(scene);
  if (marked && scene.target_model) add("cross: target", kTargetColor);
  if (showsTip(scene)) {
    add(formatted("%scatheter tip in branch %d at %.1f mm", marked ? "ring: " : "", scene.tip->branch,
                  1e3 * scene.tip->arc_length_m),
        kTipColor);
  }
  return entries;
}

void LiveOverlay::drawPanel(cv::Mat panel, const LiveScene& scene) const {
  const std::vector<BandEntry> entries = panelEntries(scene);
  TextStyle style = textStyle(panel.cols);
  const int bar_px = barHeight_px(style), bottom_px = panel.rows - style.margin_px() / 2;
  while (bandHeight_px(entries, panel.cols, style) > bottom_px - bar_px) style = {kSmaller * style.size, 1};
  writeBand(panel, entries, style);
  const int top = bottom_px - bar_px;
  for (std::size_t i = 0; i < bar_.size(); ++i) {
    const auto edge = [&](std::size_t k) {
      return static_cast<int>(k * static_cast<std::size_t>(panel.cols) / kBarFrames);
    };
    cv::rectangle(panel, {edge(i), top}, {std::max(edge(i), edge(i + 1) - 1), bottom_px}, bar_[i], cv::FILLED);
  }
}

LiveScene* LiveFeed::sceneOf(std::int64_t frame_sequence, std::int64_t time_us) {
  const auto found = std::find_if(waiting_.begin(), waiting_.end(), [&](const LiveScene& s) {
    return s.frame.sequence == frame_sequence && s.frame.time_us == time_us;
  });
  return found == waiting_.end() ? nullptr : &*found;
}

std::optional<LiveScene> LiveFeed::take(LiveScene* scene) {
  if (!scene) return std::nullopt;
  LiveScene taken = std::move(*scene);
  taken.state = state_;
  // What is older will not be answered any more.
  while (&waiting_.front() != scene) waiting_.pop_front();
  waiting_.pop_front();
  return taken;
}

std::optional<LiveScene> LiveFeed::hear(const std::string& channel, AnyMessage message, std::int64_t arrival_us) {
  if (auto* frame = std::get_if<XrayFrame>(&message)) {
    LiveScene scene{std::move(*frame), {}, {}, {}, {}, {}, {}};
    waiting_.push_back(std::move(scene));
    if (waiting_.size() > kMaxWaiting) waiting_.pop_front();
    const bool alone = silent(last_status_us_, arrival_us) && silent(last_registration_us_, arrival_us);
    return alone ? take(&waiting_.back()) : std::nullopt;
  }
  if (const auto* state = std::get_if<CArmState>(&message)) {
    state_ = *state;
  } else if (const auto* tip = std::get_if<CatheterTip>(&message)) {
    if (LiveScene* scene = sceneOf(tip->frame_sequence, tip->time_us)) scene->tip = *tip;
  } else if (const auto* registration = std::get_if<RegistrationMessage>(&message)) {
    last_registration_us_ = arrival_us;
    LiveScene* scene = sceneOf(registration->frame_sequence, registration->time_us);
    if (scene) scene->registration = *registration;
    if (silent(last_status_us_, arrival_us)) return take(scene);
  } else if (const auto* status = std::get_if<ServoStatus>(&message)) {
    const bool catheters = channel == kCatheterStatusChannel;
    if (catheters && !silent(last_carm_status_us_, arrival_us)) return std::nullopt;
    if (!catheters) last_carm_status_us_ = arrival_us;
    last_status_us_ = arrival_us;
    LiveScene* scene = sceneOf(status->frame_sequence, status->time_us);
    if (scene) scene->status = *status;
    return take(scene);
  }
  return std::nullopt;
}

}  // namespace angio::results
