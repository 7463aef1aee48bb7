// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <string>
#include <vector>

#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"

extern char** environ;

namespace angio::test {

/// What became of a program.
struct Ended {
  int exit_code = -1;  ///< 128 and the signal's number when a signal ended it.
  std::string out, err;
};

/// A program of the build, running beside the test; `out_path` takes its stdout when a test wants it elsewhere.
class RunningProgram {
 public:
  RunningProgram(const std::string& name, const std::vector<std::string>& arguments, const std::string& out_path = "")
      : out_(out_path.empty() ? folder_.path("out") : out_path) {
    std::vector<std::string> words = {std::string(ANGIO_PROGRAMS) + "/" + name};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (auto& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, 1, out_.c_str(), O_WRONLY | O_CREAT, 0600);
    posix_spawn_file_actions_addopen(&files, 2, folder_.path("err").c_str(), O_WRONLY | O_CREAT, 0600);
    const int failure = posix_spawn(&id_, argv[0], &files, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (failure != 0) throw std::runtime_error("cannot start " + words[0]);
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;
  ~RunningProgram() {
    if (id_ == 0) return;
    kill(id_, SIGKILL);
    waitpid(id_, nullptr, 0);
  }

  void signal(int number) const { kill(id_, number); }

  /// Waits for its end.
  Ended end() {
    int status = 0;
    waitpid(id_, &status, 0);
    id_ = 0;
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    const bool a_file = std::filesystem::is_regular_file(out_);  // A device has no content to compare.
    return {code, a_file ? contentOf(out_) : "", contentOf(folder_.path("err"))};
  }

 private:
  TemporaryFolder folder_;
  std::string out_;
  pid_t id_ = 0;
};

/// Runs a program of the build to its end.
inline Ended run(const std::string& name, const std::vector<std::string>& arguments) {
  return RunningProgram(name, arguments).end();
}

}  // namespace angio::test
