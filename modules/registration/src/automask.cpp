// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/core/optim.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/tubes/tubes.hpp"
#include "angio/vessel/plausible_radii.hpp"
#include "drawn_tubes.hpp"
#include "image_registration.hpp"
#include "methods.hpp"
#include "projected_motion.hpp"

namespace angio::registration {
namespace {

// Images are compared at these parts of their size, coarse first.
constexpr int kBinnings[] = {32, 16, 8, 4};
// A vessel is drawn at least so wide [px of the binned image].
constexpr double kMinRadius_px = 0.75;
// Larger than any difference of correlations.
constexpr double kNoImage = 10;
constexpr int kMaxEvaluations = 400;

// In [-1, 1]; nothing where one side does not vary.
std::optional<double> correlation(const std::vector<float>& a, const std::vector<float>& b) {
  using Values = Eigen::Map<const Eigen::ArrayXf>;
  const Eigen::ArrayXd x = Values(a.data(), static_cast<Eigen::Index>(a.size())).cast<double>();
  const Eigen::ArrayXd y = Values(b.data(), static_cast<Eigen::Index>(b.size())).cast<double>();
  const Eigen::ArrayXd dx = x - x.mean(), dy = y - y.mean();
  const double norms = std::sqrt(dx.square().sum() * dy.square().sum());
  if (!(norms > 0)) return std::nullopt;
  return (dx * dy).sum() / norms;
}

// The camera of an image whose pixels are `binning` x `binning` of the given one's; a rest at the edge is left out.
XrayCamera binned(const XrayCamera& camera, int binning) {
  XrayCamera::Parameters p = camera.parameters();
  p.width_px = std::max(1, p.width_px / binning);
  p.height_px = std::max(1, p.height_px / binning);
  p.fx_px /= binning;
  p.fy_px /= binning;
  p.cx_px = (p.cx_px + 0.5) / binning - 0.5;
  p.cy_px = (p.cy_px + 0.5) / binning - 0.5;
  if (p.pixel_spacing_m) *p.pixel_spacing_m *= binning;
  return XrayCamera(p);
}

// One view at one binning: what is seen, where it is compared, and what the tree would look like there.
class MaskedView {
 public:
  MaskedView(const cv::Mat& attenuation, const XrayView& view, int binning)
      : camera_(binned(view.camera, binning)), T_view_first_(view.T_view_first) {
    const cv::Size size(camera_.width_px(), camera_.height_px());
    const cv::Rect whole({0, 0}, attenuation.size());  // A detector may be smaller than one binned pixel.
    cv::resize(attenuation(cv::Rect(0, 0, size.width * binning, size.height * binning) & whole), seen_, size, 0, 0,
               cv::INTER_AREA);
    open_ = cv::Mat(size, CV_8U, cv::Scalar(255));
    if (view.collimator_px.empty()) return;
    open_.setTo(0);
    std::vector<cv::Point> corners;
    for (const Eigen::Vector2d& c : view.collimator_px) {
      corners.emplace_back(cvRound((c.x() + 0.5) / binning - 0.5), cvRound((c.y() + 0.5) / binning - 0.5));
    }
    cv::fillConvexPoly(open_, corners, 255);
  }

  // Widens the tree's tubes to what the pixels can show.
  void setTubes(const std::vector<Tube>& tubes, double depth_m) {
    tubes_ = withMinRadius(tubes, kMinRadius_px * depth_m / camera_.parameters().fx_px);
  }

  // The mask about the tree as it is projected now: pixels within `margin_m` of it, at its depth.
  void setMask(const Pose& T_first_centered, double margin_m) {
    const Pose T_view_centered = T_view_first_ * T_first_centered;
    const cv::Mat drawn = lengths_.compute(tubes_, camera_, T_view_centered) > 0;
    const double depth_m = std::max(1e-3, T_view_centered.translation().z());
    const double margin_px = margin_m * camera_.parameters().fx_px / depth_m;
    cv::Mat away, mask;
    cv::distanceTransform(drawn == 0, away, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    mask = (away <= margin_px) & open_;
    places_.clear();
    if (cv::countNonZero(drawn) > 0) cv::findNonZero(mask, places_);
  }
  std::size_t size() const { return places_.size(); }

  // What is seen inside the mask, and what the tree gives there, at the end of both lists.
  void appendSeen(std::vector<float>& values) const { append(seen_, values); }
  void appendDrawn(const Pose& T_first_centered, std::vector<float>& values) {
    append(lengths_.compute(tubes_, camera_, T_view_first_ * T_first_centered), values);
  }

 private:
  void append(const cv::Mat& image, std::vector<float>& values) const {
    for (const cv::Point& at : places_) values.push_back(image.at<float>(at));
  }

  XrayCamera camera_;
  Pose T_view_first_;
  cv::Mat seen_, open_;
  std::vector<Tube> tubes_;
  std::vector<cv::Point> places_;
  PathLengths lengths_;
};

// One less the correlation of what is seen with what the tree gives, over all views, about a pose: the simplex's
// function of a turn and a shift about the centroid, in units of its first steps.
class MaskedMismatch final : public cv::MinProblemSolver::Function {
 public:
  MaskedMismatch(std::vector<MaskedView>& views, const Pose& T_camera_centered) : views_(views), T_(T_camera_centered) {
    for (const MaskedView& view : views_) view.appendSeen(seen_);
  }

  static Pose moved(const Pose& T_camera_centered, const double* x) {
    using Settings = AutoMaskSettings;
    Pose offset = Pose::Identity();
    // Shifts in the camera's axes: the beam's direction is one of its own.
    const Eigen::Vector3d shift_m = 1e-3 * Settings::step_mm * Eigen::Vector3d(x[0], x[1], x[2]);
    offset.linear() = expSO3(degToRad(Settings::step_deg) * Eigen::Vector3d(x[3], x[4], x[5]));
    Pose T = T_camera_centered * offset;
    T.translation() += shift_m;
    return T;
  }

  int getDims() const override { return 6; }
  double calc(const double* x) const override {
    drawn_.clear();
    const Pose T = moved(T_, x);
    if (!T.matrix().allFinite()) return kNoImage;
    for (MaskedView& view : views_) view.appendDrawn(T, drawn_);
    const auto found = correlation(seen_, drawn_);
    return found ? 1 - *found : kNoImage;
  }

 private:
  std::vector<MaskedView>& views_;
  Pose T_;
  std::vector<float> seen_;
  mutable std::vector<float> drawn_;
};

class AutoMask final : public ImageRegistration {
 public:
  AutoMask(const AutoMaskSettings& settings, const VesselTree& tree)
      : ImageRegistration(AutoMaskSettings::kName, tree),
        settings_(settings),
        tubes_(TubeTree(withPlausibleRadii(tree, 1e-3 * settings.end_radius_mm)).tubes(pointsCentered(), {})) {}

 private:
  void fit(const XrayViews& views, const std::vector<cv::Mat>& attenuations, Pose& T_camera_centered,
           RegistrationResult& result) override {
    double margin_m = 1e-3 * settings_.mask_margin_mm, step = 1;
    for (const int binning : kBinnings) {
      alignAt(binning, margin_m, step, views, attenuations, T_camera_centered, result);
      margin_m /= 2;
      step /= 2;
    }
    // A simplex has no gradient that says that it is at rest: a second one that begins where the first has ended does.
    const Pose rested = T_camera_centered;
    alignAt(kBinnings[std::size(kBinnings) - 1], margin_m, step, views, attenuations, T_camera_centered, result);
    result.last_step_px = projectedMotion_px(pointsCentered(), views.front(), rested, T_camera_centered);
  }

  void alignAt(int binning, double margin_m, double step, const XrayViews& views,
               const std::vector<cv::Mat>& attenuations, Pose& T_camera_centered, RegistrationResult& result) {
    std::vector<MaskedView> masked;
    for (std::size_t v = 0; v < views.size(); ++v) {
      masked.emplace_back(attenuations[v], views[v], binning);
      masked.back().setTubes(tubes_, (views[v].T_view_first * T_camera_centered).translation().z());
      masked.back().setMask(T_camera_centered, margin_m);
    }
    std::size_t pixels = 0;
    for (const MaskedView& view : masked) pixels += view.size();
    if (pixels == 0) return;
    const cv::Ptr<cv::MinProblemSolver::Function> mismatch(new MaskedMismatch(masked, T_camera_centered));
    const cv::Mat first = step * cv::Mat::ones(1, 6, CV_64F);
    const auto simplex = cv::DownhillSolver::create(
        mismatch, first, {cv::TermCriteria::MAX_ITER + cv::TermCriteria::EPS, kMaxEvaluations, 1e-6});
    cv::Mat x = cv::Mat::zeros(1, 6, CV_64F);
    simplex->minimize(x);
    T_camera_centered = MaskedMismatch::moved(T_camera_centered, x.ptr<double>());
    T_camera_centered.linear() = nearestRotation(T_camera_centered.linear());
    ++result.rigid_iterations;
  }

  AutoMaskSettings settings_;
  std::vector<Tube> tubes_;
};

}  // namespace

std::unique_ptr<Registration> make(const AutoMaskSettings& settings, const VesselTree& tree) {
  return std::make_unique<AutoMask>(settings, tree);
}

}  // namespace angio::registration
