// SPDX-License-Identifier: Apache-2.0
// Measured luminaires from files: IES LM-63 (.ies) and EULUMDAT (.ldt), told apart by the name's ending.
//
// The result owns the table that light/emitter.hpp evaluates; see detail/ies.hpp and detail/eulumdat.hpp for
// what of each format is read. Faults name file, line and field. Memory: a table of 1 MB and text of 4 MB at most,
// whatever a file claims.
#ifndef NPSIM_IO_LUMINAIRE_HPP
#define NPSIM_IO_LUMINAIRE_HPP

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "npsim/io/detail/eulumdat.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/ies.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/luminaire_planes.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// turn_deg: by which the luminaire is turned about its axis, counter-clockwise seen from above.
inline Expected<Luminaire> read_luminaire(const std::string& path, double turn_deg = 0.0,
                                          const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Luminaire> {
    std::string ending = std::filesystem::path(path).extension().string();
    for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    if (ending != ".ies" && ending != ".ldt") {
      return Error{path, "", "is no luminaire file by its name, expected .ies (IES LM-63) or .ldt (EULUMDAT)"};
    }
    ReadLimits small = limits;
    small.max_bytes = std::min(limits.max_bytes, std::size_t{1} << 22);
    const Expected<Bytes> bytes = read_file_bytes(path, small);
    if (!bytes) return bytes.error();
    const std::string text(bytes.value().begin(), bytes.value().end());
    return ending == ".ies" ? detail::parse_ies(path, text, turn_deg) : detail::parse_eulumdat(path, text, turn_deg);
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_LUMINAIRE_HPP
