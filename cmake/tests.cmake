# Tests: built by the target `tests`, run by ctest.

find_package(roslaunch REQUIRED)
find_package(rostest REQUIRED)
# the package's files and executables, for tests
set(test_definitions ASSEMBLY_CELL_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
  ASSEMBLY_CELL_BIN_DIR="${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION}")
# Most tests are small against what they call: optimising them would take longer than they run. Hidden, their templates
# don't replace our libraries' own.
set(test_options_plain -O0 -g0 -fvisibility=hidden)
set(test_options_computing "")
foreach(kind plain computing)
  add_library(tests_${kind} OBJECT EXCLUDE_FROM_ALL test/support/allocations.cpp)
  target_link_libraries(tests_${kind} PRIVATE assembly_cell_core)
  target_compile_definitions(tests_${kind} PRIVATE GTEST_HAS_PTHREAD=1)  # as every test has it from catkin
  target_compile_options(tests_${kind} PRIVATE ${test_options_${kind}})
  target_precompile_headers(tests_${kind} PRIVATE ${precompiled} <gtest/gtest.h>)
endforeach()

# How ctest runs a test of this directory: none may hang, ROS's scripts need the system's Python, and no test writes into the home directory. scripts/test has
# ctest count halves of a processor: a test takes two, one that mostly WAITS for a clock, a node or a timeout one. COST:
# tests of a higher cost start first. LONG: only with scripts/test --long; HOURS: it may take hours.
function(test_properties name)
  cmake_parse_arguments(test "WAITS;LONG;HOURS" "COST" "" ${ARGN})
  set_tests_properties(${name} PROPERTIES TIMEOUT 1200 PROCESSORS 2 ENVIRONMENT_MODIFICATION "PATH=path_list_prepend:/usr/bin;ROS_HOME=set:${CMAKE_BINARY_DIR}/ros")
  if(test_WAITS)
    set_tests_properties(${name} PROPERTIES PROCESSORS 1)
  endif()
  if(test_COST)
    set_tests_properties(${name} PROPERTIES COST ${test_COST})
  endif()
  if(test_HOURS)
    set_tests_properties(${name} PROPERTIES TIMEOUT 36000 LABELS long)
  endif()
endfunction()

# check(NAME [WAITS] [LONG] [HOURS] [COST n] COMMAND ...): a program that runs in the package's folder and fails by its exit code.
function(check name)
  cmake_parse_arguments(check "WAITS;LONG;HOURS" "COST" "COMMAND" ${ARGN})
  set(configurations "")
  if(check_LONG OR check_HOURS)
    set(configurations CONFIGURATIONS Long)
  endif()
  add_test(NAME ${name} ${configurations} COMMAND ${check_COMMAND} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  list(REMOVE_AT ARGV 0)
  test_properties(${name} ${ARGV})
endfunction()

# add_core_tests(FOLDER [COMPUTING] [LIBRARIES library...] [properties of the test]): test/FOLDER/*.cpp as the program
# FOLDER_test. COMPUTING: its references or samples compute as much as what they test.
function(add_core_tests folder)
  cmake_parse_arguments(tests "COMPUTING" "" "LIBRARIES" ${ARGN})
  set(kind plain)
  if(tests_COMPUTING)
    set(kind computing)
  endif()
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/test/${folder}/*.cpp)
  catkin_add_gtest(${folder}_test ${sources} $<TARGET_OBJECTS:tests_${kind}>)
  set_target_properties(${folder}_test PROPERTIES UNITY_BUILD ${ASSEMBLY_CELL_UNITY})
  target_include_directories(${folder}_test PRIVATE ${PROJECT_SOURCE_DIR}/test/support ${PROJECT_SOURCE_DIR}/test/${folder})
  target_link_libraries(${folder}_test assembly_cell_core emulators yaml-cpp gtest_main ${tests_LIBRARIES})
  target_compile_definitions(${folder}_test PRIVATE ${test_definitions})
  target_compile_options(${folder}_test PRIVATE ${test_options_${kind}})
  target_precompile_headers(${folder}_test REUSE_FROM tests_${kind})
  add_dependencies(${folder}_test assembly_cell_core tools)
  test_properties(_ctest_assembly_cell_gtest_${folder}_test ${tests_UNPARSED_ARGUMENTS})
endfunction()

# add_ros_test(PATH [properties of the test]): a rostest of test/ros.
function(add_ros_test path)
  add_rostest(${path})
  get_filename_component(absolute ${path} ABSOLUTE)
  file(RELATIVE_PATH name ${PROJECT_SOURCE_DIR} ${absolute})
  string(REPLACE "/" "_" name ${name})
  test_properties(_ctest_assembly_cell_rostest_${name} ${ARGN})
endfunction()
