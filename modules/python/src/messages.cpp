// SPDX-License-Identifier: GPL-2.0-or-later
#include <tuple>

#include "angio/messaging/any_message.hpp"
#include "angio/types/channels.hpp"
#include "fields.hpp"
#include "message_types.hpp"

namespace angio::python {
namespace {

// What every message can do beside its fields: bytes of the wire there and back, one line of text, equality, pickling.
template <typename Message>
void addWire(BoundStruct<Message>& bound) {
  const auto bytesOf = [](const Message& m) {
    const auto bytes = encode(m);
    return py::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  const auto messageOf = [](const py::bytes& bytes) {
    const std::string_view view = bytes;
    auto decoded = decode<Message>(reinterpret_cast<const std::uint8_t*>(view.data()), view.size());
    if (!decoded.value) throw InputError("", "", "", decoded.error);
    return std::move(*decoded.value);
  };
  bound.get()
      .def("encode", bytesOf,
           "The bytes of the message as its .lcm type lays them out. Throws InputError on what must never go on the "
           "wire.")
      .def_static("decode", messageOf,
                  "Reads one message from bytes that may come from anywhere. Throws InputError that says why there is "
                  "none.",
                  "data"_a)
      .def(
          "__eq__",
          [](const Message& a, const py::object& b) {
            return py::isinstance<Message>(b) && encode(a) == encode(b.cast<const Message&>());
          },
          py::is_operator())
      .def("__repr__", [](const Message& m) { return "<angio." + nameOfMessage<Message>() + ": " + describe(m) + ">"; })
      .def(py::pickle(bytesOf, messageOf));
}

void bindEnums(py::module_& m) {
  py::enum_<ServoRequestKind>(m, "ServoRequestKind", "What an operator asks of a loop.")
      .value("stop", ServoRequestKind::kStop)
      .value("arm", ServoRequestKind::kArm)
      .value("start", ServoRequestKind::kStart)
      .value("reset", ServoRequestKind::kReset)
      .value("emergency_stop", ServoRequestKind::kEmergencyStop);
  py::enum_<ServoVerdict>(m, "ServoVerdict", doc("ServoVerdict"))
      .value("permitted", ServoVerdict::kPermitted)
      .value("taken_back", ServoVerdict::kTakenBack)
      .value("refused", ServoVerdict::kRefused);
  py::enum_<CatheterTipStatus>(m, "CatheterTipStatus", "Whether a catheter's tip was found.")
      .value("lost", CatheterTipStatus::kLost)
      .value("ambiguous", CatheterTipStatus::kAmbiguous)
      .value("located", CatheterTipStatus::kLocated);
  py::enum_<ServoState>(m, "ServoState", doc("ServoState"))
      .value("hold", ServoState::kHold, doc("ServoState.kHold"))
      .value("servo", ServoState::kServo, doc("ServoState.kServo"))
      .value("idle", ServoState::kIdle, doc("ServoState.kIdle"))
      .value("armed", ServoState::kArmed, doc("ServoState.kArmed"))
      .value("fault", ServoState::kFault, doc("ServoState.kFault"))
      .value("emergency_stop", ServoState::kEmergencyStop, doc("ServoState.kEmergencyStop"));
  py::enum_<ServoCause>(m, "ServoCause", doc("ServoCause"))
      .value("none", ServoCause::kNone)
      .value("stop_requested", ServoCause::kStopRequested)
      .value("arm_requested", ServoCause::kArmRequested)
      .value("start_requested", ServoCause::kStartRequested)
      .value("reset_requested", ServoCause::kResetRequested)
      .value("emergency_stop_requested", ServoCause::kEmergencyStopRequested)
      .value("frames_trusted", ServoCause::kFramesTrusted)
      .value("frame_doubted", ServoCause::kFrameDoubted)
      .value("frames_late", ServoCause::kFramesLate)
      .value("frames_gone", ServoCause::kFramesGone)
      .value("view_disagrees", ServoCause::kViewDisagrees)
      .value("clock_jumped", ServoCause::kClockJumped)
      .value("joints_not_finite", ServoCause::kJointsNotFinite)
      .value("joints_implausible", ServoCause::kJointsImplausible)
      .value("joint_limit_broken", ServoCause::kJointLimitBroken)
      .value("motion_disagrees", ServoCause::kMotionDisagrees)
      .value("second_sender", ServoCause::kSecondSender);
}

template <typename Message>
BoundStruct<Message> message(py::module_& m) {
  static const std::string kName = nameOfMessage<Message>();
  BoundStruct<Message> bound(m, kName.c_str());
  if constexpr (std::is_default_constructible_v<Message>) bound.takesFields();
  addWire(bound);
  return bound;
}

void bindFrame(py::module_& m) {
  auto frame = message<XrayFrame>(m);
  frame.field("time_us", &XrayFrame::time_us)
      .field("sequence", &XrayFrame::sequence)
      .field("image", &XrayFrame::image)
      .field("camera", &XrayFrame::camera);
  frame.get().def(
      py::init([](const py::array& image, const XrayCamera& camera, std::int64_t time_us, std::int64_t sequence) {
        return XrayFrame{time_us, sequence, imageOf(image, "image"), camera};
      }),
      "A frame of height x width pixels of uint8 or uint16, the size of the camera's detector.", "image"_a, "camera"_a,
      py::kw_only(), "time_us"_a = 0, "sequence"_a = 0);
}

void bindCArmMessages(py::module_& m) {
  message<CArmState>(m)
      .field("time_us", &CArmState::time_us)
      .field("sequence", &CArmState::sequence)
      .field("joints", &CArmState::joints)
      .field("velocity", &CArmState::velocity);
  message<CArmCommand>(m)
      .field("time_us", &CArmCommand::time_us)
      .field("sequence", &CArmCommand::sequence)
      .field("frame_sequence", &CArmCommand::frame_sequence)
      .field("valid_for_us", &CArmCommand::valid_for_us)
      .field("velocity", &CArmCommand::velocity);
  message<ViewRequest>(m)
      .field("time_us", &ViewRequest::time_us)
      .field("sequence", &ViewRequest::sequence)
      .field("model_id", &ViewRequest::model_id)
      .field("beam_model", &ViewRequest::beam_model)
      .field("target_model", &ViewRequest::target_model)
      .field("within_rad", &ViewRequest::within_rad)
      .field("within_m", &ViewRequest::within_m)
      .field("reason", &ViewRequest::reason);
  message<ServoInput>(m)
      .field("time_us", &ServoInput::time_us)
      .field("frame_sequence", &ServoInput::frame_sequence)
      .field("state", &ServoInput::state)
      .field("verdict", &ServoInput::verdict)
      .field("view", &ServoInput::view);
}

void bindLoopMessages(py::module_& m) {
  message<ServoRequest>(m)
      .field("time_us", &ServoRequest::time_us)
      .field("sequence", &ServoRequest::sequence)
      .field("status_time_us", &ServoRequest::status_time_us)
      .field("transitions", &ServoRequest::transitions)
      .field("request", &ServoRequest::request);
  message<ServoSession>(m)
      .field("time_us", &ServoSession::time_us)
      .field("sequence", &ServoSession::sequence)
      .field("session", &ServoSession::session)
      .field("command_sequence", &ServoSession::command_sequence);
  message<ServoStatus>(m)
      .field("time_us", &ServoStatus::time_us)
      .field("frame_sequence", &ServoStatus::frame_sequence)
      .field("state", &ServoStatus::state)
      .field("reason", &ServoStatus::reason)
      .field("transitions", &ServoStatus::transitions)
      .field("transition_time_us", &ServoStatus::transition_time_us)
      .field("cause", &ServoStatus::cause)
      .field("view_error_rad", &ServoStatus::view_error_rad)
      .field("target_error_m", &ServoStatus::target_error_m)
      .field("view_reached_us", &ServoStatus::view_reached_us)
      .field("image_us", &ServoStatus::image_us)
      .field("registration_us", &ServoStatus::registration_us)
      .field("control_us", &ServoStatus::control_us);
  message<RegistrationMessage>(m)
      .field("time_us", &RegistrationMessage::time_us)
      .field("frame_sequence", &RegistrationMessage::frame_sequence)
      .field("model_id", &RegistrationMessage::model_id)
      .field("status", &RegistrationMessage::status)
      .field("status_text", &RegistrationMessage::status_text)
      .field("T_camera_model", &RegistrationMessage::T_camera_model)
      .field("covariance", &RegistrationMessage::covariance)
      .field("mean_residual_px", &RegistrationMessage::mean_residual_px)
      .field("points_3d", &RegistrationMessage::points_3d)
      .field("points_2d", &RegistrationMessage::points_2d);
  message<RegistrationPoints>(m)
      .field("time_us", &RegistrationPoints::time_us)
      .field("frame_sequence", &RegistrationPoints::frame_sequence)
      .field("model_id", &RegistrationPoints::model_id)
      .field("covariance", &RegistrationPoints::covariance);
}

void bindCatheterMessages(py::module_& m) {
  message<CatheterState>(m)
      .field("time_us", &CatheterState::time_us)
      .field("sequence", &CatheterState::sequence)
      .field("insertion_m", &CatheterState::insertion_m)
      .field("roll_rad", &CatheterState::roll_rad)
      .field("bend_rad", &CatheterState::bend_rad)
      .field("insertion_speed_m_per_s", &CatheterState::insertion_speed_m_per_s)
      .field("roll_speed_rad_per_s", &CatheterState::roll_speed_rad_per_s)
      .field("bend_speed_rad_per_s", &CatheterState::bend_speed_rad_per_s)
      .field("insertion_force_n", &CatheterState::insertion_force_n);
  message<CatheterCommand>(m)
      .field("time_us", &CatheterCommand::time_us)
      .field("sequence", &CatheterCommand::sequence)
      .field("frame_sequence", &CatheterCommand::frame_sequence)
      .field("valid_for_us", &CatheterCommand::valid_for_us)
      .field("insertion_speed_m_per_s", &CatheterCommand::insertion_speed_m_per_s)
      .field("roll_speed_rad_per_s", &CatheterCommand::roll_speed_rad_per_s)
      .field("bend_speed_rad_per_s", &CatheterCommand::bend_speed_rad_per_s);
  message<CatheterTip>(m)
      .field("time_us", &CatheterTip::time_us)
      .field("frame_sequence", &CatheterTip::frame_sequence)
      .field("model_id", &CatheterTip::model_id)
      .field("status", &CatheterTip::status)
      .field("tip_model", &CatheterTip::tip_model)
      .field("covariance", &CatheterTip::covariance)
      .field("branch", &CatheterTip::branch)
      .field("tree_point", &CatheterTip::tree_point)
      .field("arc_length_m", &CatheterTip::arc_length_m)
      .field("probability", &CatheterTip::probability)
      .field("reason", &CatheterTip::reason);
  message<CatheterInput>(m)
      .field("time_us", &CatheterInput::time_us)
      .field("frame_sequence", &CatheterInput::frame_sequence)
      .field("verdict", &CatheterInput::verdict)
      .field("arm", &CatheterInput::arm)
      .field("drive", &CatheterInput::drive)
      .field("view_reached_us", &CatheterInput::view_reached_us);
}

}  // namespace

void bindMessages(py::module_& m) {
  bindEnums(m);
  bindFrame(m);
  bindCArmMessages(m);
  bindLoopMessages(m);
  bindCatheterMessages(m);
  // A message that is added to AnyMessage and not here has no class, and this fails the module's import.
  py::list all;
  forEachMessage([&](auto tag) { all.append(py::type::of<typename decltype(tag)::Message>()); });
  m.attr("MESSAGES") = py::tuple(all);
}

}  // namespace angio::python
