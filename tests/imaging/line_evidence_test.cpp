// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_evidence.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/namespace.hpp"
#include "unlikely_lines.hpp"

namespace angio::test {
namespace {

constexpr float kSide = 512;

// A line of this radius, uncertainty and contrast with a gentle bend, a point a pixel.
CentreLine lineFrom(const cv::Point2f& from, int length, float radius, float sigma, float contrast) {
  CentreLine line;
  for (int i = 0; i < length; ++i) {
    const float s = static_cast<float>(i);
    line.line.push_back(from + cv::Point2f(s, 0.002f * s * s));
  }
  const auto n = static_cast<std::size_t>(length);
  line.radius.assign(n, radius);
  line.sigma.assign(n, sigma);
  line.contrast.assign(n, contrast);
  return line;
}

std::vector<CentreLine> keptOf(std::vector<CentreLine> lines) {
  dropUnlikely(lines, kSide, 0);
  return lines;
}

const CentreLine kTrunk = lineFrom({60, 200}, 300, 4, 0.3f, 0.4f);

TEST(LineEvidence, AFragmentIsAVesselBesideATreeAndClutterFarFromIt) {
  const auto fragment = [](const cv::Point2f& at) { return lineFrom(at, 60, 2, 0.3f, 0.22f); };
  EXPECT_EQ(keptOf({kTrunk, fragment({130, 210})}).size(), 2U);
  const auto alone = keptOf({kTrunk, fragment({300, 30})});
  ASSERT_EQ(alone.size(), 1U);
  EXPECT_EQ(alone[0].line, kTrunk.line);
}

// The same picture with half of the contrast and half of the noise has the same vessels.
TEST(LineEvidence, FollowsTheImagesOwnContrast) {
  for (const float sigma : {0.2f, 0.3f, 0.45f, 0.7f}) {
    for (const float contrast : {0.08f, 0.15f, 0.25f}) {
      std::vector<CentreLine> lines = {kTrunk, lineFrom({130, 215}, 60, 2, sigma, contrast)};
      const std::size_t kept = keptOf(lines).size();
      for (CentreLine& line : lines) {
        for (float& c : line.contrast) c *= 0.5f;
      }
      EXPECT_EQ(keptOf(lines).size(), kept) << sigma << " " << contrast;
    }
  }
}

// An aorta absorbs as much more than an artery as it is wider.
TEST(LineEvidence, ArteriesAreNotFaintBesideAnAorta) {
  const std::vector<CentreLine> arteries = {lineFrom({60, 200}, 300, 4, 0.3f, 0.25f),
                                            lineFrom({130, 215}, 60, 4, 0.4f, 0.18f)};
  ASSERT_EQ(keptOf(arteries).size(), 2U);
  std::vector<CentreLine> all = arteries;
  all.push_back(lineFrom({60, 420}, 380, 26, 2, 1.1f));
  all.push_back(lineFrom({200, 20}, 280, 24, 2, 1.1f));
  EXPECT_EQ(keptOf(all).size(), 4U);
}

TEST(LineEvidence, NoiseAboutALineSpeaksAgainstIt) {
  const auto keeps = [](float sigma) { return keptOf({kTrunk, lineFrom({130, 215}, 60, 2, sigma, 0.2f)}).size() == 2; };
  EXPECT_TRUE(keeps(0.15f));
  EXPECT_FALSE(keeps(1.5f));
}

// The same picture on a finer grid, or with less contrast and less noise, shows the same; lines touch or are far apart.
TEST(LineEvidence, FollowsTheImagesGridAndContrast) {
  const std::vector<CentreLine> lines = {kTrunk, lineFrom({200, 239.2f}, 80, 2, 0.3f, 0.2f),
                                         lineFrom({130, 420}, 60, 3, 0.5f, 0.1f)};
  std::vector<CentreLine> others = lines;
  for (CentreLine& line : others) {
    for (cv::Point2f& p : line.line) p *= 1.5f;
    for (auto* values : {&line.radius, &line.sigma}) {
      for (float& v : *values) v *= 1.5f;
    }
    for (float& c : line.contrast) c *= 0.4f;
  }
  const auto known = evidenceOf(lines, kSide), same = evidenceOf(others, 1.5f * kSide);
  for (std::size_t l = 0; l < lines.size(); ++l) {
    for (std::size_t t = 0; t < kEvidenceTerms.size(); ++t) {
      EXPECT_NEAR(same[l].terms[t], known[l].terms[t], 1e-3) << l << " " << kEvidenceTerms[t];
    }
  }
}

// The edge of an organ, and a lead: a step beside a line, and a line as straight as no branch of the tree.
TEST(LineEvidence, StepsAndStraightLinesOweMore) {
  const auto keeps = [](CentreLine line) { return keptOf({kTrunk, std::move(line)}).size() == 2; };
  CentreLine vessel = lineFrom({130, 170}, 60, 2, 0.3f, 0.2f);
  for (cv::Point2f& p : vessel.line) p.y = 170 + 15 * std::sin(0.05f * (p.x - 130));
  EXPECT_TRUE(keeps(vessel));
  CentreLine step = vessel, lead = vessel;
  step.step = 1.3f;
  EXPECT_FALSE(keeps(step));
  for (cv::Point2f& p : lead.line) p.y = 170;
  EXPECT_FALSE(keeps(lead));
}

// A rib that bends as a vessel does: long, wide and faint, and alone.
TEST(LineEvidence, WideFaintLineThatStandsAloneIsABone) {
  std::vector<CentreLine> lines = {kTrunk, lineFrom({130, 225}, 200, 5, 0.3f, 0.14f)}, strict = lines;
  dropUnlikely(lines, kSide, 0);
  EXPECT_EQ(lines.size(), 2U);
  dropUnlikely(strict, kSide, 0.6f);
  EXPECT_EQ(strict.size(), 1U);
}

// The diaphragm's edge: as clear, long and near as a vessel can be, with a sixth of the contrast that an artery of its
// width would have. One as wide with as much contrast as its width asks for is a vessel, and so is one that is as dark
// as the arteries: an aorta may be less dense.
TEST(LineEvidence, WideLineMustBeAsDarkAsItIsWide) {
  const auto keeps = [](float contrast) {
    std::vector<CentreLine> lines = {kTrunk, lineFrom({130, 212}, 200, 12, 0.5f, contrast)};
    dropUnlikely(lines, kSide, 0.6f);
    return lines.size() == 2;
  };
  EXPECT_FALSE(keeps(0.2f));
  EXPECT_TRUE(keeps(0.35f));
  EXPECT_TRUE(keeps(1.2f));
}

// A wide line of less than even odds is a vessel where most are so wide, as in an aorta, or where it is as dark as the
// arteries, and clutter otherwise.
TEST(LineEvidence, WideLineOwesLessAmongWideOnes) {
  const auto keeps = [](float radius) {
    std::vector<CentreLine> lines = {lineFrom({60, 200}, 300, radius, 0.3f, 0.5f),
                                     lineFrom({130, 240}, 100, 8, 12, 0.35f)};
    dropUnlikely(lines, kSide, 0);
    return lines.size() == 2;
  };
  EXPECT_TRUE(keeps(6.1f));
  EXPECT_FALSE(keeps(5.9f));
}

TEST(LineEvidence, DevicesStayAndAreNoMeasure) {
  CentreLine wire = lineFrom({300, 30}, 40, 1, 2, 0.05f), steel = lineFrom({60, 400}, 300, 1, 0.1f, 5);
  wire.kind = steel.kind = CurveKind::kDevice;
  EXPECT_EQ(keptOf({kTrunk, wire, steel}).size(), 3U);
}

}  // namespace
}  // namespace angio::test
