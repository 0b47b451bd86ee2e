# How everything is compiled: build type, warnings, compiler cache.

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "Build type" FORCE)
endif()
# compressed line tables: enough for a stack trace, a tenth of the size of full debug information
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g1 -gz -DNDEBUG")
if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
  # valgrind 3.19 can't read clang's version 5; before -g1, which would otherwise mean full debug information
  string(PREPEND CMAKE_CXX_FLAGS_RELWITHDEBINFO "-gdwarf-4 ")
endif()
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
# installed programs find the package's libraries without an environment
set(CMAKE_INSTALL_RPATH $ORIGIN $ORIGIN/..)

find_program(CCACHE ccache)
if(CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # the settings that ccache requires with precompiled headers
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
    CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${CCACHE})
endif()

add_compile_options(-Wall -Wextra -Wpedantic -Wshadow -Wconversion)
# one setting for libraries and executables, which share precompiled headers
add_compile_options(-fPIC)
# errno is never read after a square root: roots inline, sine and cosine in one call
add_compile_options(-fno-math-errno)
# calls within a library are bound directly
add_link_options(-Wl,-Bsymbolic-functions)
if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
  # clang's -Wconversion includes changes of sign
  add_compile_options(-Wno-sign-conversion)
  # ccache identifies a precompiled header by its content
  add_compile_options("SHELL:-Xclang -fno-pch-timestamp")
elseif(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  add_compile_options(-fpch-preprocess)
  # most files compile in less than 512 MB: without garbage collection below that, a twelfth of the time is saved
  add_compile_options("SHELL:--param ggc-min-heapsize=524288")
endif()
if(ASSEMBLY_CELL_WERROR)
  add_compile_options(-Werror)
endif()
if(ASSEMBLY_CELL_UNITY AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # false positives: a copied optional without a matrix, anonymous namespaces of several files; with GCC 14 and
  # _FORTIFY_SOURCE the buffer of boost::function that actionlib copies. Clang looks at all of them.
  add_compile_options(-Wno-maybe-uninitialized -Wno-uninitialized -Wno-subobject-linkage)
endif()

# the precompiled header of the core and its tests
set(precompiled ${PROJECT_SOURCE_DIR}/include/assembly_cell/math/decompositions.h <yaml-cpp/yaml.h>
  <algorithm> <array> <atomic> <chrono> <cmath> <complex> <cstdint> <cstdio> <filesystem> <fstream> <functional>
  <iostream> <limits> <map> <memory> <mutex> <optional> <random> <sstream> <string> <thread> <vector>)
