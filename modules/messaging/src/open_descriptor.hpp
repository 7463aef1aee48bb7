// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <unistd.h>

#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

/// A file descriptor that is closed with this object; none when it is negative.
class OpenDescriptor {
 public:
  explicit OpenDescriptor(int descriptor) : descriptor_(descriptor) {}
  OpenDescriptor(const OpenDescriptor&) = delete;
  OpenDescriptor& operator=(const OpenDescriptor&) = delete;
  ~OpenDescriptor() {
    if (descriptor_ >= 0) close(descriptor_);
  }

  int get() const { return descriptor_; }

 private:
  const int descriptor_;
};

}  // namespace angio::messaging
