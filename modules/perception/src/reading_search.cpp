// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/reading_search.hpp"

namespace angio::perception {
namespace {

constexpr int kFirstTrial = 5;  // A third of a second at 15 frames a second.

// The first trial's count, and each double of it.
bool begins(int rejected) {
  int at = kFirstTrial;
  while (at < rejected && at < (1 << 29)) at *= 2;
  return rejected == at;
}

}  // namespace

void ReadingSearch::reject(const Observation& seen, const XrayCamera& camera, const CameraPlace& place) {
  if (settled_ || seen.registration.status == RegistrationStatus::kTooFewPoints) return;
  ++rejected_;
  if (!trial_ && begins(rejected_)) trial_ = Trial{seen.centerline, camera, place, otherReadings(camera)};
}

void ReadingSearch::accept() {
  settled_ = true;
  trial_.reset();
  match_.reset();
}

void ReadingSearch::tryNext(Perception& perception, const RegistrationGate& gate) {
  if (!trial_) return;
  Trial& t = *trial_;
  const ImageReading reading = t.readings[t.next++];
  const Centerline2d read = readAs(reading, t.curves, t.camera);
  const RegistrationResult result = perception.observe({XrayView{read, t.camera}}, t.place).registration;
  const bool passes = !gate.rejection(result, perception.calibrated_T_camera_model(t.place), std::nullopt);
  if (passes && result.alignment.score() > t.best_score) {
    t.best_score = result.alignment.score();
    t.best = reading;
  }
  if (t.next < t.readings.size()) return;
  match_ = t.best;
  trial_.reset();
}

std::optional<std::string> ReadingSearch::advice() const {
  if (!match_) return std::nullopt;
  return std::string("the image matches when ") + nameOf(*match_) + ": send it as xray_frame_t wants it";
}

}  // namespace angio::perception
