// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

namespace angio::registration {

/// factorLower of n columns, each `stride` numbers after the one before. Asks for a processor with AVX2 and FMA.
bool factorLowerAvx2(double* columns, long n, long stride);

}  // namespace angio::registration
