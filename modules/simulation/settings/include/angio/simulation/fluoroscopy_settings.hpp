// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/simulation_settings/namespace.hpp"

namespace angio::simulation_settings {

/// How much radiation a frame takes: a number of photons, or a typical air kerma at the detector's entrance.
///
/// Fluoroscopy 30 nGy, cardiac cine 170 nGy, digital subtraction 3000 nGy a frame: round numbers of the order that
/// interventional systems are set to; they differ between makers and fields of view by a factor of two and more.
enum class Dose { kPhotons, kFluoroscopy, kCine, kSubtraction };

enum class PixelDepth { k8, k16 };  ///< Bits of a grey value.

/// From the beam's quanta to grey values. The defaults are those of a flat panel of caesium iodide behind a grid.
struct DetectorSettings {
  double psf_std_mm = 0.16;
  double focal_spot_mm = 0.5;
  double scatter_to_primary = 0.25;
  static constexpr double scatter_std_mm = 30;  ///< How far scatter strays on the detector.
  double lag = 0;
  PixelDepth bits = PixelDepth::k16;

  void visit(SettingsVisitor& v) {
    v.number("psf_std_mm", psf_std_mm, 0, 2,
             "Spread of the light of a quantum on the detector: MTF 0.6 at 1 line pair per mm with 0.16");
    v.number("focal_spot_mm", focal_spot_mm, 0, 3, "Width of the focal spot; it blurs the shadow, not the noise");
    v.number("scatter_to_primary", scatter_to_primary, 0, 10,
             "Scattered over unscattered quanta in the open field, behind the grid");
    v.number("lag", lag, 0, 0.9, "Part of the signal that is left from the frame before, as an afterglow");
    v.choice("bits", bits, {"8", "16"}, "Bits of the image; grey levels count from 0 to 65535 (255) either way");
  }
};

/// Where in the body the tree lies: what stands around its centroid.
enum class Region { kNone, kLiver, kHeart };

/// Bones, lungs, diaphragm and bowel gas around the tree, in a body of average size.
struct AnatomySettings {
  Region region = Region::kLiver;
  double contrast = 0.15;
  double gas = 1;

  void visit(SettingsVisitor& v) {
    v.choice("region", region, {"none", "liver", "heart"},
             "What lies around the tree: bones, lungs, diaphragm and bowel gas of this region");
    v.number("contrast", contrast, 0, 1,
             "Part of the body's log-attenuation that is shown; 1: all, but systems compress it");
    v.number("gas", gas, 0, 5, "Bubbles of bowel gas: share of the usual number");
  }
};

/// Shutters between source and patient.
enum class Shutter { kOpen, kRectangle, kOctagon, kCircle };

/// The open field, in parts of the detector: 1 is its width (height), 0 its middle.
struct CollimatorSettings {
  Shutter shutter = Shutter::kOpen;
  double width = 0.9;
  double height = 0.9;
  double center_x = 0;
  double center_y = 0;
  double turn_deg = 0;
  double edge_px = 2;
  double leakage = 0.01;

  void visit(SettingsVisitor& v) {
    v.choice("shutter", shutter, {"open", "rectangle", "octagon", "circle"}, "Shape of the collimator's opening");
    v.number("width", width, 0.05, 2, "Width of the open field, relative to the detector");
    v.number("height", height, 0.05, 2, "Height of the open field, relative to the detector");
    v.number("centre_x", center_x, -0.5, 0.5,
             "Centre of the open field, from the detector's centre, relative to its width");
    v.number("centre_y", center_y, -0.5, 0.5,
             "Centre of the open field, from the detector's centre, relative to its height");
    v.number("turn_deg", turn_deg, -180, 180, "Turn of the open field, clockwise in the image");
    v.number("edge_px", edge_px, 0, 50, "Softness of the open field's edge, a standard deviation");
    v.number("leakage", leakage, 0, 1, "Part of the beam that passes the shutters");
  }
};

/// An image intensifier's distortion. A flat panel has none: both are zero.
///
/// With r the distance from the detector's centre over half its width: out by the factor 1 + pincushion r^2, then
/// turned by s_distortion r^2. Intensifiers have a few per cent and a few degrees at the edge.
struct IntensifierSettings {
  double pincushion = 0;
  double s_distortion_deg = 0;

  void visit(SettingsVisitor& v) {
    v.number("pincushion", pincushion, 0, 0.2, "Pincushion distortion at the image's edge, relative");
    v.number("s_distortion_deg", s_distortion_deg, -10, 10, "S distortion at the image's edge, clockwise in the image");
  }
};

/// How the simulated X-ray looks. The defaults are those of an arteriogram of the liver with iodine on a flat panel: a
/// vessel of 4 mm takes a fifth of the beam, one of 1 mm a twentieth, and a pixel's noise is about one per cent.
struct FluoroscopySettings {
  double contrast_attenuation_per_mm = 0.07;
  double beam_hardening = 1;
  Dose dose = Dose::kPhotons;
  double photons_per_pixel = 2500;
  double electronic_noise_photons = 5;
  double background_strength = 0.08;
  static constexpr double background_structure_mm =
      45;  ///< Size of the largest structures of soft tissue, in the patient [mm].
  double background_level = 27000;
  double end_radius_mm = 0.65;
  int seed = 1;
  int threads = 1;
  DetectorSettings detector;
  AnatomySettings anatomy;
  CollimatorSettings collimator;
  IntensifierSettings intensifier;

  void visit(SettingsVisitor& v) {
    v.number("contrast_attenuation_per_mm", contrast_attenuation_per_mm, 0, 10,
             "Linear attenuation of the contrast agent above that of blood");
    v.number("beam_hardening", beam_hardening, 0, 1,
             "1: the spectrum behind 20 cm of water; 0: one energy, and Beer-Lambert's law");
    v.choice("dose", dose, {"photons", "fluoroscopy", "cine", "subtraction"},
             "Dose of the image: photons_per_pixel, or what is usual for a kind of run");
    v.number("photons_per_pixel", photons_per_pixel, 1, 1e9,
             "With dose photons: expected in a pixel behind average anatomy");
    v.number("electronic_noise_photons", electronic_noise_photons, 0, 1e6,
             "Standard deviation of the detector's own noise");
    v.number("background_strength", background_strength, 0, 2,
             "Standard deviation of soft tissue's log-attenuation over the image");
    v.number("background_level", background_level, 1, 65535, "Grey value behind average anatomy, of 65535");
    v.number("end_radius_mm", end_radius_mm, 0.01, 10, "Radius of vessel ends where the tree knows none");
    v.integer("seed", seed, 0, 2147483647, "Seed of the anatomy and of the noise");
    v.integer("threads", threads, 1, 256, "Threads; the image is the same with any number");
    v.section("detector", [this](SettingsVisitor& s) { detector.visit(s); });
    v.section("anatomy", [this](SettingsVisitor& s) { anatomy.visit(s); });
    v.section("collimator", [this](SettingsVisitor& s) { collimator.visit(s); });
    v.section("intensifier", [this](SettingsVisitor& s) { intensifier.visit(s); });
  }
};

}  // namespace angio::simulation_settings
