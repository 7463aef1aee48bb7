// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/report_html.hpp"

#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "angio/base/errors.hpp"
#include "report_style.hpp"

namespace angio::evaluation::html {
namespace {

std::string base64(const std::vector<unsigned char>& bytes) {
  static const char kLetters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = static_cast<unsigned>(bytes[i]) << 16;
    if (i + 1 < bytes.size()) group |= static_cast<unsigned>(bytes[i + 1]) << 8;
    if (i + 2 < bytes.size()) group |= bytes[i + 2];
    text += kLetters[group >> 18 & 63];
    text += kLetters[group >> 12 & 63];
    text += i + 1 < bytes.size() ? kLetters[group >> 6 & 63] : '=';
    text += i + 2 < bytes.size() ? kLetters[group & 63] : '=';
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
      tagged("title", title) + "\n<style>" + kReportStyle + "</style>\n</head>\n<body>\n<main>\n<header>" +
      tagged("h1", title) + tagged("p", subtitle) + "</header>\n";
  for (const auto& one : sections_html) text += one;
  return text + "</main>\n</body>\n</html>\n";
}

}  // namespace angio::evaluation::html
