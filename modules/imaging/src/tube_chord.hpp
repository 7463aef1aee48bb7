// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// The shadow of a tube across its axis: the chord of a circle of this radius under a Gaussian blur, at a distance `x`
/// from the middle; 1 where the sharp one has its top.
double blurredChord(double radius, double blur, double x);

/// The same from a table, to within a hundredth where the blur is a twentieth of the radius or more.
class TubeChord {
  static constexpr int kBlurs = 48, kPlaces = 48;
  static constexpr float kMaxBlur = 2.4f, kReachBlurs = 3;

 public:
  TubeChord();

  /// One tube's shadow, under a blur of up to kMaxBlur radii; a wider one counts as that.
  class Profile {
   public:
    float operator()(float x) const {
      const float place = per_px_ * (x < 0 ? -x : x);
      if (!(place < kPlaces - 1)) return 0;
      const int i = static_cast<int>(place);
      const float v = place - static_cast<float>(i);
      return (1 - v) * value_[i] + v * value_[i + 1];
    }

   private:
    friend class TubeChord;
    float per_px_ = 1;
    std::array<float, kPlaces> value_{};
  };

  Profile of(float radius, float blur) const;

  /// Where the shadow has ended.
  static float reach(float radius, float blur) { return radius + kReachBlurs * blur; }

 private:
  std::array<std::array<float, kPlaces>, kBlurs> value_{};  // By the root of blur over radius, and distance over reach.
};

/// Radius of a tube whose X-ray profile, blurred, is 2 * `half_width` wide at half of its height. `blur` is the
/// standard deviation of the noise filter; the averaging by pixels is added here. All in working pixels.
///
/// The sharp profile of a tube, the chord of a circle, falls to half at sqrt(3)/2 of the radius. Blur widens a thin one
/// and, because the chord is steepest at its ends, narrows a thick one. Returns 0 for a width that blur alone explains.
float tubeRadius(float half_width, float blur);

}  // namespace angio::imaging
