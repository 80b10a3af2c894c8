// SPDX-License-Identifier: Apache-2.0
#include "npsim/npsim.hpp"

static_assert(__cplusplus > 201703L, "this file is compiled as C++20");
