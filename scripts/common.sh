# Sourced by scripts/build, scripts/run and scripts/test: environment, progress, packages, build.
# Sets root (of the repository) and build (its only build directory).

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/.build
logs=$build/log
mkdir -p "$logs" "$build/ros"

# the system's tools and Python before any other; no other workspace, no strange locale
export PATH=/usr/bin:/bin:/usr/sbin:/sbin${PATH:+:$PATH}
export LC_ALL=C.UTF-8 ROS_HOSTNAME=localhost ROS_HOME=$build/ros ROS_LOG_DIR=$build/ros/log
unset CMAKE_PREFIX_PATH ROS_PACKAGE_PATH ROS_MASTER_URI ROS_IP PYTHONPATH PYTHONHOME
if [ -z "${HOME:-}" ] || [ ! -w "$HOME" ]; then
  export HOME=$build/home
  mkdir -p "$HOME"
fi
export MPLCONFIGDIR=$build/matplotlib
# the same cache serves every checkout, but for what clang compiles with precompiled headers: these name their checkout
export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1

say() { printf '[%(%H:%M:%S)T] %s\n' -1 "$*" >&2; }

# fail STEP LOG [LINES]: names the step and the log, shows the first errors in the log
fail() {
  if [ -f "$2" ]; then
    grep -aE 'FATAL|ERROR|[Ee]rror:|^E:|FAILED|^cell_urdf:' "$2" | sed 's/\x1b\[[0-9;]*m//g' | head -n "${3:-5}" >&2 || true
  fi
  say "FAILED: $1. Log: $2"
  exit 1
}

# packages.txt, or what is read in its place, for this release of Debian
wanted_packages() {
  local release
  release=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
  sed 's/#.*//' "${1:-$root/scripts/packages.txt}" | awk -v release="$release" 'NF == 1 || $2 == release { print $1 }'
}

# what of packages.txt is not installed
missing_packages() {
  local wanted
  wanted=$(wanted_packages)
  # shellcheck disable=SC2086
  comm -13 <(dpkg-query -W -f='${Package} ${db:Status-Status}\n' $wanted 2>/dev/null |
    sed -n 's/ installed$//p' | sort -u) <(printf '%s\n' "$wanted" | sort -u) | xargs
}

install_packages() {
  local missing sudo=() log=$logs/install.log
  missing=$(missing_packages)
  [ -n "$missing" ] || return 0
  if [ "$(id -u)" -ne 0 ]; then
    sudo=(sudo)
    if ! command -v sudo >/dev/null; then
      say "FAILED: install packages: neither root nor sudo. As root: apt-get install $missing"
      exit 1
    fi
  fi
  say "installing $missing (log: $log)"
  local apt=("${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -y)
  "${apt[@]}" update >"$log" 2>&1 </dev/null || fail "update the package lists" "$log"
  # shellcheck disable=SC2086
  "${apt[@]}" install --no-install-recommends $missing >>"$log" 2>&1 </dev/null ||
    fail "install packages" "$log"
}

# announce LAST: what is about to be done and how much disk it takes; how long the build takes is known once it runs
announce() {
  local missing steps=()
  missing=$(missing_packages | wc -w)
  if [ "$missing" -gt 0 ]; then
    steps+=("install $missing of Debian's packages and what they need (up to 0.5 GB to fetch, 2 GB of disk)")
  fi
  if [ -f "$build/build.ninja" ]; then
    steps+=("build what has changed")
  else
    steps+=("build in .build (0.5 GB of disk; the time left is shown while it runs)")
  fi
  say "to do: $(printf '%s, ' "${steps[@]}")$1"
}

# show_progress FILES: how far ninja's output (standard input) has come, one line on a terminal, else one every 10 s; and the
# time left, from the pace at which this machine has compiled: FILES are to be compiled in all
show_progress() {
  local line files=$1 compiled=0 begun=0 left shown=-10 last="" printed="" terminal=false
  if [ -t 2 ]; then terminal=true; fi
  while IFS= read -r line; do
    # ninja itself looks for new files first
    [[ $line =~ ^\[([1-9][0-9]*)/([0-9]+)\] ]] || continue
    last="${BASH_REMATCH[1]} of ${BASH_REMATCH[2]}"
    # catkin looks at each message again, also when nothing has changed
    [[ $line != *genmsg_check_deps.py* ]] || continue
    # the pace is known after the first file
    if [[ $line == *" Building CXX "* ]] && ((compiled++ == 0)); then begun=$SECONDS; fi
    left=
    if ((compiled > 1 && compiled < files && SECONDS > begun)); then
      left=$(((SECONDS - begun) * (files - compiled) / (compiled - 1)))
      if ((left < 60)); then left=", less than a minute left"; else left=", about $(((left + 30) / 60)) min left"; fi
    fi
    if $terminal; then
      printf '\r\e[K[%(%H:%M:%S)T] built %s' -1 "$last$left" >&2
    elif [ $((SECONDS - shown)) -ge 10 ]; then
      say "built $last$left"
      printed=$last
      shown=$SECONDS
    fi
  done
  if $terminal; then
    printf '\r\e[K[%(%H:%M:%S)T] built %s\n' -1 "${last:-all}" >&2
  elif [ -n "$printed" ] && [ "$printed" != "$last" ]; then
    say "built $last"
  fi
}

# build TARGET...: configures when needed, builds what has changed
build() {
  local log=$logs/configure.log
  # rosrun looks everywhere in the package's folder but in build/, roslaunch everywhere but where a name begins with a dot
  local prefix=$root/build/.install
  if ! grep -qsF "CMAKE_HOME_DIRECTORY:INTERNAL=$root" "$build/CMakeCache.txt" ||
    [ ! -f "$build/build.ninja" ]; then
    rm -rf "$build/CMakeCache.txt" "$build/CMakeFiles" "$build/devel"
  fi
  if ! grep -qsxF "CMAKE_INSTALL_PREFIX:PATH=$prefix" "$build/CMakeCache.txt"; then
    say "configuring (log: $log)"
    # clang takes three quarters of GCC's time and makes faster programs; another compiler by CXX
    CXX=${CXX:-$(command -v clang++-14 || command -v clang++-19 || command -v c++)} cmake -S "$root" -B "$build" -G Ninja -DCATKIN_ENABLE_TESTING=ON -DASSEMBLY_CELL_WERROR=ON -DASSEMBLY_CELL_UNITY=ON \
      -DCMAKE_INSTALL_PREFIX="$prefix" >"$log" 2>&1 </dev/null || fail "configure" "$log"
  fi
  log=$logs/build.log
  say "building (log: $log)"
  (
    set -o pipefail
    files=$(ninja -C "$build" -n "$@" 2>/dev/null </dev/null | grep -c " Building CXX " || true)
    cmake --build "$build" -j"$(nproc)" --target "$@" 2>&1 </dev/null | tee "$log" | show_progress "$files"
  ) || fail "build" "$log"
  set +u
  # shellcheck disable=SC1091
  . "$build/devel/setup.bash"
  set -u
}
