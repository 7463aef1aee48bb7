// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/evaluation/namespace.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/results/statistics.hpp"

namespace angio::evaluation {

/// Pieces of one self-contained HTML page: no script, no reference to anything outside, light or dark as the reader's
/// system is. Each function returns HTML; texts are escaped, HTML arguments are named so.
namespace html {

/// A plot with its title, legend (when there is more than one name) and a sentence below.
std::string figure(const std::string& title, const Plot& plot, const std::string& note = "");

/// A picture, embedded as PNG. Throws InputError when it is empty or cannot be encoded.
std::string picture(const cv::Mat& image, const std::string& caption);

/// Figures and pictures beside each other, as many as fit; `narrow` ones take less room.
std::string grid(const std::vector<std::string>& items_html, bool narrow = false);

/// The first row is the head, the first column names the rows; numbers stand to the right.
std::string table(const std::vector<std::vector<std::string>>& rows);

/// A Markdown table ("| a | b |" lines; other lines become paragraphs) as this project's programs print it.
std::string fromMarkdown(const std::string& markdown);

/// A card with one large figure, its name and small lines below. `colour` as of a series.
std::string card(const std::string& name, const std::string& figure, const std::vector<std::string>& lines, int color);

/// A paragraph.
std::string paragraph(const std::string& text);

/// Nested settings as lines that fold away.
std::string details(const std::string& title, const Json& values);

std::string section(const std::string& title, const std::string& body_html);

/// The whole page.
std::string page(const std::string& title, const std::string& subtitle, const std::vector<std::string>& sections_html);

}  // namespace html
}  // namespace angio::evaluation
