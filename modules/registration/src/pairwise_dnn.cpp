// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>

#include "angio/geometry/decompositions.hpp"
#include "fit_classification.hpp"
#include "image_pair.hpp"
#include "image_registration.hpp"
#include "methods.hpp"
#include "projected_motion.hpp"
#include "rigid_step.hpp"

// The file's bytes, from angio_pairwise_dnn to angio_pairwise_dnn_end.
asm(".section .rodata\n"
    ".balign 16\n"
    ".global angio_pairwise_dnn\n"
    "angio_pairwise_dnn:\n"
    ".incbin \"" ANGIO_PAIRWISE_DNN
    "\"\n"
    ".global angio_pairwise_dnn_end\n"
    "angio_pairwise_dnn_end:\n"
    ".byte 0\n"
    ".text\n");
extern "C" const char angio_pairwise_dnn[], angio_pairwise_dnn_end[];

namespace angio::registration {
namespace {

// A step that moves the projection by less ends the search [px, rms].
constexpr double kStepRest_px = 0.1;
// Standard deviation of the network's answers near the truth, by clinical pairs of held-out trees [px of the pair].
// Depth is the exception: what is left of it is what the start was off by, so that one view does not tell it.
const PairMotion kNearStd_px = (PairMotion() << 0.12, 0.12, 3, 0.36, 0.36, 0.21).finished();

// d(motion)/d(dx) at rest of a pose T exp(dx) of the first view, by central differences.
Matrix6d motionByTwist(const PairWindow& window, const Pose& T_view_first, const Pose& T_camera_centered) {
  constexpr double kStep = 1e-5;  // m and rad; the motion bends over tenths.
  const Pose T_view_centered = T_view_first * T_camera_centered;
  Matrix6d J;
  for (int k = 0; k < 6; ++k) {
    const Twist dx = kStep * Twist::Unit(k);
    J.col(k) = (pairMotion(window, T_view_centered, T_view_centered * expSE3(dx)) -
                pairMotion(window, T_view_centered, T_view_centered * expSE3(-dx))) /
               (2 * kStep);
  }
  return J;
}

class PairwiseDnn final : public ImageRegistration {
 public:
  explicit PairwiseDnn(const VesselTree& tree)
      : ImageRegistration(PairwiseDnnSettings::kName, tree),
        drawing_(tree, 1e-3 * PairwiseDnnSettings::end_radius_mm),
        network_(cv::dnn::readNetFromONNX(angio_pairwise_dnn,
                                          static_cast<std::size_t>(angio_pairwise_dnn_end - angio_pairwise_dnn))) {}

 private:
  void fit(const XrayViews& views, const std::vector<cv::Mat>& attenuations, Pose& T_camera_centered,
           RegistrationResult& result) override {
    answer_ = {};
    while (result.rigid_iterations < PairwiseDnnSettings::max_iterations) {
      answer_ = answerAt(views, attenuations, T_camera_centered);
      if (!isFullRank(answer_.H)) {
        result.last_step_px = kPairSide_px;  // Not at rest: there is nothing to compare.
        return;
      }
      Pose next = T_camera_centered * expSE3(solveSymmetric(answer_.H, answer_.g));
      next.linear() = nearestRotation(next.linear());
      result.last_step_px = projectedMotion_px(pointsCentered(), views.front(), T_camera_centered, next);
      T_camera_centered = next;
      ++result.rigid_iterations;
      if (result.last_step_px < kStepRest_px) return;
    }
  }

  // What the network's last answer is worth.
  std::optional<Matrix6d> covarianceAt(const XrayViews&, const Pose& T_camera_centered) const override {
    if (!isFullRank(answer_.H)) return std::nullopt;
    const Eigen::Translation3d to_center(tree().centroid());
    return covarianceOfResult(inverseOfSymmetric(answer_.H), T_camera_centered * to_center.inverse(),
                              tree().centroid());
  }

  // All views' answers about the twist of the centred tree, weighed by what the network knows.
  NormalEquations answerAt(const XrayViews& views, const std::vector<cv::Mat>& attenuations,
                           const Pose& T_camera_centered) {
    NormalEquations sum;
    const Vector6d weights = kNearStd_px.array().square().inverse();
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Pose T_view_centered = views[v].T_view_first * T_camera_centered;
      const auto window = PairWindow::about(pointsCentered(), views[v], T_view_centered);
      if (!window) continue;
      const PairMotion motion = ask(drawing_.pair(attenuations[v], views[v], *window, T_view_centered));
      const Matrix6d J = motionByTwist(*window, views[v].T_view_first, T_camera_centered);
      sum.H += J.transpose() * weights.asDiagonal() * J;
      sum.g += J.transpose() * weights.asDiagonal() * motion;
    }
    return sum;
  }

  PairMotion ask(const ImagePair& pair) {
    const int shape[] = {1, 3, kPairSide_px, kPairSide_px};
    cv::Mat given(4, shape, CV_32F);
    const std::size_t plane = pair.seen.total();
    float* to = given.ptr<float>();
    for (const cv::Mat* picture : {&pair.seen, &pair.drawn, &pair.depth}) {
      to = std::copy(picture->ptr<float>(), picture->ptr<float>() + plane, to);
    }
    network_.setInput(given);
    const cv::Mat found = network_.forward();
    PairMotion motion;
    for (int k = 0; k < 6; ++k) motion[k] = found.at<float>(k);
    return motion;
  }

  PairDrawing drawing_;
  cv::dnn::Net network_;
  NormalEquations answer_;  // The last one.
};

}  // namespace

std::unique_ptr<Registration> make(const PairwiseDnnSettings&, const VesselTree& tree) {
  return std::make_unique<PairwiseDnn>(tree);
}

}  // namespace angio::registration
