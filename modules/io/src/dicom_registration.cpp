// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/dicom_registration.hpp"

#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcuid.h>

#include <optional>
#include <stdexcept>
#include <vector>

#include "angio/io/whole_file.hpp"
#include "dicom_writer.hpp"

namespace angio::io {
namespace {

constexpr std::size_t kMaxRegistration_bytes = std::size_t{16} << 20;

// Decimal strings of DICOM have 16 characters: 1e-9 of a rotation's entries.
constexpr double kMaxDefect = 1e-6;

constexpr DicomTag kSopClass{0x0008, 0x0016, "SOP Class UID"};
constexpr DicomTag kRegistrations{0x0070, 0x0308, "Registration Sequence"};
constexpr DicomTag kMatrix{0x3006, 0x00C6, "Frame of Reference Transformation Matrix"};
constexpr DicomTag kMatrixType{0x0070, 0x030C, "Frame of Reference Transformation Matrix Type"};
constexpr DicomTag kFrameOfReference{0x0020, 0x0052, "Frame of Reference UID"};
constexpr DicomTag kComment{0x3006, 0x00C8, "Frame of Reference Transformation Comment"};
constexpr DicomTag kDescription{0x0070, 0x0081, "Content Description"};

// What the comment of the model's item says of its tree.
constexpr char kModelComment[] = "model to X-ray camera, model_id ";

std::string matrixText(const Pose& T) {
  std::string text;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) {
      const double value = T.matrix()(r, c) * (r < 3 && c == 3 ? 1e3 : 1);
      text += (text.empty() ? "" : "\\") + decimalString(value);
    }
  }
  return text;
}

void putMatrix(DcmItem& item, const Pose& T, const std::string& comment) {
  DcmItem& matrix_registration = DicomWriter::add(item, DCM_MatrixRegistrationSequence);
  DicomWriter::put(matrix_registration, DCM_FrameOfReferenceTransformationComment, comment);
  // By images, not by markers.
  DcmItem& type = DicomWriter::add(matrix_registration, DCM_RegistrationTypeCodeSequence);
  DicomWriter::put(type, DCM_CodeValue, "125024");
  DicomWriter::put(type, DCM_CodingSchemeDesignator, "DCM");
  DicomWriter::put(type, DCM_CodeMeaning, "Image Content-based Alignment");
  DcmItem& matrix = DicomWriter::add(matrix_registration, DCM_MatrixSequence);
  DicomWriter::put(matrix, DCM_FrameOfReferenceTransformationMatrix, matrixText(T));
  DicomWriter::put(matrix, DCM_FrameOfReferenceTransformationMatrixType, "RIGID");
}

void putReference(DcmItem& item, const DcmTagKey& sequence, const DicomWriter& writer) {
  DcmItem& reference = DicomWriter::add(item, sequence);
  DicomWriter::put(reference, DCM_ReferencedSOPClassUID, writer.runClass());
  DicomWriter::put(reference, DCM_ReferencedSOPInstanceUID, writer.runInstance());
}

// The run's images lie in the camera's frame as they are.
void putRun(DicomWriter& writer) {
  if (writer.runInstance().empty()) return;
  DcmItem& item = DicomWriter::add(writer.dataset(), DCM_RegistrationSequence);
  if (!writer.runFrameOfReference().empty()) {
    DicomWriter::put(item, DCM_FrameOfReferenceUID, writer.runFrameOfReference());
  }
  putReference(item, DCM_ReferencedImageSequence, writer);
  putMatrix(item, Pose::Identity(), "X-ray run to X-ray camera");
  DcmItem& series = DicomWriter::add(writer.dataset(), DCM_ReferencedSeriesSequence);
  DicomWriter::put(series, DCM_SeriesInstanceUID, writer.runSeries());
  putReference(series, DCM_ReferencedInstanceSequence, writer);
}

std::optional<Pose> poseOf(const DicomFile& file, DcmItem& item) {
  DcmItem* matrix_registration = nullptr;
  DcmItem* matrix = nullptr;
  if (item.findAndGetSequenceItem(DCM_MatrixRegistrationSequence, matrix_registration).bad() ||
      matrix_registration->findAndGetSequenceItem(DCM_MatrixSequence, matrix).bad()) {
    throw file.refusal(kMatrix, "", "must be in each item of the registration");
  }
  const auto type = file.text(kMatrixType, *matrix);
  if (type != "RIGID") throw file.refusal(kMatrixType, type.value_or(""), "must be RIGID");
  const std::vector<double> numbers = file.numbers(kMatrix, *matrix);
  if (numbers.size() != 16) throw file.refusal(kMatrix, std::to_string(numbers.size()), "must be 16 numbers");
  using RowMajor4d = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  const RowMajor4d read = Eigen::Map<const RowMajor4d>(numbers.data());
  const Eigen::Matrix3d R = read.topLeftCorner<3, 3>();
  const bool rigid = read.allFinite() && rotationDefect(R) < kMaxDefect &&
                     (read.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() == 0 &&
                     read.topRightCorner<3, 1>().norm() < 1e5;
  if (!rigid) throw file.refusal(kMatrix, "", "must be a rotation and a shift of less than 100 m");
  if (read.isIdentity(0)) return std::nullopt;
  Pose T = Pose::Identity();
  T.linear() = nearestRotation(R);
  T.translation() = 1e-3 * read.topRightCorner<3, 1>();
  return T;
}

ModelId modelIn(const DicomFile& file, DcmItem& item) {
  DcmItem* matrix_registration = nullptr;
  item.findAndGetSequenceItem(DCM_MatrixRegistrationSequence, matrix_registration);
  const std::string comment = file.text(kComment, *matrix_registration).value_or("");
  if (comment.rfind(kModelComment, 0) != 0) return ModelId::kUnknown;
  try {
    return ModelId{std::stoll(comment.substr(sizeof kModelComment - 1))};
  } catch (const std::exception&) {
    return ModelId::kUnknown;
  }
}

}  // namespace

void writeDicomRegistration(const std::string& path, const DicomRegistration& registration,
                            const std::string& run_path) {
  const std::string& frame = registration.model_frame_uid;
  if (!frame.empty() && !isUid(frame)) throw InputError(path, "frame of reference", frame, "must be a DICOM UID");
  DicomWriter writer(UID_SpatialRegistrationStorage, "REG", "Vessel tree to X-ray", run_path);
  writer.put(DCM_FrameOfReferenceUID, newUid());
  writer.put(DCM_PositionReferenceIndicator, "");
  writer.put(DCM_ContentDate, writer.date());
  writer.put(DCM_ContentTime, writer.time());
  writer.put(DCM_ContentLabel, "VESSEL_TREE");
  writer.put(DCM_ContentDescription, registration.description.substr(0, 64));
  writer.put(DCM_ContentCreatorName, "");
  putRun(writer);
  DcmItem& model = DicomWriter::add(writer.dataset(), DCM_RegistrationSequence);
  DicomWriter::put(model, DCM_FrameOfReferenceUID, frame.empty() ? newUid() : frame);
  putMatrix(model, registration.T_camera_model,
            kModelComment + std::to_string(static_cast<std::int64_t>(registration.model_id)));
  writer.write(path);
}

DicomRegistration readDicomRegistration(const std::string& path) {
  const DicomFile file(path, readWholeFile(path, kMaxRegistration_bytes));
  const std::string sop_class = file.text(kSopClass).value_or("");
  if (sop_class != UID_SpatialRegistrationStorage) {
    throw file.refusal(kSopClass, sop_class, "must be Spatial Registration Storage");
  }
  DicomRegistration read;
  int found = 0;
  for (DcmItem* item : file.items(kRegistrations)) {
    const auto pose = poseOf(file, *item);
    if (!pose) continue;
    ++found;
    read.T_camera_model = *pose;
    read.model_frame_uid = file.text(kFrameOfReference, *item).value_or("");
    read.model_id = modelIn(file, *item);
  }
  if (found != 1) {
    throw file.refusal(kRegistrations, std::to_string(found), "must have one item that is not the identity");
  }
  read.description = file.text(kDescription).value_or("");
  return read;
}

void writeSecondaryCapture(const std::string& path, const cv::Mat& picture, const std::string& description,
                           const std::string& run_path) {
  if (picture.type() != CV_8UC3 || picture.empty() || picture.cols > 0xFFFF || picture.rows > 0xFFFF) {
    throw std::invalid_argument("a secondary capture is made of a colour picture");
  }
  DicomWriter writer(UID_SecondaryCaptureImageStorage, "OT", "Vessel tree on X-ray", run_path);
  writer.put(DCM_ConversionType, "WSD");
  writer.put(DCM_ContentDate, writer.date());
  writer.put(DCM_ContentTime, writer.time());
  writer.put(DCM_PatientOrientation, "");
  writer.put(DCM_ImageType, "DERIVED\\SECONDARY");
  writer.put(DCM_ImageComments, description.substr(0, 1024));
  writer.put(DCM_BurnedInAnnotation, "NO");
  writer.put(DCM_PhotometricInterpretation, "RGB");
  const auto number = [&](const DcmTagKey& tag, int value) {
    writer.dataset().putAndInsertUint16(tag, static_cast<Uint16>(value));
  };
  number(DCM_SamplesPerPixel, 3);
  number(DCM_PlanarConfiguration, 0);
  number(DCM_Rows, picture.rows);
  number(DCM_Columns, picture.cols);
  number(DCM_BitsAllocated, 8);
  number(DCM_BitsStored, 8);
  number(DCM_HighBit, 7);
  number(DCM_PixelRepresentation, 0);
  std::vector<Uint8> pixels;
  pixels.reserve(picture.total() * 3 + 1);
  for (int y = 0; y < picture.rows; ++y) {
    const auto* row = picture.ptr<cv::Vec3b>(y);
    for (int x = 0; x < picture.cols; ++x) pixels.insert(pixels.end(), {row[x][2], row[x][1], row[x][0]});
  }
  if (pixels.size() % 2 != 0) pixels.push_back(0);
  writer.dataset().putAndInsertUint8Array(DCM_PixelData, pixels.data(), static_cast<unsigned long>(pixels.size()));
  writer.write(path);
}

}  // namespace angio::io
