// SPDX-License-Identifier: GPL-2.0-or-later
#include "dicom_file.hpp"

#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcdict.h>
#include <dcmtk/dcmdata/dcelem.h>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcsequen.h>
#include <dcmtk/oflog/oflog.h>

#include <cstdio>

#include "angio/io/text.hpp"

namespace angio::io {
namespace {

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
