# SPDX-License-Identifier: GPL-2.0-or-later
# A header as Doxygen reads it: what is in a module's namespace is in the group of that name. Lines keep their numbers.
s|^namespace angio::\([a-z_]*\) {|& /** @addtogroup \1 */ /** @{ */|
s|^}  // namespace angio::[a-z_]*|/** @} */ }|
