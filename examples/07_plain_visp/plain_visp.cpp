// SPDX-License-Identifier: GPL-2.0-or-later
// How does a ViSP user drive the C-arm? As any vpRobot: servo() below knows nothing of this project. Without an
// argument the C-arm is simulated in this process and in simulated time; with a bus's URL it is whoever obeys
// CARM_COMMAND there: angio-simulate, 06_own_robot, or a real one.
#include <visp3/visual_features/vpFeatureThetaU.h>
#include <visp3/visual_features/vpFeatureTranslation.h>
#include <visp3/vs/vpServo.h>

#include <cstdio>
#include <functional>
#include <memory>
#include <thread>

#include "angio/geometry/visp.hpp"
#include "angio/robot/lcm_carm.hpp"
#include "angio/simulation/nodes.hpp"

namespace {

// Position-based servoing of a camera on a robot: fMo is where the object is, cdMo how it shall be seen. Returns the
// error's norm at the end.
double servo(vpRobot& robot, const vpHomogeneousMatrix& fMo, const vpHomogeneousMatrix& cdMo, int steps,
             const std::function<void()>& wait) {
  vpFeatureTranslation t(vpFeatureTranslation::cdMc);
  vpFeatureThetaU tu(vpFeatureThetaU::cdRc);
  vpServo task;
  task.setServo(vpServo::EYEINHAND_L_cVe_eJe);
  task.setInteractionMatrixType(vpServo::CURRENT, vpServo::PSEUDO_INVERSE);
  task.set_cVe(vpVelocityTwistMatrix());  // The end effector is the camera.
  task.setLambda(1.5);
  task.addFeature(t);
  task.addFeature(tu);
  robot.setRobotState(vpRobot::STATE_VELOCITY_CONTROL);
  for (int k = 0; k < steps; ++k) {
    vpColVector place;
    vpMatrix eJe;
    robot.getPosition(vpRobot::REFERENCE_FRAME, place);
    robot.get_eJe(eJe);
    const vpHomogeneousMatrix fMc(vpPoseVector(place[0], place[1], place[2], place[3], place[4], place[5]));
    const vpHomogeneousMatrix cdMc = cdMo * (fMc.inverse() * fMo).inverse();
    t.buildFrom(cdMc);
    tu.buildFrom(cdMc);
    task.set_eJe(eJe);
    robot.setVelocity(vpRobot::ARTICULAR_FRAME, task.computeControlLaw());
    wait();
  }
  robot.setRobotState(vpRobot::STATE_STOP);
  return task.getError().frobeniusNorm();
}

int run(const std::string& url) {
  using namespace angio::lab;
  using namespace angio::robot;
  constexpr std::int64_t kPeriod_us = 40'000;
  const bool simulated = url == "memq://";
  const CArmGeometry carm;
  const CArmLimits limits = CArmLimits::typical();
  const auto bus = openBus(url);
  std::unique_ptr<SimulatedCArmNode> arm;
  std::int64_t now_us = 0;
  if (simulated) arm = std::make_unique<SimulatedCArmNode>(*bus, limits, CArmJoints::Zero(), now_us);
  LcmCArm robot(carm, limits, *bus, std::chrono::microseconds(5 * kPeriod_us));
  const auto wait = [&] {
    if (!simulated) {
      std::this_thread::sleep_for(std::chrono::microseconds(kPeriod_us));
      return;
    }
    bus->handle(std::chrono::milliseconds(0));
    arm->listen(now_us);
    arm->report(now_us += kPeriod_us);
  };
  for (int tries = 0; tries < 100 && !robot.state(); ++tries) wait();  // Until somebody says where the arm is.

  CArmJoints wanted;
  wanted << degToRad(20), degToRad(-10), 0.02, 0, -0.03;
  const vpHomogeneousMatrix fMo;
  const double error = servo(robot, fMo, toVisp(carm.T_camera_patient(wanted)), 200, wait);
  vpColVector q;
  robot.getPosition(vpRobot::ARTICULAR_FRAME, q);
  std::printf("error %.5f; at %.2f %.2f deg, table %.1f %.1f %.1f mm\n", error, vpMath::deg(q[0]), vpMath::deg(q[1]),
              1e3 * q[2], 1e3 * q[3], 1e3 * q[4]);
  return error < 1e-2 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 2 || (argc == 2 && argv[1][0] == '-')) {
    std::printf(
        "Usage: example-07-plain-visp [BUS]\n\nMoves a C-arm by plain ViSP. BUS: an LCM URL; without it a "
        "simulated arm in this process.\n");
    return argc == 2 && std::string(argv[1]) == "--help" ? 0 : 2;
  }
  try {
    return run(argc > 1 ? argv[1] : "memq://");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "example-07-plain-visp: %s\n", error.what());
    return 1;
  }
}
