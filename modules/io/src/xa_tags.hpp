// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "dicom_file.hpp"

/// The attributes of X-ray runs that are read, by the names of DICOM PS3.6.
namespace angio::io::tag {

constexpr DicomTag kModality{0x0008, 0x0060, "Modality"};
constexpr DicomTag kManufacturer{0x0008, 0x0070, "Manufacturer"};
constexpr DicomTag kModel{0x0008, 0x1090, "Manufacturer's Model Name"};
constexpr DicomTag kDisplayRate{0x0008, 0x2144, "Recommended Display Frame Rate"};
constexpr DicomTag kCineRate{0x0018, 0x0040, "Cine Rate"};
constexpr DicomTag kFrameTime{0x0018, 0x1063, "Frame Time"};
constexpr DicomTag kFrameTimes{0x0018, 0x1065, "Frame Time Vector"};
constexpr DicomTag kSourceDetector{0x0018, 0x1110, "Distance Source to Detector"};
constexpr DicomTag kSourcePatient{0x0018, 0x1111, "Distance Source to Patient"};
constexpr DicomTag kMagnification{0x0018, 0x1114, "Estimated Radiographic Magnification Factor"};
constexpr DicomTag kTableMotion{0x0018, 0x1134, "Table Motion"};
constexpr DicomTag kTableVertical{0x0018, 0x1135, "Table Vertical Increment"};
constexpr DicomTag kTableLateral{0x0018, 0x1136, "Table Lateral Increment"};
constexpr DicomTag kTableLongitudinal{0x0018, 0x1137, "Table Longitudinal Increment"};
constexpr DicomTag kTableAngle{0x0018, 0x1138, "Table Angle"};
constexpr DicomTag kFieldDimensions{0x0018, 0x1149, "Field of View Dimension(s)"};
constexpr DicomTag kIntensifierSize{0x0018, 0x1162, "Intensifier Size"};
constexpr DicomTag kImagerSpacing{0x0018, 0x1164, "Imager Pixel Spacing"};
constexpr DicomTag kPositionerMotion{0x0018, 0x1500, "Positioner Motion"};
constexpr DicomTag kPrimary{0x0018, 0x1510, "Positioner Primary Angle"};
constexpr DicomTag kSecondary{0x0018, 0x1511, "Positioner Secondary Angle"};
constexpr DicomTag kPrimaryIncrement{0x0018, 0x1520, "Positioner Primary Angle Increment"};
constexpr DicomTag kSecondaryIncrement{0x0018, 0x1521, "Positioner Secondary Angle Increment"};
constexpr DicomTag kPatientPosition{0x0018, 0x5100, "Patient Position"};
constexpr DicomTag kElementSpacing{0x0018, 0x7022, "Detector Element Spacing"};
constexpr DicomTag kActiveDimensions{0x0018, 0x7026, "Detector Active Dimension(s)"};
constexpr DicomTag kActiveOrigin{0x0018, 0x7028, "Detector Active Origin"};
constexpr DicomTag kFieldOrigin{0x0018, 0x7030, "Field of View Origin"};
constexpr DicomTag kFieldRotation{0x0018, 0x7032, "Field of View Rotation"};
constexpr DicomTag kFieldFlip{0x0018, 0x7034, "Field of View Horizontal Flip"};
constexpr DicomTag kSourceIsocenter{0x0018, 0x9402, "Distance Source to Isocenter"};
constexpr DicomTag kIsocenterPrimary{0x0018, 0x9463, "Positioner Isocenter Primary Angle"};
constexpr DicomTag kIsocenterSecondary{0x0018, 0x9464, "Positioner Isocenter Secondary Angle"};
constexpr DicomTag kDetectorRotation{0x0018, 0x9465, "Positioner Isocenter Detector Rotation Angle"};
constexpr DicomTag kTableX{0x0018, 0x9466, "Table X Position to Isocenter"};
constexpr DicomTag kTableY{0x0018, 0x9467, "Table Y Position to Isocenter"};
constexpr DicomTag kTableZ{0x0018, 0x9468, "Table Z Position to Isocenter"};
constexpr DicomTag kTableRotation{0x0018, 0x9469, "Table Horizontal Rotation Angle"};
constexpr DicomTag kTableHeadTilt{0x0018, 0x9470, "Table Head Tilt Angle"};
constexpr DicomTag kTableCradleTilt{0x0018, 0x9471, "Table Cradle Tilt Angle"};
constexpr DicomTag kPatientOrientation{0x0020, 0x0020, "Patient Orientation"};
constexpr DicomTag kPixelSpacing{0x0028, 0x0030, "Pixel Spacing"};
constexpr DicomTag kCalibrationType{0x0028, 0x0A02, "Pixel Spacing Calibration Type"};
constexpr DicomTag kIntensityRelationship{0x0028, 0x1040, "Pixel Intensity Relationship"};
constexpr DicomTag kMaskOperation{0x0028, 0x6101, "Mask Operation"};
constexpr DicomTag kMaskFrames{0x0028, 0x6110, "Mask Frame Numbers"};

}  // namespace angio::io::tag
