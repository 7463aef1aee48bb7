// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <type_traits>

#include "angio/types/model_id.hpp"
#include "arrays.hpp"

namespace angio::python {

/// How Python sees the fields of plain values: poses as 4 x 4 arrays, points as rows, images as arrays, ids as numbers.
/// What is not listed here, pybind11 knows.
template <typename Field>
struct AsPython {
  static const Field& toPython(const Field& field) { return field; }
  static Field fromPython(const Field& value, const std::string&) { return value; }
  using Given = Field;
};
template <>
struct AsPython<Pose> {
  static Numbers toPython(const Pose& T) { return arrayOf(T); }
  static Pose fromPython(const Numbers& array, const std::string& field) { return poseOf(array, field); }
  using Given = Numbers;
};
template <>
struct AsPython<std::optional<Pose>> {
  static std::optional<Numbers> toPython(const std::optional<Pose>& T) {
    return T ? std::optional(arrayOf(*T)) : std::nullopt;
  }
};
template <>
struct AsPython<ModelId> {
  static std::int64_t toPython(ModelId id) { return static_cast<std::int64_t>(id); }
  static ModelId fromPython(std::int64_t id, const std::string&) { return ModelId{id}; }
  using Given = std::int64_t;
};
template <>
struct AsPython<cv::Mat> {
  static py::object toPython(const cv::Mat& image) { return arrayOf(image); }
  static cv::Mat fromPython(const py::array& array, const std::string& field) { return imageOf(array, field); }
  using Given = py::array;
};
template <typename Scalar, int Rows>
struct AsPython<Eigen::Matrix<Scalar, Rows, Eigen::Dynamic>> {
  using Given = py::array_t<Scalar, py::array::c_style | py::array::forcecast>;
  static py::array_t<Scalar> toPython(const Eigen::Matrix<Scalar, Rows, Eigen::Dynamic>& points) {
    return rowsOf<Rows, Scalar>(points);
  }
  static auto fromPython(const Given& rows, const std::string& field) { return pointsOf<Rows, Scalar>(rows, field); }
};

/// A class of Python for a struct, field by field, with the comments of its header.
template <typename Struct>
class BoundStruct {
 public:
  BoundStruct(py::module_& m, const char* name) : name_(name), class_(m, name, doc(name)) {}

  /// A field that can be read and set.
  template <typename Field>
  BoundStruct& field(const char* name, Field Struct::*member) {
    using As = AsPython<Field>;
    const std::string full = std::string(name_) + "." + name;
    if constexpr (std::is_same_v<decltype(As::toPython(std::declval<const Field&>())), const Field&>) {
      class_.def_readwrite(name, member, fieldDoc(full));
    } else {
      class_.def_property(
          name, [member](const Struct& s) { return As::toPython(s.*member); },
          [member, full](Struct& s, const typename As::Given& given) { s.*member = As::fromPython(given, full); },
          fieldDoc(full));
    }
    return *this;
  }

  /// A field that can be read.
  template <typename Field>
  BoundStruct& shows(const char* name, Field Struct::*member) {
    const std::string full = std::string(name_) + "." + name;
    class_.def_property_readonly(
        name, [member](const Struct& s) { return AsPython<Field>::toPython(s.*member); }, fieldDoc(full));
    return *this;
  }

  /// A constructor that takes fields by name; the others have the default value's.
  template <typename Default>
  BoundStruct& takesFields(const Default& make) {
    class_.def(py::init([make, name = std::string(name_)](const py::kwargs& fields) {
                 Struct value = make();
                 const py::object self = py::cast(&value, py::return_value_policy::reference);
                 for (const auto& [key, given] : fields) {
                   if (!py::hasattr(self, key)) {
                     throw py::type_error(name + " has no field '" + key.template cast<std::string>() + "'");
                   }
                   py::setattr(self, key, given);
                 }
                 return value;
               }),
               "Fields by their names; the others keep their defaults.");
    class_.def("__copy__", [](const Struct& s) { return s; });
    class_.def("__deepcopy__", [](const Struct& s, const py::dict&) { return s; });
    return *this;
  }
  BoundStruct& takesFields() {
    return takesFields([] { return Struct{}; });
  }

  py::class_<Struct>& get() { return class_; }

 private:
  const char* name_;
  py::class_<Struct> class_;
};

}  // namespace angio::python
