// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "dicom_file.hpp"

// A new DICOM object: what all objects have, and its file.
namespace angio::io {

/// A number as a decimal string (DS), of at most 16 characters.
std::string decimalString(double value);

/// A UID that no other object has.
std::string newUid();

/// Whether it is one: 1 to 64 digits and dots, no part empty or with a zero before others.
bool isUid(const std::string& uid);

class DicomWriter {
 public:
  /// @param sop_class, modality  Of the object. @param run_path  DICOM file whose patient and study it belongs to;
  /// other files, and none, name nobody. Throws InputError when a DICOM file cannot be read.
  DicomWriter(const std::string& sop_class, const std::string& modality, const std::string& series,
              const std::string& run_path);

  DcmItem& dataset() { return *file_.getDataset(); }
  void put(const DcmTagKey& tag, const std::string& value) { put(dataset(), tag, value); }
  static void put(DcmItem& item, const DcmTagKey& tag, const std::string& value);

  /// A new item at the end of a sequence.
  static DcmItem& add(DcmItem& item, const DcmTagKey& sequence);

  /// The run's, empty without one.
  const std::string& runClass() const { return run_class_; }
  const std::string& runInstance() const { return run_instance_; }
  const std::string& runSeries() const { return run_series_; }
  const std::string& runFrameOfReference() const { return run_frame_; }
  const std::string& date() const { return date_; }
  const std::string& time() const { return time_; }

  /// Explicit little endian; the file appears whole or not at all. Throws InputError that names it.
  void write(const std::string& path);

 private:
  void copyPatientAndStudy(DcmItem* run);

  DcmFileFormat file_;
  std::string run_class_, run_instance_, run_series_, run_frame_, date_, time_;
};

}  // namespace angio::io
