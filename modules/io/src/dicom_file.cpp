// SPDX-License-Identifier: GPL-2.0-or-later
#include "dicom_file.hpp"

#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcdict.h>
#include <dcmtk/dcmdata/dcelem.h>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcsequen.h>
#include <dcmtk/dcmdata/dctag.h>
#include <dcmtk/oflog/oflog.h>

#include <algorithm>
#include <cstdio>
#include <string_view>

#include "angio/io/text.hpp"

namespace angio::io {
namespace {

constexpr std::size_t kMetaStart = 132;
constexpr std::uint32_t kUndefined = 0xFFFFFFFF;
constexpr std::uint32_t kItem = 0xFFFEE000, kItemEnd = 0xFFFEE00D, kSequenceEnd = 0xFFFEE0DD;
constexpr std::uint32_t kPixels = 0x7FE00010, kMetaLength = 0x00020000, kTransferSyntax = 0x00020010;
constexpr int kDeepestSequence = 16;
// DCMTK keeps the elements of one item in a list sorted by tag: many in the wrong order would take it quadratic time.
constexpr int kMaxInItem = 4096;
constexpr int kMaxElements = 1'000'000;

// The deflated syntax is not among them: its lengths cannot be checked before they are unpacked.
constexpr DicomSyntax kSyntaxes[] = {
    {"1.2.840.10008.1.2", "implicit little endian", false, false, DicomCompression::kNone},
    {"1.2.840.10008.1.2.1", "explicit little endian", true, false, DicomCompression::kNone},
    {"1.2.840.10008.1.2.2", "explicit big endian", true, true, DicomCompression::kNone},
    {"1.2.840.10008.1.2.4.50", "JPEG baseline", true, false, DicomCompression::kJpeg},
    {"1.2.840.10008.1.2.4.51", "JPEG extended", true, false, DicomCompression::kJpeg},
    {"1.2.840.10008.1.2.4.57", "JPEG lossless", true, false, DicomCompression::kJpeg},
    {"1.2.840.10008.1.2.4.70", "JPEG lossless, first-order prediction", true, false, DicomCompression::kJpeg},
    {"1.2.840.10008.1.2.5", "run length", true, false, DicomCompression::kRunLength}};

bool isOneOf(std::string_view vr, std::string_view list) {
  for (std::size_t i = 0; i + 2 <= list.size(); i += 3) {
    if (list.substr(i, 2) == vr) return true;
  }
  return false;
}

// How the elements around a place are written.
struct Coding {
  bool explicit_vr = true;
  bool big_endian = false;
};

struct Element {
  std::uint32_t tag = 0;
  std::string vr;  // Empty without one.
  std::uint32_t length = 0;
};

class Walker {
 public:
  Walker(const std::string& path, const std::string& content) : path_(path), content_(content) {}

  /// The transfer syntax in the file's meta group, which is always explicit little endian.
  std::string readMeta() {
    std::string uid;
    std::size_t said_end = 0;
    while (content_.size() - at_ >= 2 && number(at_, 2, false) == 2) {
      const Element element = readHead(Coding(), content_.size());
      if (element.length == kUndefined) throw refusal(at_, "the meta group must not hold sequences");
      if (element.tag == kTransferSyntax) uid = content_.substr(at_, element.length);
      if (element.tag == kMetaLength && element.length == 4) said_end = at_ + 4 + number(at_, 4, false);
      at_ += element.length;
    }
    // DCMTK would begin the data set where this says.
    if (said_end != 0 && said_end != at_) throw refusal(at_, "the meta group's length is wrong");
    uid.erase(std::find(uid.begin(), uid.end(), '\0'), uid.end());
    while (!uid.empty() && uid.back() == ' ') uid.pop_back();
    return uid;
  }

  void walkDataset(const Coding& coding) { walkItem(coding, content_.size(), false, 0); }

 private:
  InputError refusal(std::size_t at, const std::string& rule) const {
    return InputError(path_, "byte", std::to_string(at), rule);
  }

  void need(std::size_t bytes, std::size_t end) const {
    if (bytes > end - at_) throw refusal(at_, "the file ends too early, or a length is wrong");
  }

  std::uint32_t number(std::size_t at, int bytes, bool big_endian) const {
    std::uint32_t value = 0;
    for (int i = 0; i < bytes; ++i) {
      const auto byte =
          static_cast<unsigned char>(content_[at + static_cast<std::size_t>(big_endian ? i : bytes - 1 - i)]);
      value = value << 8 | byte;
    }
    return value;
  }

  // Moves behind the element's head; its value, unless of undefined length, lies before `end`.
  Element readHead(const Coding& coding, std::size_t end) {
    if (++elements_ > kMaxElements) throw refusal(at_, "must not have more than a million elements");
    need(8, end);
    Element element;
    element.tag = number(at_, 2, coding.big_endian) << 16 | number(at_ + 2, 2, coding.big_endian);
    const bool delimits = element.tag >> 16 == 0xFFFE;
    if (!coding.explicit_vr || delimits) {
      element.length = number(at_ + 4, 4, coding.big_endian);
      at_ += 8;
    } else {
      element.vr = content_.substr(at_ + 4, 2);
      if (isOneOf(element.vr, "AE AS AT CS DA DS DT FD FL IS LO LT PN SH SL SS ST TM UI UL US ")) {
        element.length = number(at_ + 6, 2, coding.big_endian);
        at_ += 8;
      } else if (isOneOf(element.vr, "OB OD OF OL OV OW SQ SV UC UN UR UT UV ")) {
        need(12, end);
        element.length = number(at_ + 8, 4, coding.big_endian);
        at_ += 12;
      } else {
        throw refusal(at_, "must be an element of DICOM");
      }
    }
    if (element.length != kUndefined) need(element.length, end);
    return element;
  }

  // The elements up to `end`, or up to the item's end mark.
  void walkItem(const Coding& coding, std::size_t end, bool until_mark, int depth) {
    if (depth > kDeepestSequence) throw refusal(at_, "must not be nested so deeply");
    for (int count = 0; until_mark || at_ < end; ++count) {
      if (count > kMaxInItem) throw refusal(at_, "must not have so many elements in one item");
      const std::size_t start = at_;
      const Element element = readHead(coding, end);
      if (until_mark && element.tag == kItemEnd && element.length == 0) return;
      if (element.tag >> 16 == 0xFFFE) throw refusal(start, "an item must stand in a sequence");
      walkValue(coding, element, end, depth);
    }
  }

  void walkValue(const Coding& coding, const Element& element, std::size_t end, int depth) {
    const bool open = element.length == kUndefined;
    if (open && element.tag == kPixels && (element.vr == "OB" || element.vr == "OW")) {
      walkSequence(coding, end, true, true, depth);
    } else if (open && element.vr == "UN") {
      walkSequence({false, false}, end, true, false, depth);  // PS3.5 6.2.2: a sequence in implicit little endian.
    } else if (element.vr == "SQ" || (element.vr.empty() && (open || isSequence(element.tag)))) {
      walkSequence(coding, open ? end : at_ + element.length, open, false, depth);
    } else if (open) {
      throw refusal(at_, "only sequences and compressed pixels may have an undefined length");
    } else {
      at_ += element.length;
    }
  }

  void walkSequence(const Coding& coding, std::size_t end, bool until_mark, bool fragments, int depth) {
    while (until_mark || at_ < end) {
      const std::size_t start = at_;
      const Element item = readHead(coding, end);
      if (until_mark && item.tag == kSequenceEnd && item.length == 0) return;
      const bool open = item.length == kUndefined;
      if (item.tag != kItem || (fragments && open)) throw refusal(start, "must be an item of a sequence");
      if (fragments) {
        at_ += item.length;
      } else {
        walkItem(coding, open ? end : at_ + item.length, open, depth + 1);
      }
    }
  }

  // Without VRs the dictionary says what is a sequence, and DCMTK asks the same one.
  static bool isSequence(std::uint32_t tag) {
    return DcmTag(static_cast<Uint16>(tag >> 16), static_cast<Uint16>(tag & 0xFFFF)).getEVR() == EVR_SQ;
  }

  const std::string& path_;
  const std::string& content_;
  std::size_t at_ = kMetaStart;
  int elements_ = 0;
};

// Walks over every element of a DICOM file, nested ones too, and returns its transfer syntax.
//
// DCMTK takes memory by what lengths say and descends as deep as sequences do. After this walk each length lies inside
// what holds it, each container is closed, nothing is nested deeper than 16, and there are at most a million elements:
// DCMTK's memory is then bounded by the file's size. Throws InputError that names `path` and the place of what is
// wrong, or the transfer syntax when it is none of those that are read.
const DicomSyntax& checkDicomStructure(const std::string& path, const std::string& content) {
  if (!startsAsDicom(content)) throw InputError(path, "", "", "must be a DICOM file: DICM must stand at byte 128");
  Walker walker(path, content);
  const std::string uid = walker.readMeta();
  for (const DicomSyntax& syntax : kSyntaxes) {
    if (uid != syntax.uid) continue;
    walker.walkDataset({syntax.explicit_vr, syntax.big_endian});
    return syntax;
  }
  throw InputError(
      path, "(0002,0010) Transfer Syntax UID", uid,
      "must be implicit or explicit without deflation, JPEG baseline, extended or lossless, or run length");
}

constexpr std::uint32_t kMaxValue = 4 << 20;  // Of an attribute that is asked for [bytes]; pixels are not.

// DCMTK's loggers, which write to the terminal, are below this one.
void silenceDcmtk() {
  static const bool silent = [] {
    OFLog::getLogger("dcmtk").setLogLevel(OFLogger::OFF_LOG_LEVEL);
    return true;
  }();
  (void)silent;
}

// The item of one of the two sequences of functional groups, or nothing.
DcmItem* groupItem(DcmDataset& dataset, const DcmTagKey& sequence, int item) {
  DcmItem* found = nullptr;
  return dataset.findAndGetSequenceItem(sequence, found, item).good() ? found : nullptr;
}

DcmElement* elementOf(DcmItem& item, const DicomTag& tag) {
  DcmElement* element = nullptr;
  return item.findAndGetElement(DcmTagKey(tag.group, tag.element), element).good() ? element : nullptr;
}

template <typename Value>
std::optional<Value> firstOf(std::vector<Value> values) {
  if (values.empty()) return std::nullopt;
  return std::move(values.front());
}

}  // namespace

bool startsAsDicom(const std::string& content) {
  return content.size() >= kMetaStart && content.compare(kMetaStart - 4, 4, "DICM") == 0;
}

std::string DicomTag::label() const {
  char text[16];
  std::snprintf(text, sizeof text, "(%04x,%04x) ", group, element);
  return std::string(text) + name;
}

DicomFile::DicomFile(const std::string& path, std::string content) : path_(path) {
  silenceDcmtk();
  syntax_ = &checkDicomStructure(path, content);
  if (!syntax_->explicit_vr && !dcmDataDict.isDictionaryLoaded()) {
    throw InputError(path, "", "", "cannot be read without DCMTK's dictionary: its types are implicit");
  }
  DcmInputBufferStream stream;
  stream.setBuffer(content.data(), static_cast<offile_off_t>(content.size()));
  stream.setEos();
  file_.transferInit();
  const OFCondition read = file_.read(stream);
  file_.transferEnd();
  if (read.bad()) throw InputError(path, "", "", std::string("is not a readable DICOM file: ") + read.text());
}

InputError DicomFile::refusal(const DicomTag& tag, const std::string& value, const std::string& rule) const {
  return InputError(path_, tag.label(), value, rule);
}

DcmElement* DicomFile::find(const DicomTag& tag, int frame) const {
  const DcmTagKey key(tag.group, tag.element);
  DcmElement* element = nullptr;
  for (DcmItem* group : {groupItem(dataset(), DCM_PerFrameFunctionalGroupsSequence, frame),
                         groupItem(dataset(), DCM_SharedFunctionalGroupsSequence, 0)}) {
    if (group && group->findAndGetElement(key, element, OFTrue).good()) return element;
  }
  return elementOf(dataset(), tag);
}

std::vector<std::string> DicomFile::textsOf(const DicomTag& tag, DcmElement* element) const {
  if (!element || element->getLength() == 0 || !element->isLeaf()) return {};
  if (element->getLength() > kMaxValue) {
    throw refusal(tag, std::to_string(element->getLength()) + " bytes", "must not be so long");
  }
  OFString all;
  if (element->getOFStringArray(all).bad()) throw refusal(tag, "", "cannot be read");
  std::vector<std::string_view> parts;
  const std::string_view whole(all.c_str(), all.size());
  splitAt('\\', whole.substr(0, whole.find('\0')), parts);
  std::vector<std::string> values;
  for (const auto part : parts) values.emplace_back(trimmed(part));
  if (values.size() == 1 && values.front().empty()) return {};
  return values;
}

std::vector<double> DicomFile::numbersOf(const DicomTag& tag, DcmElement* element) const {
  std::vector<double> values;
  for (const std::string& value : textsOf(tag, element)) values.push_back(parseNumber(path_, tag.label(), value));
  return values;
}

std::vector<std::string> DicomFile::texts(const DicomTag& tag, int frame) const {
  return textsOf(tag, find(tag, frame));
}

std::optional<std::string> DicomFile::text(const DicomTag& tag, int frame) const { return firstOf(texts(tag, frame)); }

std::vector<double> DicomFile::numbers(const DicomTag& tag, int frame) const {
  return numbersOf(tag, find(tag, frame));
}

std::optional<double> DicomFile::number(const DicomTag& tag, int frame) const { return firstOf(numbers(tag, frame)); }

std::vector<DcmItem*> DicomFile::items(const DicomTag& sequence) const {
  std::vector<DcmItem*> found;
  DcmSequenceOfItems* items = nullptr;
  if (dataset().findAndGetSequence(DcmTagKey(sequence.group, sequence.element), items).bad()) return found;
  for (unsigned long i = 0; i < items->card(); ++i) found.push_back(items->getItem(i));
  return found;
}

std::vector<double> DicomFile::numbers(const DicomTag& tag, DcmItem& item) const {
  return numbersOf(tag, elementOf(item, tag));
}

std::optional<std::string> DicomFile::text(const DicomTag& tag, DcmItem& item) const {
  return firstOf(textsOf(tag, elementOf(item, tag)));
}

int DicomFile::integer(const DicomTag& tag, int low, int high, std::optional<int> otherwise) const {
  const auto value = text(tag);
  if (!value) {
    if (otherwise) return *otherwise;
    throw refusal(tag, "", "is missing");
  }
  const int number = parseInteger(path_, tag.label(), *value);
  requireBetween(path_, tag.label(), number, low, high);
  return number;
}

}  // namespace angio::io
