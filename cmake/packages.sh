# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# Sourced by samples/run, tests/run and bench/run: what they need, and how it is installed on Debian and Ubuntu.

npsim_tool_packages=(g++ cmake ninja-build libxsimd-dev libcli11-dev nlohmann-json3-dev libstb-dev libtinyobjloader-dev)
npsim_test_packages=(doctest-dev pkg-config libeigen3-dev libembree-dev libopenimageio-dev)
npsim_bench_packages=(libbenchmark-dev libembree-dev libmeshoptimizer-dev libopencv-contrib-dev python3-torch
                      python3-numpy)

# Installs those of the named packages that are missing; without apt-get or the right to use it, says which and stops.
npsim_require_packages() {
  local package missing=() admin=()
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    npsim_print_packages "This is neither Debian nor Ubuntu. Install what these packages hold there:" "$@"
    exit 1
  fi
  for package in "$@"; do
    # pkgconf stands for pkg-config on newer systems: a package that another one provides counts as installed.
    if ! npsim_is_installed "$package"; then missing+=("$package"); fi
  done
  if ((${#missing[@]} == 0)); then return; fi
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
      npsim_print_packages "Neither root nor sudo. Have these packages installed, then run this again:" "${missing[@]}"
      exit 1
    fi
    admin=(sudo)
  fi
  echo "Installing: ${missing[*]}"
  "${admin[@]}" apt-get update -qq
  "${admin[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
}

npsim_is_installed() {
  dpkg-query -W -f='${db:Status-Status} ${Package} ${Provides}\n' 2>/dev/null |
    awk -v want="$1" '$1 == "installed" { gsub(",", " "); for (i = 2; i <= NF; ++i) if ($i == want) found = 1 }
                      END { exit !found }'
}

npsim_print_packages() {
  echo "$1" >&2
  shift
  printf '  %s\n' "$@" >&2
}
