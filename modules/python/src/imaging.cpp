// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/collimator_opening.hpp"
#include "angio/imaging/device_history.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/imaging/subtraction.hpp"
#include "fields.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

using GuardedExtractor = Guarded<std::unique_ptr<CenterlineExtractor>>;

std::unique_ptr<GuardedExtractor> extractorOf(const std::string& method, const py::object& settings, bool run) {
  ExtractorSections sections;
  setFields(settings, "settings", [&](SettingsVisitor& v) { sections.visit(v); });
  const ExtractorSettings chosen = method.empty() ? sections.chosen() : sections.named(method);
  return std::make_unique<GuardedExtractor>(run ? makeRunExtractor(chosen) : makeExtractor(chosen));
}

}  // namespace

void bindImaging(py::module_& m) {
  py::class_<GuardedExtractor>(m, "CenterlineExtractor", doc("CenterlineExtractor"))
      .def(py::init(&extractorOf),
           "The method by its name, or the settings' own; settings as a dict or a file with the sections of methods. "
           "With `run` for the frames of one run, in their order, of which it remembers what was there before contrast "
           "agent arrived: a device.",
           "method"_a = "", "settings"_a = py::none(), "run"_a = false)
      .def(
          "extract",
          [](GuardedExtractor& extractor, const py::array& image, const std::optional<Centerline2d>& expected) {
            const cv::Mat pixels = imageOf(image, "image");
            return extractor.use(
                [&](auto& e) { return expected ? e->extract(pixels, *expected) : e->extract(pixels); });
          },
          "Ordered branches with tangents and radii [px]; empty when there is no vessel. `image` is height x width of "
          "uint8 or uint16. Vessels may be `expected` [px]: a projected tree whose pose was tracked, in branches. What "
          "the image shows without them is found first. Where that leaves a part of them without a line, one is fitted "
          "to the image there, and kept if a vessel's shadow fits it. A method without use for it, or an `expected` "
          "without branches, finds what it finds without.",
          "image"_a, "expected"_a = py::none());
  m.def(
      "find_open_field",
      [](const py::array& image) {
        const cv::Mat pixels = imageOf(image, "image");
        return rowsOf(unlocked([&] { return findOpenField(pixels).polygon_px; }));
      },
      doc("findOpenField"), "image"_a);
  m.def(
      "subtracted",
      [](const py::array& image, const py::array& mask) {
        const cv::Mat a = imageOf(image, "image"), b = imageOf(mask, "mask");
        return arrayOf(unlocked([&] { return subtracted(a, b); }));
      },
      doc("subtracted"), "image"_a, "mask"_a);
}

}  // namespace angio::python
