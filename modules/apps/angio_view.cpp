// SPDX-License-Identifier: GPL-2.0-or-later
// angio-view: the running loop's overlay, in a window or as a film.
#include <visp3/core/vpImage.h>
#include <visp3/core/vpImageConvert.h>
#include <visp3/gui/vpDisplayX.h>

#include <chrono>
#include <cstdlib>
#include <iostream>

#include "angio/apps/namespace.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/messaging/any_message.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/messaging/bus.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/results/film_writer.hpp"
#include "angio/results/live_overlay.hpp"

namespace angio::apps {
namespace {

struct Options {
  std::string bus = cli::kUsualBus, key_file, tree = exampleDataFile("hepatic-tace/tree.csv"), out, title, calibration;
  double duration_s = 0, film_rate_hz = 15;
  int width_px = 768;
};

// Where pictures go: ViSP's window or a film.
class Screen {
 public:
  explicit Screen(const Options& o) {
    if (!o.out.empty()) {
      film_.emplace(o.out, o.film_rate_hz);
    } else if (!std::getenv("DISPLAY")) {  // ViSP's own message names neither cause nor cure.
      throw std::runtime_error("there is no display: set DISPLAY, or write a film with --out");
    }
  }

  void show(const cv::Mat& picture) {
    if (film_) {
      film_->write(picture);
      return;
    }
    vpImageConvert::convert(picture, image_);
    if (!window_) window_ = open();
    vpDisplay::display(image_);
    vpDisplay::flush(image_);
    if (vpDisplay::getClick(image_, false)) RunTime::end();
  }

  int finish() {
    if (film_) film_->finish();
    return film_ ? film_->pictures() : 0;
  }

 private:
  std::unique_ptr<vpDisplayX> open() {
    try {
      return std::make_unique<vpDisplayX>(image_, 40, 40, "AngioServo (click to end)");
    } catch (const vpException& error) {
      throw std::runtime_error(std::string("no window can be opened: ") + error.getMessage());
    }
  }

  std::optional<FilmWriter> film_;
  vpImage<vpRGBa> image_;  // Before its window, which draws from it.
  std::unique_ptr<vpDisplayX> window_;
};

LiveOverlay overlayOf(const Options& o, const VesselTree& tree) {
  if (o.calibration.empty()) return LiveOverlay(tree, o.width_px);
  const CArmCalibration calibration = readCArmCalibration(o.calibration, tree);
  return LiveOverlay(tree, o.width_px, calibration.carm, calibration.R_patient_lps());
}

class Viewer {
 public:
  Viewer(const Options& o, const VesselTree& tree)
      : title_(o.title), target_model_(tree.centroid()), overlay_(overlayOf(o, tree)), screen_(o) {}

  void hear(const std::string& channel, const std::uint8_t* data, std::size_t size, std::int64_t arrival_us) {
    auto decoded = decodeAny(data, size);
    if (!decoded.value) return;  // angio-spy tells what is wrong with a bus.
    auto scene = feed_.hear(channel, std::move(*decoded.value), arrival_us);
    if (!scene) return;
    scene->title = title_;
    scene->target_model = target_model_;
    newest_ = std::move(scene);
    ++scenes_;
  }

  /// Draws the newest scene, if it was not drawn yet.
  void draw() {
    if (!newest_) return;
    screen_.show(overlay_.draw(*newest_));
    newest_.reset();
    ++drawn_;
  }

  int finish() {
    if (drawn_ == 0) throw std::runtime_error("no X-ray frame has come");
    const int pictures = screen_.finish();
    std::cout << drawn_ << " of " << scenes_ << " frames drawn" << (pictures > 0 ? " and written" : "") << "\n";
    return 0;
  }

 private:
  std::string title_;
  Eigen::Vector3d target_model_;
  LiveFeed feed_;
  LiveOverlay overlay_;
  Screen screen_;
  std::optional<LiveScene> newest_;
  long drawn_ = 0, scenes_ = 0;
};

int viewLog(const std::string& path, const Options& o, const VesselTree& tree) {
  LogReader log(path);
  Viewer viewer(o, tree);
  const RunTime run;
  for (auto event = log.next(); event && !run.over(); event = log.next()) {
    viewer.hear(event->channel, event->bytes.data(), event->bytes.size(), event->time_us);
    viewer.draw();
  }
  return viewer.finish();
}

int viewBus(const Options& o, const VesselTree& tree) {
  const auto bus = withKeyFile(openSharedBus(o.bus), o.key_file,
                               [](const std::string& line) { std::cerr << "angio-view: " << line << "\n"; });
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-view: " << *warning << "\n";
  Viewer viewer(o, tree);
  bus->subscribeAll([&](const std::string& channel, const std::uint8_t* data, std::size_t size) {
    viewer.hear(channel, data, size, monotonic_us());
  });
  const RunTime run(o.duration_s);
  while (!run.over() && !bus->ended()) {
    bus->handle(std::chrono::milliseconds(50));
    viewer.draw();  // Once for all that came: a slow screen drops frames and does not fall behind.
  }
  return viewer.finish();
}

int view(const Options& o) {
  const VesselTree tree = readVesselTree(o.tree);
  const auto log = logFileOf(o.bus);
  return log ? viewLog(*log, o, tree) : viewBus(o, tree);
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Shows the X-ray with the registered tree and the loop's state, from a bus or a log.",
                          "angio-view");
  angio::apps::describeProgram(app, "angio-view --bus 'file://run.lcm?speed=0' --out run.mp4");
  using angio::apps::between;
  angio::apps::Options o;
  app.addOption("--bus", o.bus,
                angio::cli::busHelp("Bus to listen on") + "; file://name.lcm?speed=0 shows each frame of a log");
  app.addOption("--key-file", o.key_file, "Key that the programs on the bus share");
  app.addOption("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.addOption("--calibration", o.calibration,
                "C-arm geometry and T_dsa_cb (.yaml), for the letters at the X-ray's edges; an ideal C-arm without");
  app.addOption("--out", o.out, "Film (.mp4) or numbered pictures (frames/%04d.png) in place of a window");
  app.addOption("--film-rate-hz", o.film_rate_hz, "Pictures of a film a second")->check(between(0.1, 1000));
  app.addOption("--width-px", o.width_px, "Of the picture")->check(angio::cli::wholeBetween(320, 4096));
  app.addOption("--title", o.title, "First line in the picture");
  app.addOption("--duration-s", o.duration_s, "How long; 0: until stopped")->check(between(0, 86400));
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::view(o); });
}
