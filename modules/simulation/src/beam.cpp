// SPDX-License-Identifier: GPL-2.0-or-later
#include "beam.hpp"

#include <array>
#include <cmath>

namespace angio::simulation {
namespace {

struct Bin {
  double share, iodine;  // Of the quanta; mass attenuation [cm^2/g].
};
constexpr std::array<Bin, 3> kSpectrum{Bin{0.25, 16.5}, Bin{0.45, 9.6}, Bin{0.30, 6.1}};

constexpr int kNodes = 16384;
constexpr double kDeepest = 20;  // Thin-layer log-attenuation at the table's end: e^-12 and less passes there.

}  // namespace

ContrastCurve::ContrastCurve(double attenuation_per_m, double hardening) : table_(kNodes + 1) {
  double mean = 0;
  for (const Bin& bin : kSpectrum) mean += bin.share * bin.iodine;
  const double deepest_m = attenuation_per_m > 0 ? kDeepest / attenuation_per_m : 1;
  nodes_per_m_ = static_cast<float>(kNodes / deepest_m);
  for (int i = 0; i <= kNodes; ++i) {
    const double thin = attenuation_per_m * deepest_m * i / kNodes;
    double passed = 0;
    for (const Bin& bin : kSpectrum) passed += bin.share * std::exp(-thin * (1 + hardening * (bin.iodine / mean - 1)));
    table_[i] = static_cast<float>(passed);
  }
}

double photonsPerPixel(double air_kerma_ngy, double pixel_spacing_m) {
  constexpr double kPerSquareMillimetre = 30.174, kEfficiency = 0.7;
  return kPerSquareMillimetre * kEfficiency * air_kerma_ngy * pixel_spacing_m * pixel_spacing_m * 1e6;
}

}  // namespace angio::simulation
