// SPDX-License-Identifier: GPL-2.0-or-later
#include "settings.hpp"

#include <nlohmann/json.hpp>
#include <sstream>

#include "angio/base/errors.hpp"
#include "angio/io/settings_values.hpp"

namespace angio::python {

Json jsonOf(const py::handle& object, const std::string& field) {
  if (object.is_none()) return nullptr;
  if (py::isinstance<py::bool_>(object)) return object.cast<bool>();
  if (py::isinstance<py::int_>(object)) return object.cast<std::int64_t>();
  if (py::isinstance<py::float_>(object)) return object.cast<double>();
  if (py::isinstance<py::str>(object)) return object.cast<std::string>();
  if (py::hasattr(object, "tolist")) return jsonOf(object.attr("tolist")(), field);  // Numpy's.
  if (py::isinstance<py::dict>(object)) {
    Json json = Json::object();
    for (const auto& [key, value] : py::reinterpret_borrow<py::dict>(object)) {
      const auto name = py::str(key).cast<std::string>();
      json[name] = jsonOf(value, name);
    }
    return json;
  }
  if (py::isinstance<py::list>(object) || py::isinstance<py::tuple>(object)) {
    Json json = Json::array();
    for (const py::handle& item : object) json.push_back(jsonOf(item, field));
    return json;
  }
  throw InputError("settings", field, py::str(object).cast<std::string>(),
                   "must be a number, a text, a list or a dict");
}

py::object pythonOf(const Json& json) {
  switch (json.type()) {
    case Json::value_t::boolean:
      return py::bool_(json.get<bool>());
    case Json::value_t::number_integer:
      return py::int_(json.get<std::int64_t>());
    case Json::value_t::number_unsigned:
      return py::int_(json.get<std::uint64_t>());
    case Json::value_t::number_float:
      return py::float_(json.get<double>());
    case Json::value_t::string:
      return py::str(json.get<std::string>());
    case Json::value_t::array: {
      py::list list;
      for (const Json& item : json) list.append(pythonOf(item));
      return std::move(list);
    }
    case Json::value_t::object: {
      py::dict dict;
      for (const auto& [key, value] : json.items()) dict[py::str(key)] = pythonOf(value);
      return std::move(dict);
    }
    default:
      return py::none();
  }
}

void setFields(const py::object& given, const std::string& name,
               const std::function<void(SettingsVisitor&)>& visit_fields) {
  if (given.is_none()) return;
  std::ostringstream warnings;
  if (py::isinstance<py::dict>(given)) {
    setSettings(name, jsonOf(given, name), visit_fields, formerKeys(), warnings);
  } else {
    readSettings(py::str(given).cast<std::string>(), visit_fields, formerKeys(), warnings);
  }
  std::istringstream lines(warnings.str());
  for (std::string line; std::getline(lines, line);) {
    if (PyErr_WarnEx(PyExc_UserWarning, line.c_str(), 1) != 0) throw py::error_already_set();
  }
}

}  // namespace angio::python
