// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <map>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "tree_formats.hpp"
#include "trunk_merge.hpp"

// Centrelines as VTK's legacy text, versions 1 to 4 (VTK User's Guide, "Simple Legacy Formats"): POINTS, then the lines
// as CELLS of an UNSTRUCTURED_GRID or LINES of POLYDATA.

namespace angio::io {
namespace {

// The words of a text, wherever its lines break.
class Words {
 public:
  explicit Words(TextLines& lines) : lines_(lines) {}

  // False at the end of the file.
  bool next() {
    while (at_ == words_.size()) {
      if (!lines_.next()) return false;
      splitAtBlanks(lines_.text(), words_);
      at_ = 0;
    }
    word_ = words_[at_++];
    return true;
  }

  std::string_view need(const std::string& what) {
    if (!next()) lines_.need(what);
    return word_;
  }

  int needInteger(const std::string& what, int low, int high) {
    const int value = parseInteger(place(), what, need(what));
    requireBetween(place(), what, value, low, high);
    return value;
  }

  void needWord(const std::string& expected) {
    const std::string found(need(expected));
    if (found != expected) throw InputError(place(), "keyword", found, "must be " + expected);
  }

  std::string_view word() const { return word_; }
  std::string place() const { return lines_.place(); }

 private:
  TextLines& lines_;
  std::vector<std::string_view> words_;
  std::size_t at_ = 0;
  std::string_view word_;
};

struct VtkLine {
  std::string place;
  std::vector<int> points;
};

struct VtkLines {
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<VtkLine> lines;

  Position at(int point) const { return positionOf(points_mm[point]); }
};

// The four lines before the points; gives the keyword that the lines stand under.
std::string readVtkHeader(TextLines& lines) {
  const auto need = [&](const std::string& what) {
    lines.need(what);
    return std::string(trimmed(lines.text()));
  };
  const std::string first = need("version");
  const std::string before = "# vtk DataFile Version ";
  if (first.rfind(before, 0) != 0)
    throw InputError(lines.place(), "first line", first.substr(0, 40), "must begin " + before);
  requireBetween(lines.place(), "version", parseNumber(lines.place(), "version", first.substr(before.size())), 1, 4.99);
  need("title");
  const std::string coding = need("coding");
  if (coding != "ASCII") throw InputError(lines.place(), "coding", coding.substr(0, 40), "must be ASCII");
  const std::string data = need("dataset");
  if (data == "DATASET UNSTRUCTURED_GRID") return "CELLS";
  if (data == "DATASET POLYDATA") return "LINES";
  throw InputError(lines.place(), "dataset", data.substr(0, 60),
                   "must be DATASET UNSTRUCTURED_GRID or DATASET POLYDATA");
}

void readVtkPoints(Words& words, VtkLines& result) {
  words.needWord("POINTS");
  const int count = words.needInteger("points", 2, kMaxPoints);
  words.need("type");
  static const char* const kAxis[3] = {"x_mm", "y_mm", "z_mm"};
  for (int i = 0; i < count; ++i) {  // Nothing is reserved: the count may lie.
    Eigen::Vector3d point_mm;
    for (int k = 0; k < 3; ++k) {
      const std::string_view word = words.need(kAxis[k]);
      point_mm[k] = requireBetween(words.place(), kAxis[k], parseNumber(words.place(), kAxis[k], word), -1e4, 1e4);
    }
    result.points_mm.push_back(point_mm);
  }
}

void requireOnce(const VtkLine& line) {
  std::vector<int> sorted = line.points;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice == sorted.end()) return;
  throw InputError(line.place, "point", std::to_string(*twice), "must not be named twice by one line");
}

void readLines(Words& words, const std::string& keyword, VtkLines& result) {
  words.needWord(keyword);
  const int count = words.needInteger("lines", 1, kMaxVtkLines);
  int left = words.needInteger("size", 1, kMaxPoints + kMaxVtkLines);
  const int last = static_cast<int>(result.points_mm.size()) - 1;
  for (int i = 0; i < count; ++i) {
    const int length = words.needInteger("points of a line", 2, kMaxPoints);
    left -= length + 1;
    if (left < 0) throw InputError(words.place(), "size", "", "the lines hold more than it says");
    VtkLine line{words.place(), {}};
    for (int k = 0; k < length; ++k) line.points.push_back(words.needInteger("point", 0, last));
    requireOnce(line);
    result.lines.push_back(std::move(line));
  }
  if (left > 0) throw InputError(words.place(), "size", "", "the lines hold less than it says");
  if (keyword != "CELLS") return;
  words.needWord("CELL_TYPES");
  words.needInteger("cells", count, count);
  for (int i = 0; i < count; ++i) words.needInteger("type: 3 is a line, 4 a polyline", 3, 4);
}

// Centrelines have been published whose lines all end one point early: their last point follows in the list and is on
// no line. Any other point that no line names is a defect.
void requireAllOnLines(const std::string& path, VtkLines& file) {
  std::vector<char> named(file.points_mm.size(), 0);
  for (const VtkLine& line : file.lines) {
    for (const int point : line.points) named[point] = 1;
  }
  for (VtkLine& line : file.lines) {
    const int last = line.points.back();
    const auto next = static_cast<std::size_t>(last) + 1;
    if (line.points[line.points.size() - 2] != last - 1 || next == named.size() || named[next]) continue;
    line.points.push_back(last + 1);
    named[next] = 1;
  }
  const auto lost = std::find(named.begin(), named.end(), 0);
  if (lost != named.end()) throw InputError(path, "point", std::to_string(lost - named.begin()), "is on no line");
}

// Lines in any order and direction, each grown onto those before it; the first line begins at the inlet.
class LineGrowth {
 public:
  explicit LineGrowth(VtkLines& file) : file_(file) {
    for (int i = 0; i < static_cast<int>(file.lines.size()); ++i) {
      const auto& points = file.lines[i].points;
      lines_ending_at_[file.at(points.front())].push_back(i);
      lines_ending_at_[file.at(points.back())].push_back(i);
      waiting_.insert(i);
    }
  }

  TrunkMerge grown() {
    while (!waiting_.empty()) {
      const int next = touching_.empty() ? *waiting_.begin() : *touching_.begin();
      touching_.erase(next);
      waiting_.erase(next);
      add(file_.lines[next]);
    }
    return std::move(tree_);
  }

 private:
  void add(VtkLine& line) {
    const bool ends_on_tree = on_tree_.count(file_.at(line.points.back())) > 0;
    if (ends_on_tree && on_tree_.count(file_.at(line.points.front())) > 0) {
      throw InputError(line.place, "line", "", "the tree must not have a loop: both ends are on lines already");
    }
    if (ends_on_tree) std::reverse(line.points.begin(), line.points.end());
    std::vector<Eigen::Vector3d> points_mm;
    for (const int point : line.points) {
      points_mm.push_back(file_.points_mm[point]);
      on_tree_.insert(file_.at(point));
      const auto here = lines_ending_at_.find(file_.at(point));
      if (here == lines_ending_at_.end()) continue;
      for (const int i : here->second) {
        if (waiting_.count(i) > 0) touching_.insert(i);
      }
      lines_ending_at_.erase(here);
    }
    tree_.addLine(points_mm, std::vector<std::optional<double>>(points_mm.size()));
  }

  VtkLines& file_;
  std::map<Position, std::vector<int>> lines_ending_at_;
  std::set<int> waiting_, touching_;  // In the order of the file.
  std::set<Position> on_tree_;
  TrunkMerge tree_;
};

}  // namespace

VesselTree readVtkTree(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxTextFile);
  TextLines lines(path, content);
  const std::string keyword = readVtkHeader(lines);
  Words words(lines);
  VtkLines file;
  readVtkPoints(words, file);
  readLines(words, keyword, file);
  // What may follow are attributes.
  if (words.next() && words.word() != "POINT_DATA" && words.word() != "CELL_DATA" && words.word() != "METADATA") {
    throw InputError(words.place(), "keyword", std::string(words.word()), "must be POINT_DATA, CELL_DATA or the end");
  }
  requireAllOnLines(path, file);
  return treeOfRows(path, LineGrowth(file).grown().rows());
}

}  // namespace angio::io
