// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/registration/motion_filter.hpp"

namespace angio::registration {

/// When a tracker believes what a frame's registration says, and when it looks around.
///
/// Frames are compared with what the same track has been, and not with what a good fit would be: a catheter, a small
/// curve in a large tree, has a poor score on every frame and is followed all the same.
struct SequenceTrackerSettings {
  MotionFilterSettings motion;

  /// Frames in a row that could not be followed, after which the motion is forgotten and the search is wide again. Over
  /// five frames at 15 Hz a prediction of constant velocity loses at most 2 mm to a breath of 40 mm/s^2.
  int frames_until_lost = 5;

  /// Largest squared Mahalanobis distance between prediction and registration at which they mean one place.
  static constexpr double gate = Innovation::kGate;

  /// A fit has fallen when its score is below this share of the track's, and its mean distance from image to model
  /// above the track's by as much. Where much of the image is unexplained the score alone says little.
  static constexpr double fallen_share = 0.7;

  /// Whether a sequence that has never converged may begin a track on an ambiguous pose. If not, every frame is
  /// searched around the initial prior until one converges.
  bool follow_ambiguous = true;

  /// How many times the score of the pose near the prediction another one must have, to be followed instead.
  static constexpr double clearly_better = 1.5;

  double memory_frames = 15;  ///< Of the track's score and distance.

  /// A track that has never converged may be in the wrong place: how often to look around the initial prior as well.
  static constexpr int frames_between_searches = 15;

  /// The registration's prior is the prediction with its deviations so many times as wide: its answer goes into the
  /// filter, where the prediction is counted once already.
  static constexpr double prior_widening = 3;

  void visit(SettingsVisitor& v) {
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
    v.integer("frames_until_lost", frames_until_lost, 1, 1000);
    v.flag("follow_ambiguous", follow_ambiguous);
  }
};

/// Where a frame's pose comes from.
enum class PoseSource {
  kTracked,   ///< Registration::align from the predicted pose.
  kSearched,  ///< Registration::search around the initial prior, the prediction or the last pose that was followed.
};

/// One frame's registration, and what the tracker made of it.
struct [[nodiscard]] TrackedFrame {
  RegistrationResult result;  ///< As the method says, its status included; times are of all that was tried.
  PoseSource source = PoseSource::kSearched;

  /// Whether the motion was updated with the result. One that was not is the best there was, and may be in the wrong
  /// place: then `prediction` says where the tree is believed to be.
  bool followed = false;
  std::string doubt;  ///< Why the tracker looked around, or did not follow, in words; empty for a frame without doubt.

  std::optional<PosePrior> prediction;   ///< From the frames before; absent when there was no track.
  std::optional<Innovation> innovation;  ///< Of the result; absent without a prediction or a pose.
};

/// Follows one tree through consecutive frames: predicts, registers near the prediction, looks around when in doubt.
///
/// Knows neither clock nor camera; the same frames and times give the same poses, bit for bit.
class SequenceTracker {
 public:
  /// Borrows the registration, which must outlive it. Throws InputError when a setting is out of its range.
  SequenceTracker(Registration& registration, const SequenceTrackerSettings& settings, const StartSettings& starts);

  /// The next frame. Within a track times must not fall, or InputError is thrown and nothing is changed.
  ///
  /// @param initial  What is known of the pose without the frames before, for example from calibration: where a search
  ///                 begins, and how wide it is.
  TrackedFrame step(const XrayViews& views, double time_s, const PosePrior& initial);

  /// Whether there is a track: frames have been followed, and not too many missed since.
  bool tracking() const { return track_.has_value(); }

  /// Forgets everything, as between two sequences.
  void reset();

 private:
  // How well image and model agree, by two figures that fail for different reasons.
  struct Fit {
    double score = 0;
    double distance_px = 0;  // Mean, from image points to the model.
  };

  // What the registrations that were followed have been like.
  struct Track {
    int frames = 0;
    Fit fit;
    bool converged = false;  // The last of them.
    int missed_in_a_row = 0;
    int frames_since_search = 0;
  };

  // A registration of the frame, and how it stands to the prediction.
  struct Candidate {
    RegistrationResult result;
    PoseSource source = PoseSource::kSearched;
    Fit fit;
    Matrix6d about_centroid = Matrix6d::Zero();  // Its covariance as the motion filter has it.
    std::optional<Innovation> innovation;
    bool usable = false;
    bool inside = false;  // The gate.
  };

  void begin(const XrayViews& views, double time_s, const PosePrior& initial, TrackedFrame& frame);
  void follow(const XrayViews& views, double time_s, const PosePrior& initial, TrackedFrame& frame);
  RegistrationResult search(const XrayViews& views, const PosePrior& prior, RegistrationTimes& times);

  Candidate candidate(RegistrationResult result, PoseSource source, const XrayViews& views, double time_s) const;
  Matrix6d covarianceOf(const RegistrationResult& result, const XrayCamera& camera) const;
  bool fallen(const Fit& fit) const;
  bool clearlyBetter(const Fit& a, const Fit& b) const;
  bool isJump(const Candidate& there, const Candidate& here) const;
  bool isBetter(const Candidate& other, const Candidate& held) const;
  std::string doubtOf(const Candidate& found) const;

  void restart(const Candidate& found, double time_s);
  void remember(const RegistrationResult& result);
  void miss();

  Registration& registration_;
  SequenceTrackerSettings settings_;
  StartSettings starts_;
  MotionFilter motion_;
  std::optional<Track> track_;
  std::optional<Pose> last_followed_;
  bool ever_converged_ = false;
};

}  // namespace angio::registration
