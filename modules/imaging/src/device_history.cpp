// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/device_history.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "contrast_arrival.hpp"
#include "device_candidates.hpp"

namespace angio::imaging {
namespace {

// Distances are in pixels of an image of this side, as those of the extractor are; smaller images keep theirs.
constexpr double kWorkingImage_px = 704;
// A line that runs along a device within so much may be the device [working px].
constexpr double kAlongDevice_px = 3;
// A line that absorbs so many times what a device does is a vessel that has filled around it; noise and overlap change
// a device's own by a third.
constexpr double kFilled = 1.7;
// A vessel's line lies farther from a device in it, but for the vessel's radius not by more than this [working px].
constexpr double kInVessel_px = 6;
// Shorter branches may be noise's [working px].
constexpr double kMinBranch_px = 25;
// A device that crosses itself ends at its own side, up to so many times in what is found of it; a tree does many
// times.
constexpr int kMaxEndsOfDevices = 3;
// What most of so many points to both sides are, a point is; fewer are no line.
constexpr std::size_t kNeighbors = 7;
// Points of one device are no farther apart [working px].
constexpr double kMaxStep_px = 6;

PlacedLines placed(const std::vector<SeenPoint>& points) {
  PlacedLines placed;
  for (const SeenPoint& point : points) placed.add(point);
  placed.place();
  return placed;
}

// Whether a line is that of a vessel around a device. A wide vessel with little contrast agent is no darker than the
// device in it, but absorbs more per length, which goes with contrast and width.
bool isFilled(const SeenPoint& line, const SeenPoint& device) { return line.absorbed() >= kFilled * device.absorbed(); }

// Which points are a device's, without single ones among others.
void nameAlong(const SeenLines& seen, const std::vector<SeenPoint>& devices, std::vector<CurveKind>& kind) {
  const PlacedLines known = placed(devices);
  std::vector<int> is_device;
  for (const SeenPoint& point : seen.points()) {
    const int near = known.along(point, kAlongDevice_px);
    is_device.push_back(near >= 0 && !isFilled(point, devices[static_cast<std::size_t>(near)]));
  }
  for (const SeenLines::Range& line : seen.lines()) {
    for (std::size_t i = line.begin; i < line.end; ++i) {
      const std::size_t from = std::max(line.begin + kNeighbors, i) - kNeighbors,
                        to = std::min(line.end, i + kNeighbors + 1);
      const auto begin = is_device.begin();
      const auto count =
          std::count(begin + static_cast<std::ptrdiff_t>(from), begin + static_cast<std::ptrdiff_t>(to), 1);
      if (2 * static_cast<std::size_t>(count) > to - from) kind[i] = CurveKind::kDevice;
    }
  }
}

void cutWhereKindChanges(Centerline2d& lines) {
  int branch = -1;
  for (int i = 0, before = -1; i < lines.size(); ++i) {
    if (i == 0 || lines.branch[i] != before || lines.kind[i] != lines.kind[i - 1]) ++branch;
    before = std::exchange(lines.branch[i], branch);
  }
}

// The parts of devices in vessels that have filled around them, a line each.
std::vector<std::vector<SeenPoint>> withinVessels(const SeenLines& seen, const std::vector<SeenPoint>& devices,
                                                  const std::vector<CurveKind>& kind) {
  std::vector<SeenPoint> told;
  for (std::size_t i = 0; i < kind.size(); ++i) {
    if (kind[i] == CurveKind::kDevice) told.push_back(seen.points()[i]);
  }
  const PlacedLines named = placed(told);
  const auto isWithin = [&](const SeenPoint& device) {
    const int near = seen.along(device, kInVessel_px);
    if (near < 0 || named.along(device, kAlongDevice_px) >= 0) return false;
    const SeenPoint& vessel = seen.points()[static_cast<std::size_t>(near)];
    return isFilled(vessel, device) && (vessel.at - device.at).norm() < vessel.radius + kAlongDevice_px;
  };
  std::vector<std::vector<SeenPoint>> parts(1);
  for (const SeenPoint& device : devices) {
    std::vector<SeenPoint>& part = parts.back();
    const bool goes_on =
        part.empty() || (part.back().line == device.line && (part.back().at - device.at).norm() < kMaxStep_px);
    const bool is_within = isWithin(device);
    if ((!goes_on || !is_within) && !part.empty()) parts.emplace_back();
    if (is_within) parts.back().push_back(device);
  }
  const auto isShort = [](const auto& part) { return part.size() < kNeighbors; };
  parts.erase(std::remove_if(parts.begin(), parts.end(), isShort), parts.end());
  return parts;
}

void add(const std::vector<SeenPoint>& part, double px, Centerline2d& lines) {
  const Eigen::Index before = lines.size(), count = before + static_cast<Eigen::Index>(part.size());
  const int branch = lines.branch.empty() ? 0 : lines.branch.back() + 1;
  lines.points_px.conservativeResize(2, count);
  for (auto* values : {&lines.tangent_rad, &lines.radius_px, &lines.std_px, &lines.contrast}) {
    values->conservativeResize(count);
  }
  for (Eigen::Index i = before; i < count; ++i) {
    const SeenPoint& point = part[static_cast<std::size_t>(i - before)];
    lines.points_px.col(i) = px * point.at;
    lines.tangent_rad[i] = undirected(std::atan2(point.direction.y(), point.direction.x()));
    lines.radius_px[i] = px * point.radius;
    lines.std_px[i] = px;  // Followed, not measured: to a working pixel.
    lines.contrast[i] = point.contrast;
    lines.branch.push_back(branch);
    lines.kind.push_back(CurveKind::kDevice);
  }
}

Centerline2d withDevices(const Centerline2d& found, const SeenLines& seen, const std::vector<SeenPoint>& devices,
                         double px) {
  Centerline2d result = found;
  nameAlong(seen, devices, result.kind);
  const auto parts = withinVessels(seen, devices, result.kind);
  cutWhereKindChanges(result);
  for (const auto& part : parts) add(part, px, result);
  return result;
}

// Whether all is known of the lines that naming goes by; nothing at all is.
bool isMeasured(const Centerline2d& found) {
  return found.size() == 0 || (found.ordered() && !found.kind.empty() && found.radius_px.size() > 0 &&
                               found.std_px.size() > 0 && found.contrast.size() > 0);
}

// Pixels of the image in a working pixel.
double workingPixel(double side_px) { return std::max(1.0, side_px / kWorkingImage_px); }

class RunExtractor final : public CenterlineExtractor {
 public:
  explicit RunExtractor(const ExtractorSettings& settings) : extractor_(makeExtractor(settings)) {}

  Centerline2d extract(const cv::Mat& image) override { return named(extractor_->extract(image), image); }
  Centerline2d extract(const cv::Mat& image, const Centerline2d& expected) override {
    return named(extractor_->extract(image, expected), image);
  }

 private:
  Centerline2d named(const Centerline2d& found, const cv::Mat& image) {
    return history_.named(found, std::min(image.cols, image.rows));
  }

  std::unique_ptr<CenterlineExtractor> extractor_;
  DeviceHistory history_;
};

}  // namespace

struct DeviceHistory::Memory {
  ContrastArrival contrast;
  DeviceCandidates candidates;
  bool backwards = false;  // Frames come from the last one on.
};

DeviceHistory::DeviceHistory() : memory_(std::make_unique<Memory>()) {}
DeviceHistory::~DeviceHistory() = default;
DeviceHistory::DeviceHistory(DeviceHistory&&) noexcept = default;
DeviceHistory& DeviceHistory::operator=(DeviceHistory&&) noexcept = default;

bool DeviceHistory::knowsVessels() const { return memory_->contrast.arrived(); }

Centerline2d DeviceHistory::named(const Centerline2d& found, double side_px) {
  if (!isMeasured(found)) return found;
  const double px = workingPixel(side_px), side = side_px / px;
  const SeenLines seen(found, px);
  memory_->candidates.follow(seen);
  if (memory_->candidates.lost()) *memory_ = {{}, {}, memory_->backwards};
  DeviceCandidates& candidates = memory_->candidates;
  const bool knew_vessels = knowsVessels();
  const bool branched = seen.branches(kMinBranch_px) > kMaxEndsOfDevices;
  const ContrastArrival::Frame frame = memory_->contrast.add(seen.amount(), branched, side);
  if (frame == ContrastArrival::Frame::kAnew) candidates.clear();
  if (frame != ContrastArrival::Frame::kFilled) candidates.learn(seen, side);
  if (memory_->backwards && knowsVessels() && !knew_vessels) candidates.dropDarkened(seen);
  return knowsVessels() ? withDevices(found, seen, candidates.steady(), px) : found;
}

std::vector<Centerline2d> DeviceHistory::namedAgain(std::vector<Centerline2d> frames, double side_px) const {
  if (!knowsVessels()) return frames;
  DeviceCandidates candidates = memory_->candidates;
  const double px = workingPixel(side_px);
  for (auto frame = frames.rbegin(); frame != frames.rend(); ++frame) {
    if (!isMeasured(*frame)) continue;
    const SeenLines seen(*frame, px);
    candidates.follow(seen);
    *frame = withDevices(*frame, seen, candidates.steady(), px);
  }
  return frames;
}

std::vector<Centerline2d> DeviceHistory::namedFromEnd(std::vector<Centerline2d> frames, double side_px) {
  DeviceHistory history;
  history.memory_->backwards = true;
  std::size_t waiting = frames.size();  // The end of those that are not named yet.
  for (std::size_t k = frames.size(); k-- > 0;) {
    frames[k] = history.named(frames[k], side_px);
    if (!history.knowsVessels()) continue;
    const auto first = frames.begin() + static_cast<std::ptrdiff_t>(k) + 1,
               last = frames.begin() + static_cast<std::ptrdiff_t>(waiting);
    std::vector<Centerline2d> later(std::make_reverse_iterator(last), std::make_reverse_iterator(first));
    later = history.namedAgain(std::move(later), side_px);
    std::move(later.rbegin(), later.rend(), first);
    waiting = k;
  }
  return frames;
}

std::unique_ptr<CenterlineExtractor> makeRunExtractor(const ExtractorSettings& settings) {
  return std::make_unique<RunExtractor>(settings);
}

}  // namespace angio::imaging
