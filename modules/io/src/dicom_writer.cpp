// SPDX-License-Identifier: GPL-2.0-or-later
#include "dicom_writer.hpp"

#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dcuid.h>

#include <ctime>
#include <optional>
#include <vector>

#include "angio/base/formatted.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"

namespace angio::io {
namespace {

// What an object has of its patient and study whoever they are, empty where that is not known (type 2).
const DcmTagKey kOfPatientAndStudy[] = {
    DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate,       DCM_PatientSex, DCM_StudyInstanceUID,
    DCM_StudyDate,   DCM_StudyTime, DCM_ReferringPhysicianName, DCM_StudyID,    DCM_AccessionNumber};

std::string textOf(DcmItem& item, const DcmTagKey& tag) {
  OFString value;
  return item.findAndGetOFStringArray(tag, value).good() ? std::string(value.c_str()) : std::string();
}

void require(const OFCondition& done) {
  if (done.bad()) throw std::logic_error(std::string("DICOM: ") + done.text());
}

}  // namespace

std::string decimalString(double value) { return formatted("%.10g", value); }

std::string newUid() {
  char uid[100];
  return dcmGenerateUniqueIdentifier(uid, SITE_INSTANCE_UID_ROOT);
}

bool isUid(const std::string& uid) {
  if (uid.empty() || uid.size() > 64) return false;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= uid.size(); ++i) {
    if (i < uid.size() && uid[i] != '.') {
      if (uid[i] < '0' || uid[i] > '9') return false;
      continue;
    }
    if (i == begin || (uid[begin] == '0' && i > begin + 1)) return false;
    begin = i + 1;
  }
  return true;
}

void DicomWriter::put(DcmItem& item, const DcmTagKey& tag, const std::string& value) {
  require(item.putAndInsertString(tag, value.c_str()));
}

DcmItem& DicomWriter::add(DcmItem& item, const DcmTagKey& sequence) {
  DcmItem* added = nullptr;
  require(item.findOrCreateSequenceItem(sequence, added, -2));  // -2: behind the last.
  return *added;
}

DicomWriter::DicomWriter(const std::string& sop_class, const std::string& modality, const std::string& series,
                         const std::string& run_path) {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%d", &local);
  date_ = text;
  std::strftime(text, sizeof text, "%H%M%S", &local);
  time_ = text;

  std::optional<DicomFile> run;
  if (!run_path.empty() && isDicom(run_path)) run.emplace(run_path, readWholeFile(run_path));
  copyPatientAndStudy(run ? &run->dataset() : nullptr);
  put(DCM_SOPClassUID, sop_class);
  put(DCM_SOPInstanceUID, newUid());
  put(DCM_SeriesInstanceUID, newUid());
  put(DCM_Modality, modality);
  put(DCM_SeriesNumber, "1");
  put(DCM_SeriesDate, date_);
  put(DCM_SeriesTime, time_);
  put(DCM_SeriesDescription, series);
  put(DCM_Laterality, "");  // Of one body part of two.
  put(DCM_InstanceNumber, "1");
  put(DCM_Manufacturer, "AngioServo");
  put(DCM_ManufacturerModelName, "AngioServo");
  put(DCM_DeviceSerialNumber, "0");
  put(DCM_SoftwareVersions, "0.1.0");
}

void DicomWriter::copyPatientAndStudy(DcmItem* run) {
  for (const DcmTagKey& tag : kOfPatientAndStudy) put(tag, run ? textOf(*run, tag) : "");
  if (run) {
    const std::string characters = textOf(*run, DCM_SpecificCharacterSet);
    if (!characters.empty()) put(DCM_SpecificCharacterSet, characters);
    run_class_ = textOf(*run, DCM_SOPClassUID);
    run_instance_ = textOf(*run, DCM_SOPInstanceUID);
    run_series_ = textOf(*run, DCM_SeriesInstanceUID);
    run_frame_ = textOf(*run, DCM_FrameOfReferenceUID);
  }
  if (textOf(dataset(), DCM_StudyInstanceUID).empty()) put(DCM_StudyInstanceUID, newUid());
  if (textOf(dataset(), DCM_StudyDate).empty()) put(DCM_StudyDate, date_);
  if (textOf(dataset(), DCM_StudyTime).empty()) put(DCM_StudyTime, time_);
}

void DicomWriter::write(const std::string& path) {
  require(file_.validateMetaInfo(EXS_LittleEndianExplicit));
  const auto length = file_.calcElementLength(EXS_LittleEndianExplicit, EET_ExplicitLength);
  constexpr std::size_t kPreamble_bytes = 132, kSlack_bytes = 4096;
  std::vector<char> bytes(length + kPreamble_bytes + kSlack_bytes);
  DcmOutputBufferStream stream(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  file_.transferInit();
  require(file_.write(stream, EXS_LittleEndianExplicit, EET_ExplicitLength, nullptr));
  file_.transferEnd();
  stream.flush();
  void* begin = nullptr;
  offile_off_t written = 0;
  stream.flushBuffer(begin, written);
  writeWholeFile(path, std::string(static_cast<const char*>(begin), static_cast<std::size_t>(written)));
}

}  // namespace angio::io
