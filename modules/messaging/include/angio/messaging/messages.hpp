// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

// What the bus carries, in our own types. On the wire these are the .lcm types of the same meaning.
#include "angio/types/any_message.hpp"
// modelId() and cropped(), which callers of these types use beside them.
#include "angio/imaging/xray_frame.hpp"
#include "angio/vessel/model_id.hpp"
