// SPDX-License-Identifier: GPL-2.0-or-later
// angio-extract-centerline: the vessels and devices of X-ray frames as files, which angio-register and others read.
#include <iostream>
#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/imaging/device_history.hpp"
#include "angio/imaging/subtraction.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/overlay.hpp"
#include "extractor_options.hpp"

namespace angio::apps {
namespace {

struct Options {
  std::string image, out, devices, overlay, extractor, settings, polarity = "dark";
  std::optional<int> frame, mask_frame;
  bool all_frames = false;
};

ExtractorSettings extractorOf(const Options& o) {
  ExtractorSections sections;
  if (!o.settings.empty()) sections = readSettings(o.settings, sections);
  ExtractorSettings chosen = o.extractor.empty() ? sections.chosen() : sections.named(o.extractor);
  if (o.polarity == "bright") std::visit([](auto& s) { s.polarity = Polarity::kBright; }, chosen);
  return chosen;
}

// A file's name for each frame: "%04d" becomes the frame's number.
class NumberedFile {
 public:
  NumberedFile(const char* option, const std::string& path, bool all_frames) : path_(path) {
    static const std::regex kNumber("[^%]*%(0[1-9])?d[^%]*");
    if (path.empty() || !all_frames) return;
    if (!std::regex_match(path, kNumber)) {
      throw InputError(option, "--all-frames", path, "must have the frame's number in its name, as lines/%04d.csv has");
    }
    numbered_ = true;
  }

  std::string of(int frame) const {
    if (!numbered_) return path_;
    const auto begin = path_.find('%'), end = path_.find('d', begin);
    const int digits = end == begin + 1 ? 0 : path_[begin + 2] - '0';
    return path_.substr(0, begin) + formatted("%0*d", digits, frame) + path_.substr(end + 1);
  }

 private:
  std::string path_;
  bool numbered_ = false;
};

struct Files {
  explicit Files(const Options& o)
      : out("--out", o.out, o.all_frames),
        devices("--devices", o.devices, o.all_frames),
        overlay("--overlay", o.overlay, o.all_frames) {}

  NumberedFile out, devices, overlay;
};

struct Counts {
  int vessels = 0, vessel_points = 0, devices = 0, device_points = 0;
};

int branchesOf(const Centerline2d& line) { return line.ordered() ? line.branch.back() + 1 : 0; }

// Writes what a frame shows, where it shows some.
Counts writeFrame(const cv::Mat& image, const Centerline2d& seen, const Files& files, int frame) {
  const Centerline2d vessels = ofKind(seen, CurveKind::kVessel), devices = ofKind(seen, CurveKind::kDevice);
  if (vessels.size() > 0) writeCenterline(files.out.of(frame), vessels);
  const std::string device_file = files.devices.of(frame), overlay_file = files.overlay.of(frame);
  if (!device_file.empty() && devices.size() > 0) writeCenterline(device_file, devices);
  if (!overlay_file.empty()) writeImage(overlay_file, drawCenterline(image, seen));
  return {branchesOf(vessels), vessels.size(), branchesOf(devices), devices.size()};
}

std::string inWords(const Counts& counts) {
  return formatted("%d vessel lines of %d points, %d device lines of %d points", counts.vessels, counts.vessel_points,
                   counts.devices, counts.device_points);
}

int extractOne(const XrayFrames& frames, const Options& o, CenterlineExtractor& extractor) {
  const int frame = o.frame.value_or(0);
  const cv::Mat image = frames.frame(frame);
  const cv::Mat seen_in = o.mask_frame ? subtracted(image, frames.frame(*o.mask_frame)) : image;
  const Counts counts = writeFrame(image, extractor.extract(seen_in), Files(o), frame);
  if (counts.vessels == 0) {
    throw InputError(o.image, "frame", std::to_string(frame),
                     "shows no vessel that can be told from its noise; " + o.out + " is not written");
  }
  std::cout << inWords(counts) << "\n";
  return 0;
}

// Frames from before contrast agent arrived wait for what the run shows then; where it never arrives, for its end.
int extractAll(const XrayFrames& frames, const Options& o, CenterlineExtractor& extractor) {
  const Files files(o);
  const cv::Mat mask = o.mask_frame ? frames.frame(*o.mask_frame) : cv::Mat();
  ProgressBar bar("extracting", frames.count());
  DeviceHistory history;
  std::vector<Centerline2d> waiting;
  int with_vessels = 0, with_devices = 0, next = 0;
  double side_px = 0;
  const auto write = [&](const cv::Mat& image, const Centerline2d& seen) {
    const Counts counts = writeFrame(image, seen, files, next);
    with_vessels += counts.vessels > 0;
    with_devices += counts.devices > 0;
    ++next;
  };
  const auto writeWaiting = [&](const std::vector<Centerline2d>& seen) {
    for (const Centerline2d& one : seen) write(frames.frame(next), one);
    waiting.clear();
  };
  for (int frame = 0; frame < frames.count(); ++frame) {
    const cv::Mat image = frames.frame(frame);
    side_px = std::min(image.cols, image.rows);
    const Centerline2d seen = history.named(extractor.extract(mask.empty() ? image : subtracted(image, mask)), side_px);
    if (history.knowsVessels()) {
      if (!waiting.empty()) writeWaiting(history.namedAgain(waiting, side_px));
      write(image, seen);
    } else {
      waiting.push_back(seen);
    }
    bar.show(frame + 1);
  }
  writeWaiting(next == 0 ? DeviceHistory::namedFromEnd(waiting, side_px) : waiting);
  std::cout << frames.count() << " frames: vessels in " << with_vessels << ", devices in " << with_devices
            << "; a frame without has no file\n";
  return 0;
}

int extractCenterlines(const Options& o) {
  for (const auto& path : {o.out, o.devices}) requireFolderOf(path);
  requireImagePath(o.overlay);
  const auto extractor = makeExtractor(extractorOf(o));
  const XrayFrames frames(o.image);
  return o.all_frames ? extractAll(frames, o, *extractor) : extractOne(frames, o, *extractor);
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Finds the centrelines of vessels and devices in an X-ray image.",
                          "angio-extract-centerline");
  angio::apps::describeProgram(
      app, "angio-extract-centerline run.dcm --frame 12 --out line.csv --devices devices.csv --overlay picture.png");
  angio::apps::Options o;
  app.addOption("image", o.image, "X-ray image (.png, .tif, .jpg) or DICOM run (.dcm)")->required();
  app.addOption("--out", o.out,
                "Vessels (.csv): x_px, y_px, branch, tangent_rad, radius_px, sigma_px (standard deviation across the "
                "line), contrast; what angio-register --centerline reads")
      ->required();
  app.addOption("--devices", o.devices, "Catheters and guidewires, in the same form (.csv)");
  app.addOption("--overlay", o.overlay, "The image with vessels in red and devices in blue (.png, .tif, .jpg)");
  auto* frame = app.addOption("--frame", o.frame, "Frame of a run or of a TIFF, from 0; the first without")
                    ->check(angio::cli::wholeBetween(0, 1000000));
  app.addFlag("--all-frames", o.all_frames,
              "All frames of the file, as a run: what was there before contrast agent came is a device. Names of files "
              "then have a number in them, as lines/%04d.csv")
      ->excludes(frame);
  app.addOption("--mask-frame", o.mask_frame, "Frame of the same file without contrast agent, which is subtracted")
      ->check(angio::cli::wholeBetween(0, 1000000));
  app.addOption("--extractor", o.extractor,
                "How centrelines are found: " + angio::apps::listOfExtractors() +
                    "; the settings' choice (ridge) "
                    "when not given");
  app.addOption("--polarity", o.polarity, "How vessels stand out from the background")
      ->check(angio::cli::oneOf({"dark", "bright"}));
  angio::cli::addSettingsOptions(app, o.settings, "Settings (.yaml), a section for each extractor",
                                 angio::io::settingsInForce<angio::imaging::ExtractorSections>);
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::extractCenterlines(o); });
}
