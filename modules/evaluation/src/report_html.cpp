// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/report_html.hpp"

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "angio/base/errors.hpp"

namespace angio::evaluation::html {
namespace {

// How a report looks. Series colours after Okabe and Ito, told apart by most colour-blind readers; lighter on dark.
constexpr const char* kReportStyle = R"css(
:root {
  --ground: #fbfaf8; --paper: #ffffff; --ink: #22262b; --soft: #6a7078; --rule: #e3e1dc;
  --guide: #9a9fa6; --bar: #eceae5;
  --c0: #0072b2; --c1: #d55e00; --c2: #009e73; --c3: #b0578d; --c4: #b97f00; --c5: #3d9bd1;
}
@media (prefers-color-scheme: dark) {
  :root {
    --ground: #16181b; --paper: #1d2024; --ink: #dfe2e6; --soft: #989fa8; --rule: #31353b;
    --guide: #6d747d; --bar: #2a2e33;
    --c0: #5aaee6; --c1: #ff8f4d; --c2: #3fc79b; --c3: #e29cc8; --c4: #efb73e; --c5: #9ad6f7;
  }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 56px 32px 96px; }
header { border-bottom: 1px solid var(--rule); padding-bottom: 20px; }
h1 { font-size: 30px; font-weight: 600; letter-spacing: -0.01em; margin: 0 0 6px; line-height: 1.25; }
header p { margin: 0; color: var(--soft); max-width: 75ch; }
h2 { font-size: 20px; font-weight: 600; margin: 52px 0 14px; }
h3 { font-size: 15px; font-weight: 600; margin: 0 0 4px; }
p { margin: 8px 0 14px; max-width: 80ch; }
section > p { color: var(--soft); }
.grid { display: grid; grid-template-columns: repeat(auto-fill, minmax(430px, 1fr)); gap: 20px; }
.grid.narrow { grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); }
.grid + h3, .grid + .grid { margin-top: 20px; }
figure { margin: 0; padding: 18px 18px 12px; background: var(--paper); border: 1px solid var(--rule);
  border-radius: 10px; }
figure img { width: 100%; display: block; border-radius: 6px; }
figcaption { color: var(--soft); font-size: 13.5px; line-height: 1.45; margin-top: 8px; }
svg { width: 100%; height: auto; display: block; font-size: 12px; }
)css";

// Behind the rules of its plots.
constexpr const char* kReportStyleEnd =
    R"css(.legend { list-style: none; display: flex; flex-wrap: wrap; gap: 2px 16px; margin: 0; padding: 0; font-size: 13.5px;
  color: var(--soft); }
i { display: inline-block; width: 10px; height: 10px; border-radius: 5px; background: currentColor; margin-right: 7px; }
.card { background: var(--paper); border: 1px solid var(--rule); border-radius: 10px; padding: 16px 20px; }
.card span { display: block; color: var(--soft); font-size: 14px; }
.card .name { color: var(--ink); font-weight: 600; font-size: 15px; }
.card strong { display: block; font-size: 34px; font-weight: 600; letter-spacing: -0.02em; line-height: 1.25;
  font-variant-numeric: tabular-nums; }
.scroll { overflow-x: auto; margin: 10px 0 18px; }
table { border-collapse: collapse; font-size: 14px; font-variant-numeric: tabular-nums; width: 100%; }
th, td { text-align: left; padding: 7px 12px 7px 0; border-bottom: 1px solid var(--rule); font-weight: 400;
  vertical-align: baseline; }
thead th { color: var(--soft); font-size: 13px; }
tbody th { font-weight: 600; }
.n { text-align: right; white-space: nowrap; }
details { margin: 10px 0; }
summary { cursor: pointer; color: var(--soft); }
details table { width: auto; }
details thead { display: none; }
details tbody th { font-weight: 400; color: var(--soft); padding-right: 32px; }
details td { white-space: normal; text-align: left; }
@media (max-width: 560px) { main { padding: 28px 16px 64px; } .grid { grid-template-columns: 1fr; } }
@media print { figure, .card { break-inside: avoid; } }
)css";

std::string base64(const std::vector<unsigned char>& bytes) {
  static const char kLetters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = i; k < i + 3; ++k) group = group << 8 | (k < bytes.size() ? bytes[k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += i + k <= bytes.size() ? kLetters[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string tagged(const std::string& tag, const std::string& text) {
  return "<" + tag + ">" + htmlEscaped(text) + "</" + tag.substr(0, tag.find(' ')) + ">";
}

bool isNumber(const std::string& text) {
  return !text.empty() && (text.find_first_of("0123456789") <= 1 || text == "-");
}

std::vector<std::string> cellsOf(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream parts(line.substr(1));
  for (std::string cell; std::getline(parts, cell, '|');) {
    const auto begin = cell.find_first_not_of(' '), end = cell.find_last_not_of(' ');
    cells.push_back(begin == std::string::npos ? "" : cell.substr(begin, end - begin + 1));
  }
  return cells;
}

std::string legend(const std::vector<PlotSeries>& series) {
  std::string items;
  std::vector<std::string> named;
  for (const auto& s : series) {
    if (s.name.empty() || std::find(named.begin(), named.end(), s.name) != named.end()) continue;
    named.push_back(s.name);
    items += "<li><i class=\"c" + std::to_string(s.color % kPlotColors) + "\"></i>" + htmlEscaped(s.name) + "</li>";
  }
  return named.size() < 2 ? "" : "<ul class=\"legend\">" + items + "</ul>";
}

// One line per value, in two columns: the path to it and the value.
void flatten(const Json& value, const std::string& path, std::vector<std::vector<std::string>>& rows) {
  if (value.is_object()) {
    for (const auto& [key, inner] : value.items()) flatten(inner, path.empty() ? key : path + "." + key, rows);
  } else {
    rows.push_back({path, value.is_string() ? value.get<std::string>() : value.dump()});
  }
}

}  // namespace

std::string figure(const std::string& title, const Plot& plot, const std::string& note) {
  return "<figure><h3>" + htmlEscaped(title) + "</h3>" + legend(plot.series) + svgPlot(plot) +
         (note.empty() ? "" : tagged("figcaption", note)) + "</figure>\n";
}

std::string picture(const cv::Mat& image, const std::string& caption) {
  std::vector<unsigned char> png;
  if (image.empty() || !cv::imencode(".png", image, png)) throw InputError("report", "picture", "", "must be an image");
  return "<figure><img alt=\"" + htmlEscaped(caption) + "\" src=\"data:image/png;base64," + base64(png) + "\">" +
         tagged("figcaption", caption) + "</figure>\n";
}

std::string grid(const std::vector<std::string>& items_html, bool narrow) {
  std::string all;
  for (const auto& item : items_html) all += item;
  return std::string("<div class=\"grid") + (narrow ? " narrow" : "") + "\">\n" + all + "</div>\n";
}

std::string table(const std::vector<std::vector<std::string>>& rows) {
  std::string text = "<div class=\"scroll\"><table>\n";
  for (std::size_t r = 0; r < rows.size(); ++r) {
    text += r == 0 ? "<thead><tr>" : "<tr>";
    for (std::size_t c = 0; c < rows[r].size(); ++c) {
      const bool right =
          c > 0 && (r == 0 ? rows.size() > 1 && c < rows[1].size() && isNumber(rows[1][c]) : isNumber(rows[r][c]));
      const std::string tag = std::string(r == 0 || c == 0 ? "th" : "td") + (right ? " class=\"n\"" : "");
      text += tagged(tag, rows[r][c]);
    }
    text += r == 0 ? "</tr></thead>\n<tbody>\n" : "</tr>\n";
  }
  return text + "</tbody></table></div>\n";
}

std::string fromMarkdown(const std::string& markdown) {
  std::string text;
  std::vector<std::vector<std::string>> rows;
  const auto flush = [&] {
    if (!rows.empty()) text += table(rows);
    rows.clear();
  };
  std::istringstream lines(markdown);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("| ---", 0) == 0) continue;
    if (line.rfind("|", 0) == 0) {
      rows.push_back(cellsOf(line));
      continue;
    }
    flush();
    if (!line.empty()) text += paragraph(line);
  }
  flush();
  return text;
}

std::string card(const std::string& name, const std::string& big, const std::vector<std::string>& lines, int color) {
  std::string text = "<div class=\"card\"><span class=\"name\"><i class=\"c" + std::to_string(color % kPlotColors) +
                     "\"></i>" + htmlEscaped(name) + "</span>" + tagged("strong", big);
  for (const auto& line : lines) text += tagged("span", line);
  return text + "</div>\n";
}

std::string paragraph(const std::string& text) { return tagged("p", text) + "\n"; }

std::string details(const std::string& title, const Json& values) {
  std::vector<std::vector<std::string>> rows = {{"", ""}};
  flatten(values, "", rows);
  return "<details><summary>" + htmlEscaped(title) + "</summary>" + table(rows) + "</details>\n";
}

std::string section(const std::string& title, const std::string& body_html) {
  return "<section>\n" + tagged("h2", title) + "\n" + body_html + "</section>\n";
}

std::string page(const std::string& title, const std::string& subtitle, const std::vector<std::string>& sections_html) {
  std::string text =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n" +
      tagged("title", title) + "\n<style>" + kReportStyle + svgPlotStyle() + kReportStyleEnd +
      "</style>\n</head>\n<body>\n<main>\n<header>" + tagged("h1", title) + tagged("p", subtitle) + "</header>\n";
  for (const auto& one : sections_html) text += one;
  return text + "</main>\n</body>\n</html>\n";
}

}  // namespace angio::evaluation::html
