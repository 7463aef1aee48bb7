// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// Files of text, tables and trees; larger ones are no centreline but a mistake [bytes].
constexpr std::size_t kMaxTextFile = std::size_t{256} << 20;

/// No tree or centreline has more points: each costs some hundred bytes once it is read.
constexpr int kMaxPoints = 2'000'000;

/// "path:line".
std::string atLine(const std::string& path, int line);

/// Walks over the lines of a text: without line ends (LF or CRLF) and without a byte order mark. Blank lines at the end
/// are no lines. Throws InputError at a line that holds control characters: it is no text.
class TextLines {
 public:
  TextLines(const std::string& path, std::string_view content);

  /// Moves to the next line; false at the end.
  bool next();

  /// Moves to the next line. Throws InputError that names `what` at the end.
  void need(const std::string& what);

  std::string_view text() const { return text_; }
  int number() const { return number_; }                        ///< From 1.
  std::string place() const { return atLine(path_, number_); }  ///< "path:line".
  int count() const { return count_; }                          ///< Lines in all.

 private:
  const std::string& path_;
  std::string_view rest_;
  std::string_view text_;
  int number_ = 0;
  int count_ = 0;
};

/// The extension of a path in small letters, with its dot; empty when there is none.
std::string extensionOf(const std::string& path);

/// Whether a path ends, behind a name, with an extension given in small letters: ".csv", ".nii.gz".
bool hasExtension(const std::string& path, std::string_view extension);

bool endsWith(std::string_view text, std::string_view end);

/// Without blanks and line ends on both sides.
std::string_view trimmed(std::string_view text);

/// The parts between separators; one more than there are separators.
void splitAt(char separator, std::string_view text, std::vector<std::string_view>& parts);

/// The next word between blanks and line ends; the text moves on behind it. Empty at the end.
std::string_view nextWord(std::string_view& text);

/// All words of a text.
void splitAtBlanks(std::string_view text, std::vector<std::string_view>& parts);

/// The whole text as a finite number, whatever the locale. Throws InputError "place: field = text: rule".
double parseNumber(const std::string& place, const std::string& field, std::string_view text);

/// The whole text as an integer of 32 bits.
int parseInteger(const std::string& place, const std::string& field, std::string_view text);

/// The shortest decimal form that reads back as the same number.
std::string exact(double value);

/// Metres as millimetres, so that dividing by 1000 gives the same number again, and their text.
double millimetres(double value_m);
std::string exactMillimetres(double value_m);

}  // namespace angio::io
