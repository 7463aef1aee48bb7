// SPDX-License-Identifier: GPL-2.0-or-later
// The shadow of a tube, and of what lies beside one.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "angio/test/namespace.hpp"
#include "tube_chord.hpp"
#include "tube_shadows.hpp"

namespace angio::test {
namespace {

// A blur moves absorption about, and takes none away: the area of a half-ellipse with half axes r and 1.
TEST(TubeChord, BlurKeepsTheArea) {
  for (const double radius : {0.8, 3.0, 12.0}) {
    for (const double blur : {0.3, 1.1, 4.0}) {
      constexpr double kStep = 0.01;
      double area = 0;
      for (double x = -radius - 6 * blur; x < radius + 6 * blur; x += kStep)
        area += kStep * blurredChord(radius, blur, x);
      EXPECT_NEAR(area, 0.5 * M_PI * radius, 1e-3 * radius) << radius << " " << blur;
    }
  }
}

TEST(TubeChord, HardlyBlurredIsTheChordOfACircle) {
  for (const double x : {0.0, 1.0, 2.5}) EXPECT_NEAR(blurredChord(5, 0.1, x), std::sqrt(1 - x * x / 25), 2e-3) << x;
}

TEST(TubeChord, TableIsTheFormula) {
  const TubeChord chord;
  for (const float radius : {0.6f, 2.0f, 9.0f}) {
    for (const float part : {0.05f, 0.11f, 0.4f, 1.3f, 2.3f}) {
      const float blur = part * radius;
      const TubeChord::Profile profile = chord.of(radius, blur);
      double worst = 0;
      for (float x = -radius - 4 * blur; x < radius + 4 * blur; x += 0.013f * radius) {
        worst = std::max(worst, std::abs(profile(x) - blurredChord(radius, blur, x)));
      }
      EXPECT_LT(worst, 0.01) << radius << " " << part;
    }
  }
}

// Two vessels, the second on the first one's flank and a little out of parallel. The image is their sum.
struct Pair {
  static constexpr float kOff = 5, kSlope = 0.2f, kRadius = 3, kContrast = 0.2f, kBlur = 1.1f;

  Pair() {
    std::vector<TubeShadows::Piece> first(200), second(200);
    for (int i = 0; i < 200; ++i) {
      const float at = static_cast<float>(i);
      first[i] = {{at, 100}, {1, 0}, 4, 0.3f};
      const float norm = std::hypot(1.0f, kSlope);
      second[i] = {{at, 100 + kOff + kSlope * (at - 100)}, {1 / norm, kSlope / norm}, kRadius, kContrast};
    }
    shadows.set({200, 200}, {first, second});
  }

  // Across the first at its middle, in steps of half a pixel.
  TubeShadows::Profile across() const { return {{100, 100}, {0, 1}, 0.5f, kBlur, 41}; }

  TubeShadows shadows;
};

TEST(TubeShadows, TakesAwayTheOtherAndNotItsOwn) {
  const Pair pair;
  std::array<float, 41> samples{};
  pair.shadows.subtractOthers(0, pair.across(), samples.data());
  for (int k = 0; k < 41; ++k) {
    const double off = (0.5 * (k - 20) - Pair::kOff) / std::hypot(1, Pair::kSlope);  // From the second one's axis.
    EXPECT_NEAR(-samples[k], Pair::kContrast * blurredChord(Pair::kRadius, Pair::kBlur, off), 0.01 * Pair::kContrast);
  }
}

TEST(TubeShadows, UnknownPiecesCastNothing) {
  Pair pair;
  pair.shadows.replace(1, std::vector<TubeShadows::Piece>(200));
  std::array<float, 41> samples{};
  pair.shadows.subtractOthers(0, pair.across(), samples.data());
  for (const float left : samples) EXPECT_EQ(left, 0);
}

TEST(TubeShadows, EndWhereTheirTubesEnd) {
  Pair pair;
  std::vector<TubeShadows::Piece> short_one(200);
  for (int i = 0; i < 80; ++i) short_one[i] = {{static_cast<float>(i), 105}, {1, 0}, 3, 0.2f};
  pair.shadows.set({200, 200}, {std::vector<TubeShadows::Piece>(200), short_one});
  const auto darkest = [&](float x) {
    std::array<float, 41> samples{};
    pair.shadows.subtractOthers(0, {{x, 100}, {0, 1}, 0.5f, Pair::kBlur, 41}, samples.data());
    return -*std::min_element(samples.begin(), samples.end());
  };
  EXPECT_GT(darkest(60), 0.17f);
  EXPECT_EQ(darkest(90), 0);
}

// The linear fit finds small changes of a tube's centre and radius; the second order of a tenth of the radius is a
// hundredth of it, and the prior on the radius takes some of the growth.
TEST(TubeTemplates, FitFindsShiftAndContrast) {
  constexpr float kRadius = 4;
  const TubeTemplates templates(kRadius, 1.01f * kRadius, [](float) { return 1.1f; });
  const TubeTemplates::Template& tube = templates.nearest(kRadius);
  for (const float shift : {-0.4f, 0.0f, 0.25f}) {
    std::array<float, TubeTemplates::kSamples> samples;
    for (int i = 0; i < TubeTemplates::kSamples; ++i) {
      const float x = tube.step * static_cast<float>(i - TubeTemplates::kSamples / 2);
      samples[i] = 0.7f - 0.01f * x + 0.3f * static_cast<float>(blurredChord(kRadius, 1.1, x - shift));
    }
    const TubeTemplates::Fit fit = tube.fit(samples);
    EXPECT_NEAR(fit.contrast, 0.3, 0.01) << shift;
    EXPECT_NEAR(fit.shift, shift, 0.05) << shift;
    EXPECT_LT(fit.misfit, 0.01) << shift;
  }
}

}  // namespace
}  // namespace angio::test
