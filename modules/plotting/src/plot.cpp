// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/plotting/plot.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"
#include "label_places.hpp"
#include "plot_canvas.hpp"
#include "plot_scale.hpp"

namespace angio::plotting {
namespace {

constexpr double kLeft_px = 64, kRight_px = 16, kTop_px = 34, kBottom_px = 50, kTitle_px = 20;
constexpr double kDot_px = 3.4, kMark_px = 3, kBarWidth = 0.72, kLabel_px = 14;
constexpr std::size_t kMaxMarks = 24;  // A line of more points has no marks on them.

class Drawing {
 public:
  Drawing(PlotCanvas& canvas, const Plot& plot, const cv::Rect2d& frame)
      : canvas_(canvas), plot_(plot), frame_(frame), x_(scaleOf(plot, false)), y_(scaleOf(plot, true)) {
    x_.begin = frame.x, x_.end = frame.br().x;
    y_.begin = frame.br().y, y_.end = frame.y;
    if (!plot.equal_scale) return;
    const double per_px = std::max((x_.high - x_.low) / frame.width, (y_.high - y_.low) / frame.height);
    for (const auto& [scale, length_px] : {std::pair(&x_, frame.width), std::pair(&y_, frame.height)}) {
      const double middle = 0.5 * (scale->low + scale->high), half = 0.5 * length_px * per_px;
      scale->low = middle - half, scale->high = middle + half;
    }
  }

  void draw() {
    if (!plot_.ground.empty()) canvas_.ground(plot_.ground, frame_);
    drawCounts();
    if (!plot_.bare) drawAxes();
    drawWords();
    for (const PlotGuide& g : plot_.guides) {
      const double at = g.upright ? x_.at(g.at) : y_.at(g.at), right = frame_.br().x;
      canvas_.line(g.upright ? Points{{at, frame_.y}, {at, frame_.br().y}} : Points{{frame_.x, at}, {right, at}},
                   {"guide"});
      canvas_.text(g.upright ? cv::Point2d(at + 5, frame_.y + 10) : cv::Point2d(right, at + 13),
                   g.upright ? Anchor::kStart : Anchor::kEnd, g.label, {"note"});
    }
    for (const PlotSeries& s : plot_.series) drawBand(s);
    for (const PlotSeries& s : plot_.series) {
      if (s.kind == PlotSeries::Kind::kBars) {
        drawBars(s);
      } else {
        if (s.kind != PlotSeries::Kind::kDots) drawLine(s);
        const bool marked = s.marked && s.kind == PlotSeries::Kind::kLine && !s.dashed && s.x.size() <= kMaxMarks;
        if (marked || s.kind == PlotSeries::Kind::kDots) drawDots(s, marked ? kMark_px : kDot_px);
      }
    }
    for (const PlotText& t : plot_.texts) {
      canvas_.text(at(t.x, t.y) + cv::Point2d(t.shift_px), Anchor::kStart, t.words, {"note", t.color});
    }
    drawLabels();
  }

 private:
  using Points = PlotCanvas::Points;
  using Anchor = PlotCanvas::Anchor;

  cv::Point2d at(double x, double y) const { return {x_.at(x), y_.at(y)}; }

  Points box(double left, double right, double top, double bottom) const {
    return {{left, top}, {right, top}, {right, bottom}, {left, bottom}};
  }

  void drawAxes() {
    const double left = frame_.x, right = frame_.br().x, bottom = frame_.br().y;
    for (const auto& [value, words] : ticksOf(plot_.y, y_, 5)) {
      canvas_.line({{left, y_.at(value)}, {right, y_.at(value)}}, {"rule"});
      canvas_.text({left - 8, y_.at(value) + 4}, Anchor::kEnd, words, {"axis"});
    }
    double clear = -1e9;  // The next words may begin here.
    for (const auto& [value, words] : ticksOf(plot_.x, x_, 8)) {
      const double x = x_.at(value), half = 0.5 * canvas_.widthOf(words);
      canvas_.line({{x, frame_.y}, {x, bottom}}, {"rule"});
      canvas_.line({{x, bottom}, {x, bottom + 4}}, {"tick"});
      if (x - half < clear) continue;
      clear = x + half + 6;
      canvas_.text({x, bottom + 18}, Anchor::kMiddle, words, {"axis"});
    }
    canvas_.line({{left, bottom}, {right, bottom}}, {"tick"});
  }

  void drawWords() {
    const double left = frame_.x, right = frame_.br().x, bottom = frame_.br().y;
    const cv::Point2d middle = 0.5 * (frame_.tl() + frame_.br());
    canvas_.text({middle.x, bottom + 38}, Anchor::kMiddle, plot_.x.label, {"label"});
    canvas_.text({left - 44, frame_.y - 12}, Anchor::kStart, plot_.y.label, {"label"});
    canvas_.text({left - 44, frame_.y - 14 - kTitle_px}, Anchor::kStart, plot_.title, {"title"});
    canvas_.text({left + 4, middle.y + 5}, Anchor::kStart, plot_.sides.left, {"title"});
    canvas_.text({right - 4, middle.y + 5}, Anchor::kEnd, plot_.sides.right, {"title"});
    canvas_.text({middle.x, frame_.y + 14}, Anchor::kMiddle, plot_.sides.top, {"title"});
    canvas_.text({middle.x, bottom - 6}, Anchor::kMiddle, plot_.sides.bottom, {"title"});
  }

  void drawLabels() {
    if (plot_.labels.empty()) return;
    std::vector<WantedLabel> wanted;
    for (const PlotLabel& label : plot_.labels) {
      WantedLabel one{{}, {canvas_.widthOf(label.words) + 4, kLabel_px}};
      for (const auto& [x, y] : label.places) one.places.push_back(at(x, y));
      wanted.push_back(std::move(one));
    }
    std::vector<Points> lines;
    for (const PlotSeries& s : plot_.series) {
      if (s.kind == PlotSeries::Kind::kDots) {
        forEachShown(s, [&](std::size_t i) {
          const cv::Point2d p = at(s.x[i], s.y[i]), half(kDot_px, 0);
          lines.push_back({p - half, p + half});
        });
      }
      if (s.kind != PlotSeries::Kind::kLine && s.kind != PlotSeries::Kind::kSteps) continue;
      lines.emplace_back();
      forEachShown(s, [&](std::size_t i) { lines.back().push_back(at(s.x[i], s.y[i])); });
    }
    const std::vector<PlacedLabel> placed = placeLabels(wanted, lines, frame_);
    for (std::size_t i = 0; i < placed.size(); ++i) {
      if (!placed[i].leader) continue;
      canvas_.line({placed[i].leader->first, placed[i].leader->second}, {"lead", plot_.labels[i].color});
    }
    for (std::size_t i = 0; i < placed.size(); ++i) {
      const cv::Point2d lower_left(placed[i].box.x + 2, placed[i].box.br().y - 3);
      canvas_.text(lower_left, Anchor::kStart, plot_.labels[i].words, {"name", plot_.labels[i].color});
    }
  }

  void drawCounts() {
    double highest = 0, nearest = x_.high - x_.low;
    for (std::size_t i = 0; i < plot_.counts.size(); ++i) {
      highest = std::max(highest, plot_.counts[i].second);
      if (i > 0) nearest = std::min(nearest, plot_.counts[i].first - plot_.counts[i - 1].first);
    }
    for (const auto& [value, height] : plot_.counts) {
      if (!(height > 0)) continue;
      const double left = std::max(frame_.x, x_.at(value - 0.5 * nearest) + 1),
                   right = x_.at(value + 0.5 * nearest) - 1;
      const double top = frame_.br().y - 0.22 * frame_.height * height / highest;
      canvas_.area(box(left, std::max(left + 1, right), top, frame_.br().y), {"count"});
    }
  }

  void drawBand(const PlotSeries& s) {
    if (s.low.size() != s.x.size() || s.high.size() != s.x.size() || s.x.size() < 2) return;
    Points points;
    for (std::size_t i = 0; i < s.x.size(); ++i) points.push_back(at(s.x[i], s.high[i]));
    for (std::size_t i = s.x.size(); i-- > 0;) points.push_back(at(s.x[i], s.low[i]));
    canvas_.area(points, {"band", s.color});
  }

  // The points that can be shown, with their places in the series.
  template <typename Function>
  void forEachShown(const PlotSeries& s, const Function& function) const {
    for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
      if (x_.shows(s.x[i]) && y_.shows(s.y[i])) function(i);
    }
  }

  void drawBars(const PlotSeries& s) {
    forEachShown(s, [&](std::size_t i) {
      const double left = x_.at(s.x[i] - 0.5 * kBarWidth), right = x_.at(s.x[i] + 0.5 * kBarWidth);
      canvas_.area(box(left, right, y_.at(s.y[i]), y_.at(0)), {"fill", s.color});
    });
  }

  void drawDots(const PlotSeries& s, double usual_px) {
    forEachShown(s, [&](std::size_t i) {
      const bool ring = i < s.hollow.size() && s.hollow[i];
      canvas_.circle(at(s.x[i], s.y[i]), i < s.radii_px.size() ? s.radii_px[i] : usual_px,
                     {ring ? "ring" : "dot", s.color});
    });
  }

  void drawLine(const PlotSeries& s) {
    Points path;
    std::size_t next = 0;  // Of the point that would continue the path.
    const auto finish = [&] {
      if (!path.empty()) canvas_.line(path, {s.dashed ? "dashed" : "line", s.color});
      path.clear();
    };
    forEachShown(s, [&](std::size_t i) {
      if (i != next) finish();
      const cv::Point2d p = at(s.x[i], s.y[i]);
      if (!path.empty() && s.kind == PlotSeries::Kind::kSteps) path.emplace_back(p.x, path.back().y);
      path.push_back(p);
      next = i + 1;
    });
    finish();
  }

  PlotCanvas& canvas_;
  const Plot& plot_;
  cv::Rect2d frame_;
  Scale x_, y_;
};

cv::Rect2d frameOf(const Plot& plot, double width_px, double height_px, double right_px) {
  const double top = kTop_px + (plot.title.empty() ? 0 : kTitle_px), bottom = plot.x.label.empty() ? 30 : kBottom_px;
  return {kLeft_px, top, width_px - kLeft_px - right_px, height_px - top - bottom};
}

}  // namespace

double roundedDown(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  return value >= 5 * decade ? 5 * decade : value >= 2 * decade ? 2 * decade : decade;
}

std::string svgPlot(const Plot& plot, int width_px, int height_px) {
  SvgCanvas canvas;
  Plot untitled = plot;
  untitled.title.clear();
  Drawing(canvas, untitled, frameOf(untitled, width_px, height_px, kRight_px)).draw();
  return formatted("<svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"", width_px, height_px) +
         htmlEscaped(plot.y.label + " by " + plot.x.label) + "\">\n" + canvas.svg() + "</svg>\n";
}

std::string svgPlotStyle() {
  return R"css(svg text { fill: var(--soft); font-variant-numeric: tabular-nums; }
svg text.label { fill: var(--ink); }
svg text.note { font-size: 11px; }
svg polyline { fill: none; }
svg .rule { stroke: var(--rule); stroke-width: 1; }
svg .tick { stroke: var(--soft); stroke-width: 1; }
svg .guide { stroke: var(--guide); stroke-width: 1; stroke-dasharray: 3 4; }
svg .lead { stroke: currentColor; stroke-width: 1; }
svg .count { fill: var(--bar); }
svg .fill { fill: currentColor; }
svg .line { stroke: currentColor; stroke-width: 2.2; stroke-linejoin: round; stroke-linecap: round; }
svg .dashed { stroke: currentColor; stroke-width: 1.4; stroke-dasharray: 5 4; opacity: 0.85; }
svg .band { fill: currentColor; opacity: 0.13; }
svg .dot { fill: currentColor; stroke: var(--paper); stroke-width: 0.8; }
svg .ring { fill: none; stroke: currentColor; stroke-width: 1.3; }
.c0 { color: var(--c0); } .c1 { color: var(--c1); } .c2 { color: var(--c2); }
.c3 { color: var(--c3); } .c4 { color: var(--c4); } .c5 { color: var(--c5); }
)css";
}

std::string svgPlotFile(const std::vector<Plot>& plots, int width_px, int height_px) {
  // Not every reader of SVG files knows variables.
  std::string style = svgPlotStyle();
  const auto set = [&style](const std::string& variable, const cv::Scalar& bgr) {
    const std::string name = "var(--" + variable + ")";
    const std::string color = formatted("#%02x%02x%02x", cvRound(bgr[2]), cvRound(bgr[1]), cvRound(bgr[0]));
    for (auto found = style.find(name); found != std::string::npos; found = style.find(name)) {
      style.replace(found, name.size(), color);
    }
  };
  for (int c = 0; c < kPlotColors; ++c) set("c" + std::to_string(c), plotColor(c));
  for (const char* ink : {"ink", "soft"}) set(ink, plotColor(kInkColor));
  for (const char* faint : {"rule", "bar", "guide"}) set(faint, cv::Scalar::all(220));
  set("paper", cv::Scalar::all(255));
  for (int c = 0; c < kPlotColors; ++c) {
    style += formatted("svg text.name.c%d { fill: var(--name) }\n", c);
    set("name", kNameShade * plotColor(c));
  }
  style +=
      "svg { font: 12px sans-serif; }\nsvg text.title { font-size: 14px; font-weight: bold; }\n"
      "svg text.name { font-weight: bold; paint-order: stroke; stroke: #fff; stroke-width: 3px; "
      "}\n";
  const int total_px = width_px * static_cast<int>(plots.size());
  std::string svg =
      formatted("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" viewBox=\"0 0 %d %d\">\n",
                total_px, height_px, total_px, height_px);
  svg += "<style>\n" + style + "</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n";
  for (std::size_t i = 0; i < plots.size(); ++i) {
    SvgCanvas canvas;
    Drawing(canvas, plots[i], frameOf(plots[i], width_px, height_px, kRight_px)).draw();
    svg += formatted("<g transform=\"translate(%d 0)\">\n", static_cast<int>(i) * width_px) + canvas.svg() + "</g>\n";
  }
  return svg + "</svg>\n";
}

cv::Mat drawPlots(const std::vector<Plot>& plots, int width_px, int height_px) {
  cv::Mat picture(height_px * static_cast<int>(plots.size()), width_px, CV_8UC3, cv::Scalar::all(255));
  double right_px = kRight_px;  // The widest legend.
  for (const Plot& plot : plots) {
    for (const PlotSeries& s : plot.series) {
      if (!s.name.empty()) right_px = std::max(right_px, PictureCanvas(picture, {}).widthOf(s.name) + 48);
    }
  }
  for (std::size_t i = 0; i < plots.size(); ++i) {
    cv::Mat part = picture.rowRange(static_cast<int>(i) * height_px, static_cast<int>(i + 1) * height_px);
    const cv::Rect2d frame = frameOf(plots[i], width_px, height_px, right_px);
    PictureCanvas canvas(part, frame);
    Drawing(canvas, plots[i], frame).draw();
    double line = frame.y + 10;
    for (const PlotSeries& s : plots[i].series) {
      if (s.name.empty()) continue;
      canvas.area({{frame.br().x + 12, line - 6},
                   {frame.br().x + 32, line - 6},
                   {frame.br().x + 32, line - 2},
                   {frame.br().x + 12, line - 2}},
                  {"fill", s.color});
      canvas.text({frame.br().x + 38, line}, PlotCanvas::Anchor::kStart, s.name, {"label"});
      line += 20;
    }
  }
  return picture;
}

}  // namespace angio::plotting
