// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "angio/io/xa_files.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// A small DICOM file by hand: what no real run at hand has, and what none should have.
class DicomBytes {
 public:
  /// Two frames of 4 x 3 px with 12 of 16 bits, v = 1000 + 100 * frame + 10 * row + column, and a whole geometry.
  DicomBytes() {
    set(0x00080060, "CS", "XA").set(0x00181110, "DS", "1000").set(0x00181111, "DS", "750");
    set(0x00181164, "DS", "0.4\\0.4").set(0x00181510, "DS", "30").set(0x00181511, "DS", "-20");
    set(0x00185100, "CS", "HFS").set(0x00280002, "US", word(1)).set(0x00280004, "CS", "MONOCHROME2");
    set(0x00280008, "IS", "2").set(0x00280010, "US", word(3)).set(0x00280011, "US", word(4));
    set(0x00280100, "US", word(16)).set(0x00280101, "US", word(12)).set(0x00280102, "US", word(11));
    set(0x00280103, "US", word(0));
    std::string pixels;
    for (int frame = 0; frame < 2; ++frame) {
      for (int i = 0; i < 12; ++i) pixels += word(1000 + 100 * frame + 10 * (i / 4) + i % 4);
    }
    set(0x7FE00010, "OW", pixels);
  }

  static std::string word(int value) { return {static_cast<char>(value), static_cast<char>(value >> 8)}; }
  static std::string longWord(std::uint32_t value) {
    return word(static_cast<int>(value & 0xFFFF)) + word(static_cast<int>(value >> 16));
  }

  DicomBytes& set(std::uint32_t tag, const std::string& vr, std::string value) {
    if (value.size() % 2 != 0) value += vr == "UI" ? '\0' : ' ';
    elements_[tag] = {vr, std::move(value)};
    return *this;
  }

  DicomBytes& remove(std::uint32_t tag) {
    elements_.erase(tag);
    return *this;
  }

  DicomBytes& syntax(const std::string& uid) {
    syntax_ = uid;
    return *this;
  }

  /// Elements one behind the other, as an item holds them.
  std::string elements(bool with_vr = true) const {
    std::string bytes;
    for (const auto& [tag, element] : elements_) bytes += encoded(tag, element.first, element.second, with_vr);
    return bytes;
  }

  /// An item of nothing but what is set later, to build sequences from.
  static DicomBytes item() {
    DicomBytes empty;
    empty.elements_.clear();
    return empty;
  }

  /// The value of a sequence.
  static std::string sequence(const std::vector<DicomBytes>& items) {
    std::string bytes;
    for (const DicomBytes& one : items) {
      const std::string content = one.elements();
      bytes += word(0xFFFE) + word(0xE000) + longWord(static_cast<std::uint32_t>(content.size())) + content;
    }
    return bytes;
  }

  /// The whole file.
  std::string file() const {
    std::string uid = syntax_;
    if (uid.size() % 2 != 0) uid += '\0';
    const std::string meta = encoded(0x00020010, "UI", uid, true);
    return std::string(128, '\0') + "DICM" +
           encoded(0x00020000, "UL", longWord(static_cast<std::uint32_t>(meta.size())), true) + meta +
           elements(syntax_ != "1.2.840.10008.1.2");
  }

  static std::string encoded(std::uint32_t tag, const std::string& vr, const std::string& value, bool with_vr) {
    const auto size = static_cast<std::uint32_t>(value.size());
    const std::string head = word(static_cast<int>(tag >> 16)) + word(static_cast<int>(tag & 0xFFFF));
    if (!with_vr) return head + longWord(size) + value;
    const bool is_long = vr == "OB" || vr == "OW" || vr == "SQ" || vr == "UN";
    return head + vr + (is_long ? word(0) + longWord(size) : word(static_cast<int>(size))) + value;
  }

 private:
  std::map<std::uint32_t, std::pair<std::string, std::string>> elements_;
  std::string syntax_ = "1.2.840.10008.1.2.1";
};

/// A run of those bytes.
inline XaRun made(const DicomBytes& bytes) { return XaRun("made.dcm", bytes.file()); }

}  // namespace angio::test
