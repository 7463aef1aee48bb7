// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate-loop: many simulated runs of each task, and what became of them.
#include "angio/cli/program.hpp"
#include "simulate_loop.hpp"

int main(int argc, char** argv) {
  CLI::App app("Runs the tasks in closed loops against the simulated lab, many times, and says how they ended.",
               "angio-simulate-loop");
  angio::apps::describeProgram(app, "angio-simulate-loop view --runs 100 --threads 2 --out views.json");
  app.require_subcommand(1);
  angio::apps::Work work;
  angio::apps::addSimulateView(app, work);
  angio::apps::addSimulateNavigate(app, work);
  angio::apps::addSimulateFaults(app, work);
  angio::apps::addSimulateCenter(app, work);
  return angio::apps::runProgram(app, argc, argv, [&] { return work(); });
}
