// SPDX-License-Identifier: GPL-2.0-or-later
#include "torso.hpp"

#include <algorithm>
#include <cmath>

#include "uniform.hpp"

namespace angio::simulation {
namespace {

using Eigen::Vector3d;

// Linear attenuation above what is around [1/m].
constexpr double kWater = 20.6;
constexpr double kSpongyBone = 6;
constexpr double kLung = -12;
constexpr double kGas = -20;

constexpr double kVertebra = 0.031;  // [m] From one to the next, disc included.

Shape ellipsoid(const Vector3d& center, const Vector3d& half_axes, const Vector3d& turn = Vector3d::Zero()) {
  return {Shape::Kind::kEllipsoid, center, half_axes, expSO3(turn)};
}

Shape cylinder(const Vector3d& center, const Vector3d& half_axes, const Vector3d& turn = Vector3d::Zero()) {
  return {Shape::Kind::kCylinder, center, half_axes, expSO3(turn)};
}

// A bone is a shell of cortical bone around a spongy inside.
void addBone(const Shape& outside, double wall_m, Body& body) {
  Shape inside = outside;
  inside.half_axes.array() -= wall_m;
  body.tissues.push_back({outside, kBoneAttenuation_per_m, {}});
  body.tissues.push_back({inside, kSpongyBone - kBoneAttenuation_per_m, {}});
}

// The body of a vertebra: slabs with a waist, walls of cortical bone around, plates at both ends.
void addVertebralBody(const Vector3d& center, const Vector3d& turn, Body& body) {
  constexpr double kWall = 0.7e-3, kHalfHeight = 0.0115;
  constexpr int kSlabs = 7;
  const Vector3d up = expSO3(turn).col(2);
  for (int i = 0; i < kSlabs; ++i) {
    const double place = (2.0 * i + 1) / kSlabs - 1;  // Along the axis, -1 to 1.
    const double waist = 1 - 0.14 * (1 - place * place);
    const Vector3d half(0.0225 * waist, 0.0165 * waist, kHalfHeight / kSlabs), wall(kWall, kWall, 0);
    const Vector3d at = center + place * kHalfHeight * up;
    body.tissues.push_back({cylinder(at, half, turn), kBoneAttenuation_per_m, {}});
    body.tissues.push_back({cylinder(at, half - wall, turn), kSpongyBone - kBoneAttenuation_per_m, {}});
  }
  for (const double end : {-1.0, 1.0}) {
    const Shape plate = cylinder(center + end * (kHalfHeight - 0.3e-3) * up, {0.0220, 0.0160, 0.3e-3}, turn);
    body.tissues.push_back({plate, kBoneAttenuation_per_m - kSpongyBone, {}});
  }
}

// Behind the body's middle, a little hollow at the loin.
double spineDepth(double s) { return 0.052 + 0.006 * std::cos((s + 0.16) / 0.1); }

void addVertebra(double s, const Vector3d& origin, Body& body) {
  const double p = spineDepth(s);
  const auto at = [&](double x, double dp, double ds) { return Vector3d(Vector3d(x, p + dp, s + ds) - origin); };
  const double tilt = std::atan((spineDepth(s + 0.01) - spineDepth(s - 0.01)) / 0.02);  // Along the spine's course.
  addVertebralBody(at(0, 0, 0), {-tilt, 0, 0}, body);
  for (const double side : {-1.0, 1.0}) {
    addBone(cylinder(at(0.0145 * side, 0.021, 0.004), {0.0042, 0.0068, 0.009}, {kPi / 2, 0, 0}), 1.1e-3, body);
    addBone(ellipsoid(at(0.033 * side, 0.032, 0.002), {0.019, 0.0045, 0.0055}, {0, 0, 0.25 * side}), 0.8e-3, body);
    addBone(ellipsoid(at(0.014 * side, 0.036, -0.012), {0.0055, 0.006, 0.013}), 0.9e-3, body);
  }
  addBone(ellipsoid(at(0, 0.052, -0.010), {0.0035, 0.017, 0.0095}, {0.35, 0, 0}), 0.9e-3, body);
}

// From its vertebra around the flank and down to where it turns to cartilage.
void addRib(double s, double side, int number, const Vector3d& origin, LongBones& bones) {
  const double end = number < 10 ? 0.78 * kPi : number == 10 ? 0.55 * kPi : 0.4 * kPi;
  const double lower = number < 4 ? 0.075 + 0.015 * (number - 4) : 0.075;
  const double wide = number < 4 ? 0.142 - 0.018 * (4 - number) : 0.142;
  Vector3d last = Vector3d::Zero();
  constexpr int kSteps = 40;
  for (int i = 0; i <= kSteps; ++i) {
    const double turn = 0.11 * kPi + (end - 0.11 * kPi) * i / kSteps;
    const Vector3d p(side * wide * std::sin(turn), 0.096 * std::cos(turn) + 0.006,
                     s + 0.012 - lower * std::pow((turn - 0.11 * kPi) / (0.67 * kPi), 1.15));
    if (i > 0) {
      // Thin where it turns to cartilage and where it meets the spine.
      const double solid = std::min({1.0, 0.15 + 0.2 * i, 0.1 * (kSteps + 1 - i)});
      bones.bone.push_back({last - origin, p - origin, 5.4e-3, 5.4e-3, solid});
      bones.marrow.push_back({last - origin, p - origin, 4.3e-3, 4.3e-3, solid});
    }
    last = p;
  }
}

void addGas(double share, const Vector3d& origin, std::uint64_t seed, Body& body) {
  Uniform uniform(seed);
  const int bubbles = static_cast<int>(std::lround(34 * share));
  for (int i = 0; i < bubbles; ++i) {
    const double size = uniform(0.005, 0.017);
    // Along the colon's frame: up the right flank, across under the stomach, down the left one.
    const double along = uniform(0, 3);
    const Vector3d colon = along < 1   ? Vector3d(-0.095, 0, -0.20 + 0.11 * along)
                           : along < 2 ? Vector3d(-0.095 + 0.19 * (along - 1), -0.055, -0.11)
                                       : Vector3d(0.095, 0.005, -0.09 - 0.12 * (along - 2));
    const Vector3d p = colon + Vector3d(uniform(-0.014, 0.014), uniform(-0.02, 0.02), uniform(-0.014, 0.014));
    const Vector3d half = size * Vector3d(uniform(0.7, 1.4), uniform(0.5, 0.9), uniform(0.7, 1.3));
    body.tissues.push_back({ellipsoid(p - origin, half, {0, 0, uniform(-1, 1)}), kGas, {}});
  }
  if (share > 0) {
    body.tissues.push_back(
        {ellipsoid(Vector3d(0.062, -0.045, -0.045) - origin, {0.036, 0.02, 0.026}, {0, 0.5, 0}), kGas, {}});
  }
}

Body torso(const AnatomySettings& settings, const Vector3d& origin, std::uint64_t seed) {
  Body body;
  body.tissues.push_back({cylinder(-origin, {0.165, 0.115, 0.5}), kWater, {}});
  const Shape right_dome = ellipsoid(Vector3d(-0.070, -0.005, -0.10) - origin, {0.085, 0.105, 0.125});
  const Shape left_dome = ellipsoid(Vector3d(0.080, 0.0, -0.115) - origin, {0.075, 0.10, 0.122});
  const Shape heart = ellipsoid(Vector3d(0.028, -0.045, 0.045) - origin, {0.062, 0.05, 0.05}, {0.2, 0.55, -0.3});
  body.tissues.push_back(
      {ellipsoid(Vector3d(-0.080, 0, 0.06) - origin, {0.062, 0.095, 0.165}), kLung, {right_dome, heart}});
  body.tissues.push_back(
      {ellipsoid(Vector3d(0.082, 0, 0.06) - origin, {0.060, 0.095, 0.165}), kLung, {left_dome, heart}});
  for (int k = -9; k <= 8; ++k) addVertebra((k + 0.5) * kVertebra, origin, body);
  for (int rib = 1; rib <= 12; ++rib) {
    const double s = (5.5 - rib) * 0.024 + 0.085;
    for (const double side : {-1.0, 1.0}) addRib(s, side, rib, origin, body.bones);
  }
  addGas(settings.gas, origin, seed, body);
  return body;
}

}  // namespace

Body bodyAround(const AnatomySettings& settings, std::uint64_t seed) {
  switch (settings.region) {
    case Region::kNone:
      return {};
    case Region::kLiver:
      return torso(settings, {-0.035, -0.01, -0.055}, seed);
    case Region::kHeart:
      return torso(settings, {0.028, -0.045, 0.045}, seed);
  }
  return {};
}

}  // namespace angio::simulation
