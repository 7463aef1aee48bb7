// SPDX-License-Identifier: GPL-2.0-or-later
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/xml.hpp"

namespace angio::io {
namespace {

// Bytes as they stand, or as base64 in groups of four characters. A padded group may stand in the middle: VTK encodes
// the header of compressed data on its own.
class ByteSource {
 public:
  ByteSource(std::string_view text, bool base64) : text_(text), base64_(base64) {}

  // Fewer when there are no more.
  std::string take(std::size_t count) {
    std::string bytes;
    if (!base64_) {
      bytes = text_.substr(0, count);
      text_.remove_prefix(bytes.size());
      return bytes;
    }
    bytes = std::move(left_);
    left_.clear();
    while (bytes.size() < count && decodeGroup(bytes)) continue;
    if (bytes.size() > count) {
      left_ = bytes.substr(count);
      bytes.resize(count);
    }
    return bytes;
  }

  // Never fewer than are left.
  std::size_t most() const { return text_.size() + left_.size(); }

 private:
  static int valueOf(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
  }

  bool decodeGroup(std::string& bytes) {
    std::uint32_t bits = 0;
    int characters = 0, padding = 0;
    while (characters < 4 && !text_.empty()) {
      const char c = text_.front();
      const int value = valueOf(c);
      if (c == '=' && characters >= 2) {
        ++padding;
      } else if (value < 0 || padding > 0) {
        if (c != ' ' && c != '\n' && c != '\r' && c != '\t') return false;
        text_.remove_prefix(1);
        continue;
      }
      bits = bits << 6 | static_cast<std::uint32_t>(std::max(value, 0));
      ++characters;
      text_.remove_prefix(1);
    }
    if (characters < 4) return false;
    for (int i = 0; i < 3 - padding; ++i) bytes += static_cast<char>(bits >> (16 - 8 * i) & 0xff);
    return true;
  }

  std::string_view text_;
  bool base64_;
  std::string left_;
};

struct ArrayLayout {
  std::string place;
  std::string name;
  bool swapped = false;
  std::size_t header_word = 4;
  bool compressed = false;

  InputError wrong(const std::string& value, const std::string& rule) const { return {place, name, value, rule}; }
};

// The words of a header, or throws when the data end before.
std::vector<std::uint64_t> takeWords(ByteSource& source, const ArrayLayout& layout, std::size_t count) {
  if (count > source.most() / layout.header_word) {
    throw layout.wrong(std::to_string(count), "the header claims more blocks than there are bytes");
  }
  std::string bytes = source.take(count * layout.header_word);
  if (bytes.size() < count * layout.header_word) throw layout.wrong("", "the data end within their header");
  std::vector<std::uint64_t> words;
  for (std::size_t i = 0; i < count; ++i) {
    char* const word = bytes.data() + i * layout.header_word;
    if (layout.swapped) std::reverse(word, word + layout.header_word);
    std::uint64_t value = 0;
    std::memcpy(&value, word, layout.header_word);  // All machines we know are little endian.
    words.push_back(value);
  }
  return words;
}

std::string inflateBlocks(ByteSource& source, const ArrayLayout& layout, std::size_t size) {
  const auto head = takeWords(source, layout, 3);
  const std::uint64_t blocks = head[0], block_size = head[1], last_size = head[2];
  if (blocks == 0 && size == 0) return {};
  const auto packed_sizes =
      takeWords(source, layout, static_cast<std::size_t>(std::min<std::uint64_t>(blocks, SIZE_MAX)));
  std::string bytes;
  for (std::size_t b = 0; b < packed_sizes.size(); ++b) {
    const bool is_last = b + 1 == packed_sizes.size();
    const std::uint64_t block = is_last && last_size > 0 ? last_size : block_size;
    if (block > size - bytes.size()) throw layout.wrong(std::to_string(block), "a block is larger than the array");
    if (packed_sizes[b] > source.most())
      throw layout.wrong(std::to_string(packed_sizes[b]), "a block ends behind the file");
    const std::string packed = source.take(static_cast<std::size_t>(packed_sizes[b]));
    const std::size_t start = bytes.size();
    bytes.resize(start + static_cast<std::size_t>(block));
    uLongf got = static_cast<uLongf>(block);
    const int status = uncompress(reinterpret_cast<Bytef*>(&bytes[start]), &got,
                                  reinterpret_cast<const Bytef*>(packed.data()), static_cast<uLong>(packed.size()));
    if (status != Z_OK || got != block) throw layout.wrong("", "the compressed data are broken");
  }
  return bytes;
}

template <typename T>
std::vector<double> numbersIn(std::string bytes, bool swapped) {
  std::vector<double> numbers;
  numbers.reserve(bytes.size() / sizeof(T));
  for (std::size_t i = 0; i + sizeof(T) <= bytes.size(); i += sizeof(T)) {
    if (swapped) std::reverse(&bytes[i], &bytes[i] + sizeof(T));
    T value;
    std::memcpy(&value, &bytes[i], sizeof(T));
    numbers.push_back(static_cast<double>(value));
  }
  return numbers;
}

struct NumberType {
  const char* name;
  std::size_t size;
  std::vector<double> (*read)(std::string bytes, bool swapped);
};

constexpr NumberType kTypes[] = {
    {"Float32", 4, numbersIn<float>},        {"Float64", 8, numbersIn<double>},
    {"Int32", 4, numbersIn<std::int32_t>},   {"Int64", 8, numbersIn<std::int64_t>},
    {"UInt32", 4, numbersIn<std::uint32_t>}, {"UInt64", 8, numbersIn<std::uint64_t>},
    {"Int16", 2, numbersIn<std::int16_t>},   {"UInt16", 2, numbersIn<std::uint16_t>},
    {"Int8", 1, numbersIn<std::int8_t>},     {"UInt8", 1, numbersIn<std::uint8_t>},
};

std::vector<double> readAscii(std::string_view text, const ArrayLayout& layout, std::size_t count) {
  std::vector<double> numbers;
  for (auto word = nextWord(text); !word.empty(); word = nextWord(text)) {
    if (numbers.size() == count) throw layout.wrong("", "must have " + std::to_string(count) + " numbers, has more");
    numbers.push_back(parseNumber(layout.place, layout.name, word));
  }
  return numbers;
}

// The bytes of a binary or appended array.
ByteSource sourceOf(const XmlDocument& document, const XmlElement& array, const ArrayLayout& layout) {
  const std::string format = document.need(array, "format");
  if (format == "binary") return {document.textOf(array), true};
  if (format != "appended") throw layout.wrong(format, "the format must be ascii, binary or appended");
  const XmlElement* const element = document.root().child("AppendedData");
  const auto data = document.appendedData();
  if (!element || !data) throw layout.wrong(format, "there are no appended data");
  const std::string encoding = document.need(*element, "encoding");
  if (encoding != "raw" && encoding != "base64") throw layout.wrong(encoding, "the encoding must be raw or base64");
  const double offset = parseNumber(layout.place, layout.name + " offset", document.need(array, "offset"));
  if (!(offset >= 0 && offset < static_cast<double>(data->size()))) {
    throw layout.wrong(formatValue(offset), "the offset must lie within the appended data");
  }
  return {data->substr(static_cast<std::size_t>(offset)), encoding == "base64"};
}

ArrayLayout layoutOf(const XmlDocument& document, const XmlElement& array) {
  ArrayLayout layout;
  layout.place = document.placeOf(array);
  const std::string* const name = array.attribute("Name");
  layout.name = name ? *name : "DataArray";
  const auto attribute = [&](const char* wanted, const char* otherwise) {
    const std::string* const value = document.root().attribute(wanted);
    return value ? *value : std::string(otherwise);
  };
  const std::string order = attribute("byte_order", "LittleEndian"), header = attribute("header_type", "UInt32");
  const std::string compressor = attribute("compressor", "");
  if (order != "LittleEndian" && order != "BigEndian") {
    throw layout.wrong(order, "byte_order must be LittleEndian or BigEndian");
  }
  if (header != "UInt32" && header != "UInt64") throw layout.wrong(header, "header_type must be UInt32 or UInt64");
  if (!compressor.empty() && compressor != "vtkZLibDataCompressor") {
    throw layout.wrong(compressor, "compressor must be vtkZLibDataCompressor, or none");
  }
  layout.swapped = order == "BigEndian";
  layout.header_word = header == "UInt64" ? 8 : 4;
  layout.compressed = !compressor.empty();
  return layout;
}

}  // namespace

std::vector<double> readVtkArray(const XmlDocument& document, const XmlElement& array, std::size_t count) {
  const ArrayLayout layout = layoutOf(document, array);
  const std::string type_name = document.need(array, "type");
  const auto* const type = std::find_if(std::begin(kTypes), std::end(kTypes),
                                        [&](const NumberType& known) { return type_name == known.name; });
  if (type == std::end(kTypes)) throw layout.wrong(type_name, "must be an array of numbers");

  std::vector<double> numbers;
  if (document.need(array, "format") == "ascii") {
    numbers = readAscii(document.textOf(array), layout, count);
  } else {
    ByteSource source = sourceOf(document, array, layout);
    const std::size_t size = count * type->size;
    std::string bytes;
    if (layout.compressed) {
      bytes = inflateBlocks(source, layout, size);
    } else {
      const std::uint64_t claimed = takeWords(source, layout, 1)[0];
      if (claimed != size) {
        throw layout.wrong(std::to_string(claimed), "must be " + std::to_string(size) + " bytes in the data's header");
      }
      bytes = source.take(size);
    }
    numbers = type->read(std::move(bytes), layout.swapped);
  }
  if (numbers.size() != count) {
    throw layout.wrong(std::to_string(numbers.size()), "must have " + std::to_string(count) + " numbers");
  }
  return numbers;
}

}  // namespace angio::io
