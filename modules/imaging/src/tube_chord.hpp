// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <vector>

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

/// The shadow of a tube across its line, as numbers at a few places, made once for many radii: fitting it to an image
/// is then five sums of products.
///
/// The model is c T(x; r) + b0 + b1 x with T the chord of a circle under a Gaussian blur, 1 where the sharp one has its
/// top. About a guess of centre and radius it is linear in (c, c shift, c change of r, b0, b1), so that one weighted
/// least-squares solution, a fixed matrix, is a Gauss-Newton step.
class TubeTemplates {
 public:
  static constexpr int kSamples = 17;
  static constexpr int kPadded = 8;  ///< Parameters, and zeros up to whole vectors.

  /// What one step finds.
  struct Fit {
    float contrast = 0;  ///< Absorption at the middle of the sharp shadow.
    float shift = 0;     ///< Of the centre, along the samples.
    float growth = 0;    ///< Of the radius.
    float misfit = 0;    ///< Root mean square of what is left.
  };

  struct Template {
    float radius = 1;
    float step = 0.5f;         ///< Between samples; the middle one is number kSamples / 2.
    float shift_noise = 0;     ///< Standard deviation of the shift for white noise of one per sample and contrast 1.
    float contrast_noise = 0;  ///< And of the contrast.
    float blur = 1;            ///< Standard deviation of the image's filter that it is for.
    std::array<std::array<float, kPadded>, kSamples> solution{};
    std::array<std::array<float, kSamples>, 5> model{};

    Fit fit(const std::array<float, kSamples>& samples) const;
  };

  /// For radii from `min_radius` to `max_radius`; `blurOf` gives the standard deviation of the image's blur by radius.
  template <typename BlurOf>
  TubeTemplates(float min_radius, float max_radius, BlurOf blurOf) : min_radius_(min_radius) {
    for (float radius = min_radius; radius < max_radius * kRatio; radius *= kRatio) add(radius, blurOf(radius));
  }

  /// The one of the nearest radius.
  const Template& nearest(float radius) const;

 private:
  static constexpr float kRatio = 1.1f;
  void add(float radius, float blur);

  float min_radius_ = 1;
  std::vector<Template> templates_;
};

}  // namespace angio::imaging
