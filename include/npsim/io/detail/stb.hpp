// SPDX-License-Identifier: Apache-2.0
// The one place that sees stb: PNG and JPEG decoding, and the zlib compressor, each with internal linkage and inside a
// namespace, so that a program needs no extra source file and may link its own stb as well.
//
// Only the PNG and JPEG decoders are compiled, without their SIMD paths: the same bits on every machine. Every single
// allocation of the decoder is bounded by stb_allocation_limit(), so that a compressed stream which inflates without
// end fails instead of filling the memory, and starts as zeros, because stb 2.27 reads Huffman tables that a damaged
// JPEG never defined. Its assertions are off: damaged data reaches them, and they guard no memory. Tables that are too
// long do overrun it, so check_jpeg_segments() has to run first.
#ifndef NPSIM_IO_DETAIL_STB_HPP
#define NPSIM_IO_DETAIL_STB_HPP

// Before the namespace opens: everything that stb includes.
#include <assert.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cstddef>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

// Bytes that one allocation of the decoder may take; per thread, set by the reader before each decode.
inline std::size_t& stb_allocation_limit() {
  thread_local std::size_t limit = std::size_t{1} << 30;
  return limit;
}
inline void* stb_allocate(std::size_t bytes) { return bytes > stb_allocation_limit() ? nullptr : calloc(1, bytes); }
inline void* stb_reallocate(void* old, std::size_t bytes) {
  return bytes > stb_allocation_limit() ? nullptr : realloc(old, bytes);
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#pragma push_macro("STBI_INCLUDE_STB_IMAGE_H")
#pragma push_macro("INCLUDE_STB_IMAGE_WRITE_H")
#undef STBI_INCLUDE_STB_IMAGE_H
#undef INCLUDE_STB_IMAGE_WRITE_H

#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_NO_SIMD
#define STBI_NO_LINEAR
#define STBI_MAX_DIMENSIONS 65536
#define STBI_ASSERT(condition) ((void)0)
#define STBI_MALLOC(bytes) ::npsim::io::detail::stb_allocate(bytes)
#define STBI_REALLOC(old, bytes) ::npsim::io::detail::stb_reallocate(old, bytes)
#define STBI_FREE(old) free(old)
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wdouble-promotion"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#endif

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {
namespace stb {
#if defined(__GNUC__)
// Coefficients of a damaged JPEG overflow int in the inverse transform. The sums end in a clamp to 0..255, so the
// harm is a wrong colour; sanitizers need not stop there.
static void stbi__idct_block(unsigned char* out, int out_stride, short data[64])
    __attribute__((no_sanitize("signed-integer-overflow")));
#endif
#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
}  // namespace stb
}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#undef STB_IMAGE_STATIC
#undef STB_IMAGE_IMPLEMENTATION
#undef STBI_ONLY_PNG
#undef STBI_ONLY_JPEG
#undef STBI_NO_STDIO
#undef STBI_NO_SIMD
#undef STBI_NO_LINEAR
#undef STBI_MAX_DIMENSIONS
#undef STBI_ASSERT
#undef STBI_MALLOC
#undef STBI_REALLOC
#undef STBI_FREE
#undef STB_IMAGE_WRITE_STATIC
#undef STB_IMAGE_WRITE_IMPLEMENTATION
#undef STBI_WRITE_NO_STDIO
#undef STBIDEF
#undef STBIWDEF
#pragma pop_macro("INCLUDE_STB_IMAGE_WRITE_H")
#pragma pop_macro("STBI_INCLUDE_STB_IMAGE_H")

#endif  // NPSIM_IO_DETAIL_STB_HPP
